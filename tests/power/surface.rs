//! The rough dielectric a second time, written from Walter, Marschner, Li & Torrance 2007 for the test's
//! own path tracer, with places for defects.

use scatterproof::geometry::Hit;
use scatterproof::math::{DVec3, Frame};
use scatterproof::optics::boundary::Boundary;
use scatterproof::optics::fresnel::fresnel;
use scatterproof::optics::microfacet::Microfacets;

use super::defects::Defect;

/// A rough dielectric; z > 0 is outside, `eta` inside over outside.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    pub eta: f64,
    pub facets: Microfacets,
    pub defect: Defect,
}

/// A direction towards the light.
#[derive(Clone, Copy, Debug)]
pub struct Drawn {
    pub wi: DVec3,
    /// f |cos| / pdf.
    pub weight: f64,
    pub pdf: f64,
}

impl Surface {
    /// Index of refraction on the side of a direction.
    fn index(&self, w: DVec3) -> f64 {
        if w.z > 0.0 { 1.0 } else { self.eta }
    }

    /// Reflectance of a facet at cosine `cos` to `wo`.
    pub fn reflectance(&self, wo: DVec3, cos: f64) -> f64 {
        let (near, far) = (self.index(wo), self.index(-wo));
        match self.defect {
            Defect::FresnelSideSwapped => fresnel(cos, near / far).reflectance,
            _ => fresnel(cos, far / near).reflectance,
        }
    }

    /// Factor of refraction on radiance from `wi` to `wo`.
    pub fn radiance(&self, wo: DVec3, wi: DVec3) -> f64 {
        let (n_o, n_i) = (self.index(wo), self.index(wi));
        match self.defect {
            Defect::EtaSquaredMissingBothWays => 1.0,
            Defect::EtaSquaredMissingOnEntry if wi.z < 0.0 => 1.0,
            _ => (n_o / n_i) * (n_o / n_i),
        }
    }

    /// f |cos_i| and the density of `wi`, both per solid angle.
    pub fn eval(&self, wo: DVec3, wi: DVec3) -> (f64, f64) {
        let (mut value, pdf) = self.eval_correctly_or_not(wo, wi);
        match self.defect {
            Defect::CosineMissing => value /= wi.z.abs(),
            Defect::EtaSquaredMissingInEval if wo.z * wi.z < 0.0 => value /= self.radiance(wo, wi),
            _ => {}
        }
        (value, pdf)
    }

    fn eval_correctly_or_not(&self, wo: DVec3, wi: DVec3) -> (f64, f64) {
        if wo.z == 0.0 || wi.z == 0.0 {
            return (0.0, 0.0);
        }
        let reflects = wo.z * wi.z > 0.0;
        let (n_o, n_i) = (self.index(wo), self.index(wi));
        let mut h = match self.defect {
            _ if reflects => (wo + wi).normalize(),
            Defect::EtaInvertedInHalfVector => (n_i * wo + n_o * wi).normalize(),
            _ => (n_o * wo + n_i * wi).normalize(),
        };
        if h.z * wo.z < 0.0 {
            h = -h;
        }
        let (oh, ih) = (wo.dot(h), wi.dot(h));
        if oh <= 0.0 || (ih > 0.0) != reflects {
            return (0.0, 0.0);
        }
        // The facets are the same seen from below.
        let d = self.facets.d(h.with_z(h.z.abs()));
        let (g_o, g_i) = (self.facets.g1(wo), self.facets.g1(wi));
        let pdf_h = g_o * d * oh / wo.z.abs();
        let reflectance = self.reflectance(wo, oh);
        if reflects {
            let value = reflectance * d * g_o * g_i / (4.0 * wo.z.abs());
            return (value, reflectance * pdf_h / (4.0 * oh));
        }
        // dh / dwi = n_i^2 |wi.h| / (n_o wo.h + n_i wi.h)^2 (Walter et al., eq. 17).
        let sum = n_o * oh + n_i * ih;
        let jacobian = n_i * n_i * -ih / (sum * sum);
        let value = (1.0 - reflectance) * d * g_o * g_i * oh * jacobian / wo.z.abs();
        let pdf = match self.defect {
            Defect::ReflectionJacobian => (1.0 - reflectance) * pdf_h / (4.0 * -ih),
            _ => (1.0 - reflectance) * pdf_h * jacobian,
        };
        (value * self.radiance(wo, wi), pdf)
    }

