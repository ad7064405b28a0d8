//! The end of a path that scatters twice and leaves: its integrand and the four densities with which
//! subdivision next-event estimation (Koerner, Novak, Kutz, Habel & Jarosz 2016, Subdivision next-event
//! estimation for path-traced subsurface scattering) draws it, a second time, with places for defects.
//!
//! x_i and x_j lie in the medium, x_k on the boundary with outward normal n, w_ab points from a to b,
//! w_in is the direction of travel on arrival at x_i, w_L points from x_k to the light. d is a distance,
//! T(d) = exp(-sigma_t d), ph a phase function, n1 = 1 and n2 = eta the indices outside and inside.
//!
//!   f  = ph(w_in.w_ij) T(d_ij) / d_ij^2  sigma_s ph(w_ij.w_jk) T(d_jk) c_k / d_jk^2  f_t |n.w_L|  L
//!   bsdf           rr ph(w_in.w_ij) sigma_t T(d_ij) / d_ij^2  rr ph(w_ij.w_jk) T(d_jk) c_k / d_jk^2
//!                  (1 - F) p(w_L | w_kj)
//!   light          the same up to x_k, then p_L(w_L)
//!   top to bottom  q p(x_k | x_i) p_L(w_L) p(w_kj | w_L) p_t(d_jk) / d_jk^2
//!   bottom to top  q p(x_k | x_i) p(w_ij) p_s(d_ij) / d_ij^2  p(w_L | w_kj)
//!
//! c_k = w_jk.n. The flight to the boundary has the probability T, not the density sigma_t T. rr =
//! albedo is the survival at a medium vertex, q the probability of a call. x_k is where a uniform
//! direction first meets the boundary, p(x_k | x_i) = (w_ik.n) / (4 pi d_ik^2) where nothing is between.
//! Refraction is forced where the last two draw it, so there 1 - F is in no density.
//!
//! f and the densities are per dV(x_j) dA(x_k) dw_L with their Dirac factors, written in w_L, left out.
//! A technique whose factors are not those of the class cannot draw it: `bsdf` and `bottom to top` no
//! parallel light, `light` no smooth boundary. A smooth boundary's p(w_kj | w_L) is a Dirac in w_kj, in
//! w_L therefore J = dw_L / dw_kj = eta^2 |n.w_kj| / |n.w_L| (Snell's law, differentiated).

use std::f64::consts::PI;

use scatterproof::estimators::{Cost, Scores};
use scatterproof::geometry::{Hit, Ray, Side};
use scatterproof::math::{DVec3, Frame, sin_cos_turns};
use scatterproof::optics::boundary::Boundary;
use scatterproof::optics::fresnel::fresnel;
use scatterproof::optics::medium::Medium;
use scatterproof::optics::microfacet::{MicrofacetKind, Microfacets};
use scatterproof::sampling::distance::{Equiangular, pdf_distance_exponential, transmittance};
use scatterproof::sampling::towards::TowardsPoint;
use scatterproof::scene::Scene;

use super::alone::Technique;
use super::defects::Defect;
use super::surface::{Surface, refract};

/// Probability of a call.
pub const CALL: f64 = 0.75;

/// The techniques, in the order of [`Ends::densities`].
pub const BSDF: usize = 0;
pub const LIGHT: usize = 1;
pub const TOP_TO_BOTTOM: usize = 2;
pub const BOTTOM_TO_TOP: usize = 3;

/// A medium vertex and the direction of travel on arrival.
#[derive(Clone, Copy, Debug)]
pub struct Vertex {
    pub point: DVec3,
    pub travel: DVec3,
}

/// The vertices of an end.
#[derive(Clone, Copy, Debug)]
pub struct Ends {
    pub start: Vertex,
    pub x_j: DVec3,
    pub exit: Hit,
    /// Unit direction w_L towards the light.
    pub to_light: DVec3,
    pub light: usize,
}

/// Transmission of an interface between w_kj and w_L.
struct Through {
    /// Value of the integrand, f_t |n.w_L|.
    value: f64,
    /// Probability 1 - F of refraction.
    select: f64,
    /// p(w_L | w_kj) and p(w_kj | w_L), refraction being certain.
    fwd: f64,
    rev: f64,
}

/// One band of a scene.
#[derive(Clone, Copy)]
pub struct Model<'a> {
    pub scene: &'a Scene,
    pub medium: Medium,
    pub boundary: Boundary,
    pub band: usize,
    pub defect: Defect,
}

