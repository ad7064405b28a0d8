//! The refractive surface as a whole: a lobe of reflection and a lobe of refraction.
//!
//! Local frame: +z is the outward normal; `wo` points towards the sensor, `wi` towards the light, both
//! away from the surface; a direction with z > 0 is outside. `eta` is inside over outside. Radiance is
//! transported from `wi` to `wo`: refraction multiplies it by the squared index of the receiving side over
//! that of the sending side.
//!
//! Rough surface (Walter, Marschner, Li & Torrance 2007), index n_o on the side of wo, n_i on that of
//! wi:
//!   reflection  h ~ wo + wi,           f |cos_i| = F D G1(wo) G1(wi) / (4 |cos_o|)      (eq. 20)
//!   refraction  h ~ n_o wo + n_i wi,   f |cos_i| = |wo.h| |wi.h| D G1(wo) G1(wi) (1 - F) n_o^2
//!                                                  / (|cos_o| (n_o wo.h + n_i wi.h)^2)  (eq. 21)
//! with h turned to the side of wo. Their n_i^2 is our n_o^2: eq. 21 transports importance, here it is
//! radiance. Sampling: h from the visible normals of wo, reflection with probability F(wo.h). Then
//!   pdf = F G1(wo) D / (4 |cos_o|),   (1 - F) G1(wo) D |wo.h| n_i^2 |wi.h| / (|cos_o| (...)^2)
//!   weight = f |cos_i| / pdf = G1(wi)   and   G1(wi) (n_o / n_i)^2.

use super::fresnel::fresnel;
use super::microfacet::Microfacets;
use crate::math::DVec3;

#[path = "boundary_facets.rs"]
mod facets;
pub use facets::{FACETS_FROM_OUTSIDE, FEW_FACETS};

/// The surface, one band.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Boundary {
    /// A smooth dielectric: two delta lobes.
    Smooth {
        /// Index inside over outside.
        eta: f64,
    },
    /// A rough dielectric.
    Rough {
        /// Index inside over outside, not 1.
        eta: f64,
        /// Microfacet distribution and roughness.
        facets: Microfacets,
    },
    /// No surface; light passes straight through.
    Matched,
}

/// Event at the surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// `wi` is on the side of `wo`.
    Reflect,
    /// `wi` is on the other side.
    Refract,
}

/// A sampled direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoundarySample {
    /// Unit direction towards the light.
    pub wi: DVec3,
    /// f |cos_i| / pdf.
    pub weight: f64,
    /// Lobe that was sampled: reflection or refraction.
    pub event: Event,
}

impl Boundary {
    /// Draws `wi` for `wo`; `u[0]` chooses the lobe. `None`: the microfacet sends the light into the
    /// surface, and the sample scores 0 (light of multiple scattering between facets is lost).
    #[inline]
    pub fn sample(&self, wo: DVec3, u: [f64; 3]) -> Option<BoundarySample> {
        let Some((h, relative)) = self.facet(wo, [u[1], u[2]]) else {
            return Some(BoundarySample { wi: -wo, weight: 1.0, event: Event::Refract });
        };
        let (wi, event) = split(wo, h, relative, u[0]);
        let shadowing = self.shadowing(wo, wi, event)?;
        Some(self.sample_of(wo, wi, event, shadowing))
    }

    /// The normal of the facet that `wo` meets, and the index of the far side over that of the side of `wo`; `None` where there
    /// is no surface.
    #[inline]
    fn facet(&self, wo: DVec3, u: [f64; 2]) -> Option<(DVec3, f64)> {
        match *self {
            Boundary::Matched => None,
            Boundary::Smooth { eta } => {
                Some((DVec3::new(0.0, 0.0, 1f64.copysign(wo.z)), side_eta(eta, wo)))
            }
            Boundary::Rough { eta, ref facets } => {
                Some((visible_facet(facets, wo, u), side_eta(eta, wo)))
            }
        }
    }

