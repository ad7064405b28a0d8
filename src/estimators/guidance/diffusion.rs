//! Diffusion behind a boundary, of the importance phi.
//!
//! In the P1 approximation a photon at the boundary whose direction has the cosine mu to the normal, outwards, has the
//! importance phi + 3 D mu phi', where phi' = dphi/dn and D = 1 / (3 sigma_t'). Outwards, it leaves with probability T(mu)
//! and finds s, or is reflected with probability R(mu). Both, weighted by mu and integrated (Marshak), are equal; with
//! reflected light that is diffuse, as in Jensen, Marschner, Levoy & Hanrahan 2001,
//!   phi / 2 + D phi' = T_1 s + 2 R_1 (phi / 2 - D phi'),   R_1 = int R mu dmu,   T_1 = int T mu dmu,
//! hence the boundary condition
//!   phi + 2 A D phi' = k s,   A = (1 + 2 R_1) / (1 - 2 R_1),   k = 2 T_1 / (1 - 2 R_1).
//! A smooth boundary keeps all light, T + R = 1, so that k = 1. A microfacet model without multiple scattering
//! loses some: GGX of roughness 0.2 and index 1.4 has k = 0.82, roughness 0.4 has 0.65.
//! Transport extrapolates a dark matched boundary to 0.7104 mean free paths (Milne's problem) where 2 D is 2/3 of one;
//! 2 A D is multiplied by their ratio.
//!
//! Light that is reflected back inside finds on average (cosine-weighted, mu' = 2/3) phi - 2 D phi', here in the form
//! phi / (1 + 2 D phi' / phi), which stays positive. Over this, light that leaves finds
//!   (s / phi) (1 + (k s / phi - 1) / A).

use crate::math::{DVec3, GOLDEN};
use crate::optics::boundary::{Boundary, Event, FEW_FACETS};
use crate::optics::bssrdf::FresnelMoments;
use crate::optics::guided::diffuse_growth;
use crate::optics::medium::Medium;
use crate::scene::Scene;

/// What diffusion says of a medium behind its boundary.
#[derive(Clone, Copy, Debug)]
pub(super) struct Diffusion {
    /// Growth, 1/mm: the asymptotic one of transport.
    pub kappa: f64,
    /// 2 A D, by Milne's problem, mm.
    pub reach: f64,
    /// A and k.
    pub boundary: BoundaryMoments,
}

/// A and k of the boundary condition.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BoundaryMoments {
    /// A.
    pub mismatch: f64,
    /// k.
    pub kept: f64,
}

/// Extrapolation length of Milne's problem over that of the P1 approximation, 2/3.
const MILNE: f64 = 1.5 * 0.710_446;

/// Cosines, and triples of facets for each, of the quadrature over a rough boundary.
const NODES: [u32; 2] = [32, 64];

impl BoundaryMoments {
    pub(super) fn of(boundary: &Boundary) -> BoundaryMoments {
        match boundary {
            Boundary::Matched => BoundaryMoments { mismatch: 1.0, kept: 1.0 },
            Boundary::Smooth { eta } => {
                BoundaryMoments { mismatch: FresnelMoments::exact(*eta).mismatch(), kept: 1.0 }
            }
            Boundary::Rough { .. } => BoundaryMoments::of_facets(boundary, NODES),
        }
    }

    pub(super) fn of_facets(boundary: &Boundary, [cosines, facets]: [u32; 2]) -> BoundaryMoments {
        // The weight of refraction has the squared index of radiance.
        let squared_index = boundary.eta() * boundary.eta();
        let (mut t_1, mut r_1) = (0.0, 0.0);
        let middle = |i: u32, count: u32| (f64::from(i) + 0.5) / f64::from(count);
        let each = 1.0 / (f64::from(cosines) * f64::from(facets));
        for (i, j) in (0..cosines).flat_map(|i| (0..facets).map(move |j| (i, j))) {
            let mu = middle(i, cosines);
            let inside = DVec3::new((1.0 - mu * mu).sqrt(), 0.0, -mu);
            let facet = [0.5, middle(j, facets), (f64::from(j) * GOLDEN).fract()];
            for sample in boundary.sample_both(inside, facet, FEW_FACETS).into_iter().flatten() {
                let part = sample.weight * mu * each;
                match sample.event {
                    Event::Refract => t_1 += part / squared_index,
                    Event::Reflect => r_1 += part,
                }
            }
        }
        let returned = 2.0 * r_1;
        BoundaryMoments {
            mismatch: (1.0 + returned) / (1.0 - returned),
            kept: 2.0 * t_1 / (1.0 - returned),
        }
    }

    /// What light that leaves finds over what reflected light finds, where s / phi is `found`; at least 1.
    #[inline]
    pub(super) fn gain_of_leaving(&self, found: f64) -> f64 {
        found * (1.0 + (self.kept * found - 1.0).max(0.0) / self.mismatch)
    }
}

impl Diffusion {
    pub(super) fn of(scene: &Scene, band: usize) -> Diffusion {
        let Medium { sigma_t, albedo, phase, .. } = scene.medium[band];
        let boundary = BoundaryMoments::of(&scene.boundary[band]);
        let diffusion = 1.0 / (3.0 * sigma_t * (1.0 - albedo * phase.g));
        Diffusion {
            kappa: diffuse_growth(albedo, phase.g) * sigma_t,
            reach: 2.0 * boundary.mismatch * diffusion * MILNE,
            boundary,
        }
    }
}

/// The growth per mean free path with which an exponential has the same mean flight as phi itself, from its gradient,
/// |grad phi| / (sigma_t phi), which is returned where it is no larger than the asymptotic growth.
///
/// At a boundary that no light enters, with the light far behind, phi rises by much of itself within a mean free
/// path, but linearly: an exponential of the same gradient would send flights much too far. In a plane layer, in mean free
/// paths, phi(t) / phi(0) = cosh(c t) + (s / c) sinh(c t) with the asymptotic growth c and the gradient s. Flights of density
/// phi(t) e^{-t} along it have the mean (1 + c^2 + 2 s) / ((1 - c^2) (1 + s)), those of an exponential 1 / (1 - p), hence
///   p = (s + c^2 (2 + s)) / (1 + c^2 + 2 s),
/// which is c for s = c, and s / (1 + 2 s) without absorption.
#[inline]
pub(super) fn growth_of_flights(asymptotic: f64, gradient: f64) -> f64 {
    if gradient <= asymptotic {
        return gradient;
    }
    let squared = asymptotic * asymptotic;
    (gradient + squared * (2.0 + gradient)) / (1.0 + squared + 2.0 * gradient)
}