impl Model<'_> {
    pub fn of(scene: &Scene, band: usize, defect: Defect) -> Model<'_> {
        Model { scene, medium: scene.medium[band], boundary: scene.boundary[band], band, defect }
    }

    /// Is there a light that the technique can draw a way to?
    pub fn can_draw(&self, technique: usize) -> bool {
        match technique {
            LIGHT => !self.is_smooth(),
            BSDF | BOTTOM_TO_TOP => !self.scene.lights.iter().all(|light| light.is_directional()),
            _ => true,
        }
    }

    fn is_smooth(&self) -> bool {
        matches!(self.boundary, Boundary::Smooth { .. })
    }

    /// Chance of each light.
    pub fn choice(&self) -> f64 {
        1.0 / self.scene.lights.len() as f64
    }

    /// Whether the segment that leaves `origin` inwards is unoccluded.
    pub fn is_clear(&self, origin: DVec3, to: DVec3, from: Option<&Hit>, scores: &mut Scores) -> bool {
        let between = to - origin;
        let ray = Ray { origin, dir: between.normalize() };
        scores.count(Cost::Rays);
        let from = from.map(|hit| hit.face);
        self.scene.shape.intersect(&ray, Side::Inside, from, between.length()).is_none()
    }

    /// Whether light reaches a point of the surface.
    pub fn is_lit(&self, exit: &Hit, to_light: DVec3, scores: &mut Scores) -> bool {
        scores.count(Cost::ShadowRays);
        let ray = Ray { origin: exit.point, dir: to_light };
        !self.scene.shape.occluded(&ray, Some(exit.face))
    }

    /// The integrand without the light's radiance, and the densities; those of calls are left out where
    /// they do not take part. `is_first_hit` states that x_k was found from x_i; else it is searched.
    /// `p_light` is the light's density, chance of the light included, and that chance alone for
    /// parallel light. The caller tests occlusion between x_i and x_j, x_j and x_k, x_k and the light.
    pub fn evaluate(
        &self,
        ends: &Ends,
        p_light: f64,
        is_first_hit: bool,
        technique: Technique,
        scores: &mut Scores,
    ) -> Option<(f64, [f64; 4])> {
        let Ends { start, x_j, exit, to_light, light } = *ends;
        let x_k = exit.point;
        let (ij, jk, ik) = (x_j - start.point, x_k - x_j, x_k - start.point);
        let (d_ij, d_jk, d_ik) = (ij.length(), jk.length(), ik.length());
        let (w_ij, w_jk, w_ik) = (ij / d_ij, jk / d_jk, ik / d_ik);
        let cos_jk = w_jk.dot(exit.normal);
        if cos_jk <= 0.0 || to_light.dot(exit.normal) <= 0.0 {
            return None;
        }
        let frame = Frame::about(exit.shading_normal);
        let [kj, light_side] = [-w_jk, to_light].map(|w| frame.to_local(w));
        let through = through(self.boundary, kj, light_side, self.defect)?;

        let Medium { sigma_t, albedo, phase, .. } = self.medium;
        let (t_ij, t_jk) = (transmittance(sigma_t, d_ij), transmittance(sigma_t, d_jk));
        let (h_i, h_j) = (phase.pdf(start.travel.dot(w_ij)), phase.pdf(w_ij.dot(w_jk)));
        let at_j = 1.0 / (d_ij * d_ij);
        let at_k = match self.defect {
            Defect::ShadingCosineAtExit => w_jk.dot(exit.shading_normal).max(0.0) / (d_jk * d_jk),
            _ => cos_jk / (d_jk * d_jk),
        };
        let value = h_i * t_ij * at_j * albedo * sigma_t * h_j * t_jk * at_k * through.value;

        let survival = if self.defect == Defect::SurvivalMissing { 1.0 } else { albedo };
        let escape = match self.defect {
            Defect::EscapeDensity => sigma_t * t_jk,
            _ => t_jk,
        };
        let prefix = survival * survival * h_i * sigma_t * t_ij * at_j * h_j * escape * at_k;
        let select = if self.defect == Defect::SelectionMissing { 1.0 } else { through.select };
        let is_parallel = self.scene.lights[light].is_directional();
        let bsdf = if is_parallel { 0.0 } else { prefix * select * through.fwd };
        let lit = if self.is_smooth() { 0.0 } else { prefix * p_light };

        let [uses_top, uses_bottom] =
            [TOP_TO_BOTTOM, BOTTOM_TO_TOP].map(|index| technique.uses(index, self));
        let cos_ik = w_ik.dot(exit.normal);
        let is_called = uses_top || uses_bottom;
        let is_seen = |scores: &mut Scores| {
            let ignored = self.defect == Defect::FirstHitIgnored;
            cos_ik > 0.0 && (ignored || self.is_clear(x_k, start.point, Some(&exit), scores))
        };
        if !is_called || !(is_first_hit || is_seen(scores)) {
            return Some((value, [bsdf, lit, 0.0, 0.0]));
        }
        let cosine = match self.defect {
            Defect::ProbeCosineMissing => 1.0,
            Defect::ProbeCosineOfLast => cos_jk,
            _ => cos_ik,
        };
        let call = if self.defect == Defect::CallChanceMissing { 1.0 } else { CALL };
        let probe = call * cosine / (4.0 * PI * d_ik * d_ik);
        let at_j_from_k = match self.defect {
            Defect::WrongDistance => at_j,
            _ => 1.0 / (d_jk * d_jk),
        };
        let mut densities = [bsdf, lit, 0.0, 0.0];
        if uses_top {
            let down = self.pdf_down(-ik, -w_jk, d_jk) * at_j_from_k;
            densities[TOP_TO_BOTTOM] = probe * p_light * through.rev * down;
        }
        if uses_bottom && !is_parallel {
            let towards = TowardsPoint::new(ik).map_or(0.0, |towards| towards.pdf(w_ij));
            let along = equiangular(ik, w_ij, f64::INFINITY, d_ij);
            let bottom = probe * (0.5 * h_i + 0.5 * towards) * along * at_j * through.fwd;
            densities[BOTTOM_TO_TOP] = match self.defect {
                Defect::SelectionInBottom => bottom * through.select,
                _ => bottom,
            };
        }
        Some((value, densities))
    }

    /// Density of a distance t from x_k along w_kj: exponential and equiangular towards x_i, half each,
    /// on the endless ray.
    fn pdf_down(&self, to_start: DVec3, w_kj: DVec3, t: f64) -> f64 {
        0.5 * pdf_distance_exponential(self.medium.sigma_t, t)
            + 0.5 * equiangular(to_start, w_kj, f64::INFINITY, t)
    }

    /// From one side through the interface to the other, refraction being certain; `None` where there is
    /// none.
    pub fn draw_through(&self, exit: &Hit, known: DVec3, u: [f64; 2]) -> Option<DVec3> {
        let frame = Frame::about(exit.shading_normal);
        let local = frame.to_local(known);
        let side = known.dot(exit.normal) > 0.0;
        let drawn = refract(local, self.facet(local, u), self.index_ratio(local))?;
        let world = frame.to_world(drawn);
        let crosses = drawn.z * local.z < 0.0 && (local.z > 0.0) == side;
        (crosses && (world.dot(exit.normal) > 0.0) != side).then_some(world)
    }

    /// A facet as seen from a direction, on that direction's side.
    fn facet(&self, local: DVec3, u: [f64; 2]) -> DVec3 {
        let sign = 1f64.copysign(local.z);
        let Some(facets) = interface(self.boundary).1 else { return sign * DVec3::Z };
        let h = facets.sample_visible(local.with_z(local.z.abs()), u);
        h.with_z(sign * h.z)
    }

    /// Index on a direction's side over the index on the other.
    fn index_ratio(&self, local: DVec3) -> f64 {
        let eta = interface(self.boundary).0;
        if local.z > 0.0 { 1.0 / eta } else { eta }
    }

    /// From inside through the interface, refraction being a matter of chance; `None` where light is
    /// reflected or the facet fails.
    pub fn draw_exit(&self, exit: &Hit, kj: DVec3, u: [f64; 3]) -> Option<DVec3> {
        let local = Frame::about(exit.shading_normal).to_local(kj);
        let h = self.facet(local, [u[1], u[2]]);
        let select = 1.0 - fresnel(local.dot(h), 1.0 / interface(self.boundary).0).reflectance;
        if u[0] < select { self.draw_through(exit, kj, [u[1], u[2]]) } else { None }
    }
}