    /// G1 of a direction that a facet sends `wo` to; `None` where that is on the wrong side of the surface.
    #[inline]
    fn shadowing(&self, wo: DVec3, wi: DVec3, event: Event) -> Option<f64> {
        let Boundary::Rough { ref facets, .. } = *self else { return Some(1.0) };
        let sign = 1f64.copysign(wo.z);
        let expected_side = if event == Event::Reflect { sign } else { -sign };
        (wi.z * expected_side > 0.0).then(|| facets.g1(wi))
    }

    /// With this weight beside the squared index of refraction that radiance has.
    #[inline]
    fn sample_of(&self, wo: DVec3, wi: DVec3, event: Event, weight: f64) -> BoundarySample {
        let radiance =
            if event == Event::Refract { 1.0 / square(side_eta(self.eta(), wo)) } else { 1.0 };
        BoundarySample { wi, weight: weight * radiance, event }
    }

    /// f |cos_i| (1/sr) and the density of `wi` given `wo` (1/sr), both without delta lobes: the pair
    /// (value, pdf) that light sampling and MIS need.
    #[inline]
    pub fn eval(&self, wo: DVec3, wi: DVec3) -> (f64, f64) {
        match self {
            Boundary::Rough { eta, facets } => rough(*eta, facets, wo, wi),
            Boundary::Smooth { .. } | Boundary::Matched => (0.0, 0.0),
        }
    }

    /// The least cosine between a direction and what it is refracted to, whatever the normal: at grazing incidence on the side
    /// of the lower index, where the other direction has the critical angle.
    pub fn least_cosine_of_refraction(&self) -> f64 {
        let eta = self.eta();
        eta.min(1.0 / eta)
    }

    /// Draws the direction on the other side for `from`, with forced refraction: h is drawn from the visible
    /// normals of `from` and followed by Snell's law about h, without a choice of lobe. `None` is a failed
    /// sample and scores 0: the facet reflects totally, or sends the light back to its own side. A delta
    /// surface gives [`Self::refract`].
    #[inline]
    pub fn sample_refraction(&self, from: DVec3, u: [f64; 2]) -> Option<DVec3> {
        let Boundary::Rough { eta, facets } = self else { return self.refract(from) };
        let relative = side_eta(*eta, from);
        let h = visible_facet(facets, from, u);
        let surface = fresnel(from.dot(h), relative);
        if surface.cos_t == 0.0 {
            return None;
        }
        let to = through(from, h, relative, surface.cos_t);
        (to.z * from.z < 0.0).then_some(to)
    }

    /// Density of [`Self::sample_refraction`] per solid angle of `to`: the refraction part of the pdf of
    /// [`Self::eval`] without its factor 1 - F,
    ///   G1(from) D |from.h| n_to^2 |to.h| / (|cos_from| (n_from from.h + n_to to.h)^2).
    /// The index squared is that of the *sampled* side, so that with `from` = wo
    ///   f |cos_i| / pdf_refraction(wo, wi) = (1 - F) G1(wi) (n_o / n_i)^2.
    /// Its integral falls short of 1 by the probability of a failed sample. 0 for delta surfaces and
    /// where no facet joins the directions.
    #[inline]
    pub fn pdf_refraction(&self, from: DVec3, to: DVec3) -> f64 {
        let Boundary::Rough { eta, facets } = self else { return 0.0 };
        if from.z * to.z >= 0.0 {
            return 0.0;
        }
        let relative = side_eta(*eta, from);
        let Some(Joining { d, from_h, to_h }) = joining(relative, facets, from, to, false) else {
            return 0.0;
        };
        let visible = facets.g1(from) * d / from.z.abs();
        visible * from_h * square(relative) * -to_h / square(from_h + relative * to_h)
    }

