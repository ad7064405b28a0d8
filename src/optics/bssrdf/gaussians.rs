//! Sums of Gaussians: R(r) = sum_i w_i e^(-r^2/(2 v_i)) / (2 pi v_i), whose integral over the plane is
//! sum_i w_i.
//!
//! Reciprocal, never negative. They include the same light as the profile that they were fitted to.

use std::f64::consts::PI;

use crate::math::exp;

/// One Gaussian of the sum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Term {
    /// Its integral over the plane.
    pub weight: f64,
    /// v, its variance along each axis, mm^2.
    pub variance: f64,
}

/// A profile that is a sum of Gaussians.
#[derive(Clone, Debug, PartialEq)]
pub struct Gaussians {
    terms: Vec<Term>,
    /// (w / (2 pi v), 1 / (2 v)) of each term.
    factors: Vec<(f64, f64)>,
}

/// The profile of skin of d'Eon & Luebke 2007, "Advanced techniques for realistic real-time skin
/// rendering", GPU Gems 3, chapter 14: variance in mm^2, weights of red, green and blue, each column of
/// which sums to 1 (it has the colour of white; skin's own comes as a reflectance on top). A fit to a
/// multi-layer dipole of all light that emerges.
pub const SKIN: [(f64, [f64; 3]); 6] = [
    (0.0064, [0.233, 0.455, 0.649]),
    (0.0484, [0.100, 0.336, 0.344]),
    (0.187, [0.118, 0.198, 0.0]),
    (0.567, [0.113, 0.007, 0.007]),
    (1.99, [0.358, 0.004, 0.0]),
    (7.41, [0.078, 0.0, 0.0]),
];

impl Gaussians {
    /// Of terms with positive variances and weights that are not negative; those of weight 0 are left
    /// out.
    pub fn new(terms: impl IntoIterator<Item = Term>) -> Gaussians {
        let terms: Vec<Term> = terms.into_iter().filter(|term| term.weight > 0.0).collect();
        let factor = |term: &Term| (term.weight / (2.0 * PI * term.variance), 0.5 / term.variance);
        Gaussians { factors: terms.iter().map(factor).collect(), terms }
    }

    /// [`SKIN`] in one of its three bands (0 red, 1 green, 2 blue), times a reflectance.
    pub fn skin(band: usize, reflectance: f64) -> Gaussians {
        Gaussians::new(
            SKIN.iter()
                .map(|&(variance, weights)| Term { weight: reflectance * weights[band], variance }),
        )
    }

    /// Exitance R(r) per unit flux, 1/mm^2.
    #[inline]
    pub fn exitance(&self, r: f64) -> f64 {
        let square = r * r;
        self.factors.iter().map(|&(peak, rate)| peak * exp(-square * rate)).sum()
    }

    /// R over the plane.
    pub fn total(&self) -> f64 {
        self.terms.iter().map(|term| term.weight).sum()
    }

    /// The terms, none of weight 0.
    pub fn terms(&self) -> &[Term] {
        &self.terms
    }
}
