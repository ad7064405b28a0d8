//! Points of a plane about the origin, by the radial profiles of subsurface scattering: each density is
//! the profile divided by its integral over the plane, so that the weight of a sample is that integral.

use std::f64::consts::PI;

use super::discrete::choose;
use super::distance::{pdf_distance_truncated_exponential, sample_truncated_exponential};
use crate::math::{exp, lambert_excess, ln_1p, sin_cos_turns};

/// A rotationally symmetric density over the plane. Lengths in mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Radial {
    /// The radius is exponential: sigma e^(-sigma r) / (2 pi r) per area.
    Exponential {
        /// Rate sigma, 1/mm; positive.
        sigma: f64,
    },
    /// e^(-r^2 / 2v) inside the disc of radius `r_max`, 0 outside it.
    Gaussian {
        /// v, the variance along each axis, mm^2, positive.
        variance: f64,
        /// Radius of the disc, may be infinite.
        r_max: f64,
    },
    /// Normalized diffusion (Christensen & Burley 2015): (e^(-r/d) + e^(-r/(3d))) / (8 pi d r), in
    /// radius one part of Exp(d) and three parts of Exp(3d).
    NormalizedDiffusion {
        /// Parameter d, mm; positive.
        d: f64,
    },
    /// The dipole of Jensen et al. 2001; see [`Dipole`].
    Dipole(Dipole),
}

/// The profile of the classical dipole over its integral.
///
/// Each source at depth z sends z (1 + s r') e^(-s r') / (4 pi r'^3), r'^2 = r^2 + z^2, through the
/// surface; over the plane that is e^(-s z) / 2, and inside radius r the part
///   F(r) = 1 - (z / r') e^(-s (r' - z)).
/// So a source is chosen in proportion to e^(-s z), and 1 - F = u' in (0, 1] is solved for x = (r' -
/// z)/z:
///   s z x + ln(1 + x) = -ln u'
/// (r' = W(s z e^(s z) / u') / s with Lambert's W), from which r = z sqrt(x (2 + x)) without a
/// difference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dipole {
    /// s: effective transport coefficient sqrt(3 sigma_a sigma_t'), 1/mm, not negative.
    pub sigma_tr: f64,
    /// Depth of the real source, positive.
    pub z_real: f64,
    /// Height of the virtual source over the surface, at least `z_real`.
    pub z_virtual: f64,
}

impl Radial {
    /// The radius that `u` selects.
    #[inline]
    pub fn sample_radius(&self, u: f64) -> f64 {
        match *self {
            Radial::Exponential { sigma } => -ln_1p(-u) / sigma,
            Radial::Gaussian { variance, r_max } => {
                // r^2 / 2 is a truncated exponential.
                (2.0 * sample_truncated_exponential(1.0 / variance, 0.5 * r_max * r_max, u)).sqrt()
            }
            Radial::NormalizedDiffusion { d } => {
                let (is_narrow, u) = choose(u, 0.25);
                -ln_1p(-u) * if is_narrow { d } else { 3.0 * d }
            }
            Radial::Dipole(ref dipole) => dipole.sample_radius(u),
        }
    }

    /// A point of the plane: `u[0]` its radius, `u[1]` its azimuth.
    #[inline]
    pub fn sample(&self, u: [f64; 2]) -> [f64; 2] {
        let (sin, cos) = sin_cos_turns(u[1]);
        let r = self.sample_radius(u[0]);
        [r * cos, r * sin]
    }

    /// Density of [`Self::sample`] per mm^2 at radius `r`; the first and the third are infinite at 0.
    #[inline]
    pub fn pdf_area(&self, r: f64) -> f64 {
        match *self {
            Radial::Exponential { sigma } => sigma * exp(-sigma * r) / (2.0 * PI * r),
            Radial::Gaussian { variance, r_max } => {
                let [half_square, half_max] = [r, r_max].map(|r| 0.5 * r * r);
                pdf_distance_truncated_exponential(1.0 / variance, half_max, half_square) / (2.0 * PI)
            }
            Radial::NormalizedDiffusion { d } => {
                (exp(-r / d) + exp(-r / (3.0 * d))) / (8.0 * PI * d * r)
            }
            Radial::Dipole(ref dipole) => dipole.pdf_area(r),
        }
    }
}