    /// The direction on the other side by Snell about the macroscopic normal, whatever the roughness;
    /// `None` under total internal reflection. Straight through where there is no surface.
    #[inline]
    pub fn refract(&self, from: DVec3) -> Option<DVec3> {
        if matches!(self, Boundary::Matched) {
            return Some(-from);
        }
        let relative = side_eta(self.eta(), from);
        let cos_t = fresnel(from.z.abs(), relative).cos_t;
        let to = DVec3::new(-from.x / relative, -from.y / relative, -cos_t.copysign(from.z));
        (cos_t > 0.0).then_some(to)
    }

    /// 1 - F about the macroscopic normal at the angle of `from`, whatever the roughness; 1 where there
    /// is no surface.
    #[inline]
    pub fn transmittance_smooth(&self, from: DVec3) -> f64 {
        match self {
            Boundary::Matched => 1.0,
            _ => 1.0 - fresnel(from.z.abs(), side_eta(self.eta(), from)).reflectance,
        }
    }

    /// Index inside over outside; 1 where there is no surface.
    #[inline]
    pub fn eta(&self) -> f64 {
        match *self {
            Boundary::Smooth { eta } | Boundary::Rough { eta, .. } => eta,
            Boundary::Matched => 1.0,
        }
    }

    /// True where the surface has delta lobes alone.
    pub fn is_delta(&self) -> bool {
        !matches!(self, Boundary::Rough { .. })
    }
}

#[inline]
fn square(x: f64) -> f64 {
    x * x
}

/// Index of the far side over the side of `wo`.
#[inline]
fn side_eta(eta: f64, wo: DVec3) -> f64 {
    if wo.z > 0.0 { eta } else { 1.0 / eta }
}

/// A facet's normal as seen from `wo`, on the side of `wo`.
#[inline]
fn visible_facet(facets: &Microfacets, wo: DVec3, u: [f64; 2]) -> DVec3 {
    let sign = 1f64.copysign(wo.z);
    // The distribution is even: mirror wo to the upper side, and the facet back.
    let upper = DVec3::new(wo.x, wo.y, wo.z * sign);
    let h = facets.sample_visible(upper, u);
    DVec3::new(h.x, h.y, h.z * sign)
}

/// Snell: the tangential part of `wo` shrinks by `eta` (far side over near side), the normal part is
/// -cos_t.
#[inline(always)]
fn through(wo: DVec3, h: DVec3, eta: f64, cos_t: f64) -> DVec3 {
    (wo.dot(h) / eta - cos_t) * h - wo / eta
}

/// Reflects `wo` about `h` with the probability of Fresnel's reflectance, else refracts it through;
/// `wo.h` > 0, `eta` = far side over near side.
#[inline]
fn split(wo: DVec3, h: DVec3, eta: f64, u: f64) -> (DVec3, Event) {
    let cos = wo.dot(h);
    let surface = fresnel(cos, eta);
    if u < surface.reflectance {
        (2.0 * cos * h - wo, Event::Reflect)
    } else {
        (through(wo, h, eta, surface.cos_t), Event::Refract)
    }
}

/// Value f |cos_i| and density of the rough surface; (0, 0) where no facet joins the directions.
#[inline]
fn rough(eta: f64, facets: &Microfacets, wo: DVec3, wi: DVec3) -> (f64, f64) {
    rough_lobe(eta, facets, wo, wi, wo.z * wi.z > 0.0)
}

/// [`rough`] for one lobe, which the facets also send to the wrong side of the surface: there it is the
/// density of failed samples.
#[inline]
fn rough_lobe(eta: f64, facets: &Microfacets, wo: DVec3, wi: DVec3, reflects: bool) -> (f64, f64) {
    let relative = side_eta(eta, wo);
    let Some(Joining { d, from_h: oh, to_h: ih }) = joining(relative, facets, wo, wi, reflects) else {
        return (0.0, 0.0);
    };
    let visible = facets.g1(wo) * d / wo.z.abs();
    let reflectance = fresnel(oh, relative).reflectance;
    let pdf = if reflects {
        reflectance * visible * 0.25
    } else {
        (1.0 - reflectance) * visible * oh * square(relative) * -ih / square(oh + relative * ih)
    };
    let radiance = if reflects { 1.0 } else { 1.0 / square(relative) };
    (pdf * facets.g1(wi) * radiance, pdf)
}