    /// Draws a facet, then reflection or refraction; `None` where the light would go into the surface.
    pub fn sample(&self, wo: DVec3, u: [f64; 3]) -> Option<Drawn> {
        let upper = wo.with_z(wo.z.abs());
        let mut h = self.facets.sample_visible(upper, [u[1], u[2]]);
        if wo.z < 0.0 {
            h.z = -h.z;
        }
        let cos = wo.dot(h);
        let reflects = u[0] < self.reflectance(wo, cos);
        let wi = if reflects { 2.0 * cos * h - wo } else { self.refract(wo, h)? };
        if (wi.z * wo.z > 0.0) != reflects {
            return None;
        }
        let (value, pdf) = self.eval_correctly_or_not(wo, wi);
        (pdf > 0.0).then_some(Drawn { wi, weight: value / pdf, pdf })
    }

    /// Snell's law in vectors; `None` under total reflection.
    fn refract(&self, wo: DVec3, h: DVec3) -> Option<DVec3> {
        refract(wo, h, self.index(wo) / self.index(-wo))
    }
}

/// The direction beyond a facet h (on w's side) by Snell's law, `ratio` the index on w's side over the
/// other; `None` under total reflection.
pub fn refract(w: DVec3, h: DVec3, ratio: f64) -> Option<DVec3> {
    let cos = w.dot(h);
    let sin2 = ratio * ratio * (1.0 - cos * cos);
    (cos > 0.0 && sin2 < 1.0).then(|| (ratio * cos - (1.0 - sin2).sqrt()) * h - ratio * w)
}

/// How a path continues from a surface.
#[derive(Clone, Copy, Debug)]
pub struct Meeting {
    pub dir: DVec3,
    /// Of radiance, and of photons, which have no eta^2.
    pub weight: f64,
    pub photon_weight: f64,
    /// Density of the direction; `None` of a smooth surface.
    pub pdf: Option<f64>,
    pub crosses: bool,
}

/// A path's meeting with a smooth or rough surface, `wo` back along the path; `None` where the surface
/// swallows it.
pub fn meet(boundary: Boundary, hit: &Hit, wo: DVec3, u: [f64; 3]) -> Option<Meeting> {
    let frame = Frame::about(hit.shading_normal);
    let local = frame.to_local(wo);
    let (wi, weight, pdf, eta) = match boundary {
        Boundary::Matched => (-local, 1.0, None, 1.0),
        Boundary::Rough { eta, facets } => {
            let surface = Surface { eta, facets, defect: Defect::None };
            let drawn = surface.sample(local, u)?;
            (drawn.wi, drawn.weight, Some(drawn.pdf), eta)
        }
        Boundary::Smooth { eta } => {
            let inside = local.z < 0.0;
            let far = if inside { 1.0 / eta } else { eta };
            let up = DVec3::Z * 1f64.copysign(local.z);
            if u[0] < fresnel(local.z.abs(), far).reflectance {
                (2.0 * local.dot(up) * up - local, 1.0, None, eta)
            } else {
                (refract(local, up, 1.0 / far)?, 1.0 / (far * far), None, eta)
            }
        }
    };
    let crosses = wi.z * local.z < 0.0;
    // The eta^2 of radiance: (n_o / n_i)^2.
    let radiance = match (crosses, local.z > 0.0) {
        (false, _) => 1.0,
        (true, true) => 1.0 / (eta * eta),
        (true, false) => eta * eta,
    };
    let dir = frame.to_world(wi);
    let agrees = |world: DVec3, local: DVec3| (world.dot(hit.normal) > 0.0) == (local.z > 0.0);
    let is_told = agrees(wo, local) && agrees(dir, wi);
    is_told.then_some(Meeting { dir, weight, photon_weight: weight / radiance, pdf, crosses })
}

/// f |cos| of light from outside and the density with which [`meet`] draws its direction, at a rough
/// surface.
pub fn meet_value(boundary: Boundary, hit: &Hit, wo: DVec3, to_light: DVec3) -> Option<(f64, f64)> {
    let Boundary::Rough { eta, facets } = boundary else { return None };
    let frame = Frame::about(hit.shading_normal);
    let (local, wi) = (frame.to_local(wo), frame.to_local(to_light));
    let is_outside = wi.z > 0.0 && to_light.dot(hit.normal) > 0.0;
    let agrees = (wo.dot(hit.normal) > 0.0) == (local.z > 0.0);
    let surface = Surface { eta, facets, defect: Defect::None };
    let (value, pdf) = if is_outside && agrees { surface.eval(local, wi) } else { (0.0, 0.0) };
    (value > 0.0).then_some((value, pdf))
}