/// Density of an equiangular distance; 0 where there is nothing to sample.
fn equiangular(offset: DVec3, dir: DVec3, t_max: f64, t: f64) -> f64 {
    Equiangular::towards(offset, dir, t_max).map_or(0.0, |along| along.pdf_distance(t))
}

/// Relative index, and facets where there are any.
pub fn interface(boundary: Boundary) -> (f64, Option<Microfacets>) {
    match boundary {
        Boundary::Matched => (1.0, None),
        Boundary::Smooth { eta } => (eta, None),
        Boundary::Rough { eta, facets } => (eta, Some(facets)),
    }
}

/// Refraction between w_kj (inside, z < 0) and w_L (outside, z > 0); Walter et al. 2007, eq. 16, 17, 21,
/// for radiance that goes from w_L to w_kj, and visible normals for both densities.
fn through(boundary: Boundary, kj: DVec3, to_light: DVec3, defect: Defect) -> Option<Through> {
    let (eta, facets) = interface(boundary);
    if kj.z >= 0.0 || to_light.z <= 0.0 {
        return None;
    }
    // Radiance inside is eta^2 times radiance outside.
    let radiance = if defect == Defect::RadianceEtaSquaredMissing { 1.0 } else { eta * eta };
    let Some(facets) = facets else {
        let select = 1.0 - fresnel(to_light.z, eta).reflectance;
        let jacobian = match defect {
            Defect::JacobianMissing => 1.0,
            _ => eta * eta * -kj.z / to_light.z,
        };
        return Some(Through { value: select * radiance, select, fwd: 1.0, rev: jacobian });
    };
    let mut h = (to_light + eta * kj).normalize();
    if h.z < 0.0 {
        h = -h;
    }
    let (out, inn) = (to_light.dot(h), kj.dot(h));
    if out <= 0.0 || inn >= 0.0 {
        return None;
    }
    let inn = -inn;
    let denominator = (out - eta * inn) * (out - eta * inn);
    let (d, g_out, g_in) = (facets.d(h), facets.g1(to_light), facets.g1(kj));
    let select = 1.0 - fresnel(out, eta).reflectance;
    let common = d * out * inn / denominator;
    let inside2 = if defect == Defect::ReverseIndex { 1.0 } else { eta * eta };
    Some(Through {
        value: common * g_out * g_in * select * radiance / -kj.z,
        select,
        fwd: common * g_in / -kj.z,
        rev: common * g_out * inside2 / to_light.z,
    })
}