/// The facet that joins two directions.
struct Joining {
    /// Density of facets with its normal h.
    d: f64,
    /// from.h, positive.
    from_h: f64,
    /// to.h, negative on the far side of the facet.
    to_h: f64,
}

/// `relative` = index of the far side over that of the side of `from`; `None` where no facet joins them.
#[inline]
fn joining(
    relative: f64,
    facets: &Microfacets,
    from: DVec3,
    to: DVec3,
    reflects: bool,
) -> Option<Joining> {
    let sign = 1f64.copysign(from.z);
    // In units of the near side's index: the far side's is `relative`.
    let sum = if reflects { from + to } else { from + relative * to };
    let sum = if sum.z * sign < 0.0 { -sum } else { sum };
    let h = sum.normalize();
    let (from_h, to_h) = (from.dot(h), to.dot(h));
    let facet_faces = from_h > 0.0 && if reflects { to_h > 0.0 } else { to_h < 0.0 };
    if !facet_faces || from.z == 0.0 || to.z == 0.0 {
        return None;
    }
    Some(Joining { d: facets.d(DVec3::new(h.x, h.y, h.z * sign)), from_h, to_h })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Integral, integrate, sin_cos_turns};
    use crate::optics::microfacet::MicrofacetKind;
    use std::f64::consts::PI;

    pub(super) fn direction(cos: f64, phi: f64) -> DVec3 {
        let sin = (1.0 - cos * cos).sqrt();
        let (s, c) = sin_cos_turns(phi);
        DVec3::new(sin * c, sin * s, cos)
    }

    pub(super) fn rough_surfaces() -> impl Iterator<Item = Boundary> {
        [MicrofacetKind::Ggx, MicrofacetKind::Beckmann].into_iter().flat_map(|kind| {
            [(1.3, 0.2), (1.5, 0.04), (1.5, 0.5), (0.8, 0.3)]
                .map(|(eta, alpha)| Boundary::Rough { eta, facets: Microfacets { kind, alpha } })
        })
    }

    /// 1/g, 1/g^2, 1/g^3 for the real root g of g^4 = g + 1.
    const R3: [f64; 3] = [0.819_172_513_396_164_4, 0.671_043_606_703_789_2, 0.549_700_477_901_970_2];

    fn pieces(a: f64, b: f64, n: u32, tolerance: f64, f: impl Fn(f64) -> f64) -> Integral {
        let edge = |i: u32| a + (b - a) * f64::from(i) / f64::from(n);
        let sum =
            |x: Integral, y: Integral| Integral { value: x.value + y.value, error: x.error + y.error };
        (0..n)
            .map(|i| integrate(&f, edge(i), edge(i + 1), tolerance / f64::from(n)))
            .fold(Integral { value: 0.0, error: 0.0 }, sum)
    }

    fn grid(n: u32) -> impl Iterator<Item = f64> {
        (0..n).map(move |i| (f64::from(i) + 0.43) / f64::from(n))
    }

    /// D5: every sample's weight times its density is the value, and both lobes and failures occur.
    #[test]
    fn sample_weight_times_density_is_the_value() {
        for surface in rough_surfaces() {
            for cos in [0.95, 0.4, 0.05, -0.05, -0.4, -0.95] {
                let wo = direction(cos, 0.21);
                let mut drawn = 0;
                for u0 in grid(16) {
                    for u1 in grid(16) {
                        for u2 in grid(16) {
                            let Some(s) = surface.sample(wo, [u0, u1, u2]) else { continue };
                            let (value, pdf) = surface.eval(wo, s.wi);
                            assert!(pdf > 0.0);
                            assert!(
                                (s.weight * pdf / value - 1.0).abs() < 1e-10,
                                "{surface:?} {cos}: {s:?} {value}"
                            );
                            assert_eq!(s.event == Event::Reflect, s.wi.z * wo.z > 0.0);
                            assert!((s.wi.length() - 1.0).abs() < 1e-13);
                            drawn += 1;
                        }
                    }
                }
                assert!(drawn > 1500, "{surface:?} {cos}: {drawn}");
            }
        }
    }

    /// D8: reciprocity f(a -> b) / n_b^2 = f(b -> a) / n_a^2, f without the cosine of the source.
    #[test]
    fn reciprocity() {
        for surface in rough_surfaces() {
            let Boundary::Rough { eta, .. } = surface else { unreachable!() };
            let index2 = |w: DVec3| if w.z > 0.0 { 1.0 } else { eta * eta };
            let mut joined = 0;
            for a in [0.9, 0.3, -0.3, -0.8] {
                for b in grid(40) {
                    for phi in grid(8) {
                        let (wo, wi) = (direction(a, 0.1), direction(2.0 * b - 1.0, phi));
                        let forward = surface.eval(wo, wi).0 / (wi.z.abs() * index2(wo));
                        let backward = surface.eval(wi, wo).0 / (wo.z.abs() * index2(wi));
                        if forward.max(backward) > 1e-200 {
                            assert!((forward / backward - 1.0).abs() < 1e-10, "{wo} {wi}");
                            joined += 1;
                        }
                    }
                }
            }
            assert!(joined > 50);
        }
    }

    /// D3: the lobe is chosen with exactly Fresnel's reflectance, counted over 2^16 values of u.
    #[test]
    fn lobe_choice_by_enumeration() {
        for eta in [1.3, 1.5, 1.0] {
            for cos in [1.0, 0.3, -0.9, -0.2] {
                let wo = direction(cos, 0.4);
                let n = 1 << 16;
                let reflected = (0..n)
                    .filter(|&k| {
                        let u = (f64::from(k) + 0.5) / f64::from(n);
                        let sample = Boundary::Smooth { eta }.sample(wo, [u, 0.5, 0.5]);
                        sample.is_some_and(|s| s.event == Event::Reflect)
                    })
                    .count();
                let expected = fresnel(cos.abs(), side_eta(eta, wo)).reflectance;
                let share = reflected as f64 / f64::from(n);
                assert!((share - expected).abs() <= 1.0 / f64::from(n), "{eta} {cos}");
            }
        }
    }

    /// The smooth surface obeys Snell's law and conserves radiance over a there-and-back.
    #[test]
    fn smooth_refraction_follows_snell() {
        let surface = Boundary::Smooth { eta: 1.4 };
        for cos in [0.9, 0.5, 0.1] {
            let wo = direction(cos, 0.7);
            let s = surface.sample(wo, [0.999_999, 0.0, 0.0]).expect("refracts");
            assert!(surface.is_delta() && surface.eval(wo, s.wi) == (0.0, 0.0));
            assert!(((1.0 - cos * cos).sqrt() / (1.0 - s.wi.z * s.wi.z).sqrt() - 1.4).abs() < 1e-12);
            assert!((s.weight - 1.0 / (1.4 * 1.4)).abs() < 1e-15);
            let back = surface.sample(s.wi, [0.999_999, 0.0, 0.0]).expect("refracts back");
            assert!((back.wi - wo).length() < 1e-12);
            assert!((s.weight * back.weight - 1.0).abs() < 1e-15);
        }
    }

    /// D7: both lobes over the sphere add up to 1, and the share that lands on the wrong side of the
    /// surface is what the sampler reports as failed (midpoint rule in the sampler's unit cube).
    /// The density has kinks on curves inside the sphere (total reflection, facets seen edge-on) where
    /// this product rule converges slowly and under-reports its error: 1e-6 is what it resolves.
    #[test]
    fn densities_and_failures_sum_to_one() {
        for surface in rough_surfaces() {
            let Boundary::Rough { eta, facets } = surface else { unreachable!() };
            if facets.alpha < 0.1 {
                continue; // the sphere integral of a narrow peak; D5 and the facets' D7 cover it
            }
            for cos in [0.8, 0.2, -0.7] {
                let wo = direction(cos, 0.0);
                let lobe = |from: f64, reflects: bool| {
                    pieces(from, from + 0.5 * PI, 32, 1e-10, |theta| {
                        let (sin, cos) = (crate::math::sin(theta), crate::math::cos(theta));
                        let ring =
                            |phi: f64| rough_lobe(eta, &facets, wo, direction(cos, phi), reflects).1;
                        4.0 * PI * sin * pieces(0.0, 0.5, 16, 1e-12, ring).value
                    })
                };
                let (above, below) = (0.0, 0.5 * PI);
                let (own, other) = if cos > 0.0 { (above, below) } else { (below, above) };
                let sent = [lobe(own, true), lobe(other, false)];
                let failed = [lobe(other, true), lobe(own, false)];
                let sum = |x: &[Integral]| x.iter().map(|i| i.value).sum::<f64>();
                let error: f64 = sent.iter().chain(&failed).map(|i| i.error).sum();
                let total = sum(&sent) + sum(&failed);
                assert!(error < 1e-8, "the quadrature did not resolve: {error}");
                assert!((total - 1.0).abs() < 1e-6, "{surface:?} {cos}: {total}");

                // Roberts' R3 sequence fills the cube evenly.
                let n = 150_000;
                let point = |k: u32| R3.map(|step| (f64::from(k) * step).fract());
                let nulls = (0..n).filter(|&k| surface.sample(wo, point(k)).is_none()).count();
                let counted = nulls as f64 / f64::from(n);
                // Evenly spread points err less than random ones, of which five standard errors hold.
                let share = sum(&failed);
                let bound = (5.0 * (share * (1.0 - share) / f64::from(n)).sqrt()).min(2e-3);
                assert!((counted - share).abs() < bound, "{surface:?} {cos}: {counted} {failed:?}");
            }
        }
    }

    /// The probability of the sides that forced refraction may fail with, and of what it draws, is 1:
    /// the density over the far side by quadrature, failures counted over an evenly spread cube. The
    /// tolerances are those of [`densities_and_failures_sum_to_one`].
    #[test]
    fn refraction_and_its_failures_sum_to_one() {
        for surface in rough_surfaces() {
            let Boundary::Rough { facets, .. } = surface else { unreachable!() };
            if facets.alpha < 0.1 {
                continue;
            }
            for cos in [0.8, -0.9, -0.5] {
                let from = direction(cos, 0.0);
                let far = if cos > 0.0 { 0.5 * PI } else { 0.0 };
                let sent = pieces(far, far + 0.5 * PI, 32, 1e-10, |theta| {
                    let (sin, cos) = (crate::math::sin(theta), crate::math::cos(theta));
                    let ring = |phi: f64| surface.pdf_refraction(from, direction(cos, phi));
                    4.0 * PI * sin * pieces(0.0, 0.5, 16, 1e-12, ring).value
                });
                assert!(sent.error < 1e-8, "the quadrature did not resolve: {sent:?}");
                let n = 150_000;
                let point = |k: u32| [R3[0], R3[1]].map(|step| (f64::from(k) * step).fract());
                let nulls =
                    (0..n).filter(|&k| surface.sample_refraction(from, point(k)).is_none()).count();
                let counted = nulls as f64 / f64::from(n);
                let share = 1.0 - sent.value;
                // As above; where nothing fails, the quadrature is good to 1e-6.
                let error = (share * (1.0 - share)).max(0.0) / f64::from(n);
                let bound = (5.0 * error.sqrt()).clamp(1e-6, 2e-3);
                assert!((counted - share).abs() < bound, "{surface:?} {cos}: {counted} {share}");
            }
        }
    }

    /// Forced refraction is the refraction part of the whole, without its choice of lobe; and the value
    /// over its density is (n_o / n_i)^2 (1 - F) G1(wi), from either side, with F of the facet by Snell.
    #[test]
    fn value_over_refraction_density() {
        for surface in rough_surfaces() {
            let Boundary::Rough { eta, facets } = surface else { unreachable!() };
            for cos in [0.95, 0.4, 0.05, -0.05, -0.4, -0.95] {
                let wo = direction(cos, 0.21);
                let (near, far) = if cos > 0.0 { (1.0, eta) } else { (eta, 1.0) };
                let mut drawn = 0;
                for u0 in grid(32) {
                    for u1 in grid(32) {
                        let Some(wi) = surface.sample_refraction(wo, [u0, u1]) else { continue };
                        let forced = surface.pdf_refraction(wo, wi);
                        let (value, pdf) = surface.eval(wo, wi);
                        let h = (near * wo + far * wi).normalize();
                        let reflectance = fresnel(wo.dot(h).abs(), far / near).reflectance;
                        assert!(forced > 0.0 && (wi.length() - 1.0).abs() < 1e-13);
                        // 1 - F is a difference, of numbers near 1 where it is small.
                        let digits = 1e-10 + 1e-13 / (1.0 - reflectance);
                        assert!((pdf / forced / (1.0 - reflectance) - 1.0).abs() < digits);
                        let expected = (near / far) * (near / far) * (1.0 - reflectance) * facets.g1(wi);
                        assert!(
                            (value / forced / expected - 1.0).abs() < digits,
                            "{surface:?} {cos}: {value} {forced} {expected}"
                        );
                        assert_eq!(surface.pdf_refraction(wo, DVec3::new(wi.x, wi.y, -wi.z)), 0.0);
                        drawn += 1;
                    }
                }
                // Towards the thinner side oblique facets reflect totally, all of them where they are
                // flat.
                let is_total = fresnel(cos.abs(), far / near).reflectance == 1.0;
                assert!(is_total || drawn > 300, "{surface:?} {cos}: {drawn}");
            }
        }
    }

    /// Snell about the macroscopic normal is what the smooth surface draws, whatever the roughness.
    #[test]
    fn refraction_about_the_macroscopic_normal() {
        let facets = Microfacets { kind: MicrofacetKind::Ggx, alpha: 0.3 };
        for eta in [0.8, 1.3, 1.5] {
            let (smooth, rough) = (Boundary::Smooth { eta }, Boundary::Rough { eta, facets });
            for i in 1..40 {
                let from = direction(f64::from(i) / 20.0 - 0.999, 0.3);
                let drawn = smooth.sample(from, [1.0, 0.0, 0.0]).expect("a direction");
                let is_total = smooth.transmittance_smooth(from) == 0.0;
                assert_eq!(smooth.refract(from).is_none(), is_total);
                assert_eq!(rough.refract(from), smooth.refract(from));
                assert_eq!(smooth.sample_refraction(from, [0.2, 0.7]), smooth.refract(from));
                assert_eq!(rough.transmittance_smooth(from), smooth.transmittance_smooth(from));
                if let Some(to) = smooth.refract(from) {
                    assert!((to - drawn.wi).length() < 1e-14 && to.z * from.z < 0.0);
                    assert_eq!(smooth.pdf_refraction(from, to), 0.0);
                    let back = smooth.refract(to).expect("goes back");
                    assert!((back - from).length() < 1e-12, "{eta} {from}");
                }
            }
        }
        let from = direction(0.3, 0.1);
        assert_eq!(Boundary::Matched.refract(from), Some(-from));
        assert_eq!(Boundary::Matched.sample_refraction(from, [0.1, 0.2]), Some(-from));
        assert_eq!((Boundary::Matched.transmittance_smooth(from), Boundary::Matched.eta()), (1.0, 1.0));
        assert_eq!(Boundary::Rough { eta: 1.3, facets }.eta(), 1.3);
    }
}