impl Dipole {
    /// The probability of the real source: 1 / (1 + e^(-s (z_v - z_r))).
    #[inline]
    fn share_real(&self) -> f64 {
        1.0 / (1.0 + exp(-self.sigma_tr * (self.z_virtual - self.z_real)))
    }

    fn sample_radius(&self, u: f64) -> f64 {
        let (is_real, u) = choose(u, self.share_real());
        let z = if is_real { self.z_real } else { self.z_virtual };
        let x = lambert_excess(self.sigma_tr * z, -ln_1p(-u));
        z * (x * (2.0 + x)).sqrt()
    }

    /// Its density per mm^2 at radius `r`.
    pub fn pdf_area(&self, r: f64) -> f64 {
        let share = self.share_real();
        share * self.source(self.z_real, r) + (1.0 - share) * self.source(self.z_virtual, r)
    }

    /// F'(r) / (2 pi r) of one source: z (1 + s r') e^(-s (r' - z)) / (2 pi r'^3).
    fn source(&self, z: f64, r: f64) -> f64 {
        let slant = (r * r + z * z).sqrt();
        let excess = r * r / (slant + z);
        z * (1.0 + self.sigma_tr * slant) * exp(-self.sigma_tr * excess)
            / (2.0 * PI * slant * slant * slant)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::integrate;

    fn all() -> [Radial; 9] {
        let dipole =
            |sigma_tr, z_real, z_virtual| Radial::Dipole(Dipole { sigma_tr, z_real, z_virtual });
        [
            Radial::Exponential { sigma: 0.3 },
            Radial::Gaussian { variance: 0.187, r_max: f64::INFINITY },
            Radial::Gaussian { variance: 0.187, r_max: 0.5 },
            Radial::Gaussian { variance: 4.0, r_max: 1e-4 },
            Radial::NormalizedDiffusion { d: 0.7 },
            dipole(0.0, 1.0, 4.5),
            dipole(0.5, 1.3, 6.0),
            dipole(1e-6, 1.0, 3.0),
            dipole(40.0, 1.0, 1.5),
        ]
    }

    /// Distribution function of the radius, as published or integrated by hand.
    fn distribution(radial: &Radial, r: f64) -> f64 {
        match *radial {
            Radial::Exponential { sigma } => 1.0 - exp(-sigma * r),
            Radial::Gaussian { variance, r_max } => {
                crate::math::exp_m1(-r * r / (2.0 * variance))
                    / crate::math::exp_m1(-r_max * r_max / (2.0 * variance))
            }
            Radial::NormalizedDiffusion { d } => 1.0 - 0.25 * exp(-r / d) - 0.75 * exp(-r / (3.0 * d)),
            Radial::Dipole(Dipole { sigma_tr: s, z_real, z_virtual }) => {
                let [real, both] = [z_real, z_virtual].map(|z| {
                    let slant = r.hypot(z);
                    let share = exp(-s * (z - z_real));
                    (share * (1.0 - z / slant * exp(-s * (slant - z))), share)
                });
                (real.0 + both.0) / (real.1 + both.1)
            }
        }
    }

    /// 4096 numbers and both ends.
    fn grid() -> impl Iterator<Item = f64> {
        let end = 1.0 / f64::from(1 << 24);
        (0..4096).map(|i| (f64::from(i) + 0.5) / 4096.0).chain([end, 1.0 - end])
    }

    /// D1 where one number maps to the radius by one branch: F(r(u)) = u.
    #[test]
    fn inverse_distribution_functions() {
        for radial in all() {
            let is_mixture = matches!(radial, Radial::NormalizedDiffusion { .. } | Radial::Dipole(_));
            if is_mixture {
                continue; // `mixtures_by_enumeration`
            }
            for u in grid() {
                let back = distribution(&radial, radial.sample_radius(u));
                assert!((back - u).abs() < 1e-12, "{radial:?} {u}: {back}");
            }
        }
    }

    /// D1 and D3 for the mixtures: both branches are monotone, so that of n numbers F(r) n fall below r.
    #[test]
    fn mixtures_by_enumeration() {
        let n = 1u32 << 16;
        for radial in all() {
            let radii: Vec<f64> =
                (0..n).map(|k| radial.sample_radius((f64::from(k) + 0.5) / f64::from(n))).collect();
            for scale in [0.01, 0.1, 0.5, 1.0, 2.0, 10.0] {
                let below = radii.iter().filter(|&&r| r < scale).count() as f64;
                let expected = distribution(&radial, scale).min(1.0);
                assert!(
                    (below / f64::from(n) - expected).abs() <= 2.0 / f64::from(n),
                    "{radial:?} {scale}"
                );
            }
        }
    }

    /// D1 for the branches of the dipole, one source at a time.
    #[test]
    fn dipole_branches() {
        for s in [0.0, 1e-9, 0.5, 40.0] {
            // A virtual source so far off that its share is nothing, or the same source twice.
            let dipole = Dipole { sigma_tr: s, z_real: 1.3, z_virtual: 1.3 };
            for u in grid() {
                let r = Radial::Dipole(dipole).sample_radius(0.5 * u);
                let back = distribution(&Radial::Dipole(dipole), r);
                assert!((back - u).abs() < 1e-12, "{s} {u}: {back}");
            }
        }
    }

    /// D7 and D2: the density over every disc is the distribution function.
    #[test]
    fn densities_integrate_to_the_distribution() {
        for radial in all() {
            for r in [0.05f64, 0.4, 3.0] {
                let r_max =
                    if let Radial::Gaussian { r_max, .. } = radial { r_max } else { f64::INFINITY };
                let r = r.min(r_max);
                let mass = integrate(|x| 2.0 * PI * x * radial.pdf_area(x), 0.0, r, 1e-12);
                let expected = distribution(&radial, r);
                assert!((mass.value - expected).abs() < 1e-10, "{radial:?} {r}: {mass:?} {expected}");
            }
        }
    }

    /// Radii at which the profiles of published materials (Jensen et al. 2001, their Fdr fit) have the
    /// quantiles 0.1, 0.5, 0.9, 0.99: solved to 12 digits with mpmath from the distribution function.
    #[test]
    fn dipole_quantiles_of_materials() {
        for (sigma_tr, z_real, z_virtual, quantiles) in QUANTILES {
            let radial = Radial::Dipole(Dipole { sigma_tr, z_real, z_virtual });
            for (q, r) in [0.1, 0.5, 0.9, 0.99].into_iter().zip(quantiles) {
                let mass = integrate(|x| 2.0 * PI * x * radial.pdf_area(x), 0.0, r, 1e-12);
                assert!((mass.value - q).abs() < 1e-9, "{radial:?} {q}: {}", mass.value);
            }
        }
    }

    const QUANTILES: [(f64, f64, f64, [f64; 4]); 3] = [
        // skin1 red
        (
            0.2722351924347769,
            1.2953367875647668,
            5.7894030878412135,
            [0.6018855289325619, 2.041049890441845, 6.61061620367095, 13.670563628950381],
        ),
        // marble green
        (
            0.17965642209506455,
            0.3810830379939789,
            1.7032198406361865,
            [0.24389628805035543, 1.1300166702241228, 4.803842822769625, 12.618900651480573],
        ),
        // ketchup blue
        (
            2.5373214222876848,
            0.6756756756756757,
            3.019877826900957,
            [0.19098318979085085, 0.5259959045579996, 1.1374769404075413, 1.9555311215843685],
        ),
    ];

    /// The point has the radius drawn, at the azimuth drawn; two numbers a sample.
    #[test]
    fn points_have_their_radius() {
        for radial in all() {
            let [x, y] = radial.sample([0.37, 0.125]);
            assert!((x / y - 1.0).abs() < 1e-15);
            assert!((x.hypot(y) / radial.sample_radius(0.37) - 1.0).abs() < 1e-15);
        }
    }
}