/// What must hold to rounding between a rough exit and `surface`, which was written apart from it: the
/// value, and the density of both directions; and whether it is broken.
pub fn identities(defect: Defect) -> Vec<(String, bool)> {
    let facets = Microfacets { kind: MicrofacetKind::Ggx, alpha: 0.3 };
    let boundary = Boundary::Rough { eta: 1.4, facets };
    let surface = Surface { eta: 1.4, facets, defect: Defect::None };
    let close = |a: f64, b: f64| (a - b).abs() <= 1e-9 * a.abs().max(b.abs());
    let names = ["identity exit-value", "identity exit-density", "identity entry-density"];
    let mut broken = [false; 3];
    let mut joined = 0;
    for (kj, to_light) in pairs() {
        let Some(exit) = through(boundary, kj, to_light, defect) else { continue };
        let (value, out) = surface.eval(kj, to_light);
        let (_, back) = surface.eval(to_light, kj);
        broken[0] |= !close(exit.value, value);
        broken[1] |= !close(exit.select * exit.fwd, out);
        broken[2] |= !close(exit.select * exit.rev, back);
        joined += u32::from(value > 0.0);
    }
    names.into_iter().zip(broken).map(|(name, broken)| (name.into(), broken || joined < 50)).collect()
}

/// Directions inside and outside that facets of moderate slopes join.
fn pairs() -> impl Iterator<Item = (DVec3, DVec3)> {
    let direction = |cos: f64, turns: f64| {
        let (sin_phi, cos_phi) = sin_cos_turns(turns);
        let sin = (1.0 - cos * cos).sqrt();
        DVec3::new(sin * cos_phi, sin * sin_phi, cos)
    };
    let steps = |n: u32| (0..n).map(move |i| (f64::from(i) + 0.5) / f64::from(n));
    steps(6).flat_map(move |a| {
        steps(12).flat_map(move |b| steps(6).map(move |turns| (direction(-a, 0.1), direction(b, turns))))
    })
}
