//! Exact single scattering on a half-space under a smooth boundary: what the classical dipole counts as
//! diffusion and the better dipole leaves out.
//!
//! Light from wi is refracted to the cosine mu_i', scatters once at depth z and leaves along wo' with
//! cosine mu_o':
//!   int_0^inf sigma_s p e^(-sigma_t z/mu_i') e^(-sigma_t z/mu_o') dz / (mu_i' mu_o')
//!     = alpha p / (mu_i' + mu_o').
//! Radiance scales by 1/eta^2 on leaving, and the irradiance that arrives, L mu_i dwi T12 outside, is
//! L eta^2 mu_i' dwi' T12 inside, so that per irradiance outside
//!   f1 = alpha T12 T21 p(wi'.wo') / (eta^2 (mu_i' + mu_o')).
//! Jensen et al. 2001, eq. 6, has the integral over wi without the factor 1/eta^2, which holds only
//! where dwi is the solid angle inside.

use crate::math::{DVec3, integrate};
use crate::optics::fresnel::fresnel;
use crate::optics::medium::Medium;

/// The BRDF of once-scattered light, 1/sr; `wi` and `wo` point away from the surface, whose normal is
/// +z. A boundary is matched where `eta` (inside over outside) is 1.
pub(crate) fn half_space_brdf(medium: &Medium, eta: f64, wi: DVec3, wo: DVec3) -> f64 {
    if wi.z <= 0.0 || wo.z <= 0.0 {
        return 0.0;
    }
    let [entering, leaving] = [fresnel(wi.z, eta), fresnel(wo.z, eta)];
    let inside = |w: DVec3, cos: f64| DVec3::new(w.x / eta, w.y / eta, cos);
    let cos = -inside(wi, entering.cos_t).dot(inside(wo, leaving.cos_t));
    let transmitted = (1.0 - entering.reflectance) * (1.0 - leaving.reflectance);
    if transmitted == 0.0 {
        return 0.0; // totally reflected outside, where the medium is the thinner side
    }
    let phase = medium.phase.pdf(cos);
    medium.albedo * transmitted * phase / (eta * eta * (entering.cos_t + leaving.cos_t))
}

/// The part of the power transmitted along the normal that emerges after one isotropic scattering, at
/// its first meeting with the boundary:
///   (alpha/2) int_0^1 mu/(1 + mu) (1 - F) dmu,
/// mu inside, from the critical cosine on; there F has the slope of a square root, which integrating
/// over the cosine c outside removes (mu dmu = c dc / eta^2).
pub(crate) fn albedo_normal(albedo: f64, eta: f64) -> f64 {
    let tolerance = 1e-14;
    let value = if eta < 1.0 {
        let emerges = |mu: f64| mu / (1.0 + mu) * (1.0 - fresnel(mu, 1.0 / eta).reflectance);
        integrate(emerges, 0.0, 1.0, tolerance).value
    } else {
        let emerges = |c: f64| {
            let surface = fresnel(c, eta);
            (1.0 - surface.reflectance) * c / ((1.0 + surface.cos_t) * eta * eta)
        };
        integrate(emerges, 0.0, 1.0, tolerance).value
    };
    0.5 * albedo * value
}
