//! Angular moments of the Fresnel reflectance: exact, and as the published polynomials.
//!
//! 2 C1(x) = 2 int_0^1 F mu dmu and 3 C2(x) = 3 int_0^1 F mu^2 dmu, with x = the index on the light's
//! own side over the index beyond: x > 1 is light in the dense side, total reflection included. A medium
//! of index `eta` inside over outside therefore has its inner moments at x = eta and its outer ones at x
//! = 1/eta. (Papers write the argument either way round; at eta = 1.3 the wrong one makes A 1.13 instead
//! of 2.60, which looks plausible.)

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::math::{fma, integrate};
use crate::optics::fresnel::fresnel;

/// Where the moments come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MomentKind {
    /// By quadrature of the Fresnel equations.
    #[default]
    Exact,
    /// By the polynomials that the model's source uses: Egan & Hilgeman for the classical dipole, d'Eon
    /// & Irving for the better and the directional ones.
    Polynomial,
}

impl std::fmt::Display for MomentKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            MomentKind::Exact => "exact moments",
            MomentKind::Polynomial => "polynomial moments",
        })
    }
}

/// 2 C1 and 3 C2 for light inside that meets the boundary; 2 C1 also from outside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FresnelMoments {
    /// 2 C1 from inside.
    pub c1: f64,
    /// 3 C2 from inside.
    pub c2: f64,
    /// 2 C1 from outside.
    pub c1_external: f64,
}

/// A boundary that reflects nothing. The polynomials miss it by up to 0.007, so that it is a case of its
/// own.
const MATCHED: FresnelMoments = FresnelMoments { c1: 0.0, c2: 0.0, c1_external: 0.0 };

impl FresnelMoments {
    /// By quadrature, for an index inside over outside.
    pub fn exact(eta: f64) -> FresnelMoments {
        if eta == 1.0 {
            return MATCHED;
        }
        FresnelMoments { c1: first(eta), c2: second(eta), c1_external: first(1.0 / eta) }
    }

    /// By the fits of Egan & Hilgeman 1979 that the classical dipole's source uses. They have no second
    /// moment, and the classical dipole needs none: here it is the exact one.
    pub fn egan_hilgeman(eta: f64) -> FresnelMoments {
        if eta == 1.0 {
            return MATCHED;
        }
        let c2 = second(eta);
        FresnelMoments { c1: egan_hilgeman_first(eta), c2, c1_external: egan_hilgeman_first(1.0 / eta) }
    }

    /// By the fits of d'Eon & Irving 2011.
    pub fn deon_irving(eta: f64) -> FresnelMoments {
        if eta == 1.0 {
            return MATCHED;
        }
        FresnelMoments {
            c1: deon_irving_first(eta),
            c2: deon_irving_second(eta),
            c1_external: deon_irving_first(1.0 / eta),
        }
    }

    /// C_phi = (1 - 2 C1) / 4: the exitance that a unit of fluence under the boundary makes.
    pub fn c_phi(&self) -> f64 {
        0.25 * (1.0 - self.c1)
    }

    /// C_E = (1 - 3 C2) / 2: the same for a unit of vector flux.
    pub fn c_e(&self) -> f64 {
        0.5 * (1.0 - self.c2)
    }

    /// 1 - 2 C1(1/eta) = 4 C_phi(1/eta): what the boundary leaves of a radiance that is the same in all
    /// directions outside, times T21, over the hemisphere.
    pub fn passed(&self) -> f64 {
        1.0 - self.c1_external
    }

    /// (1 + 2 C1) / (1 - 2 C1): A of Jensen, Marschner, Levoy & Hanrahan 2001.
    pub fn mismatch(&self) -> f64 {
        (1.0 + self.c1) / (1.0 - self.c1)
    }

    /// (1 + 3 C2) / (1 - 2 C1) = (1 - C_E) / (2 C_phi): A of d'Eon & Irving 2011.
    pub fn mismatch_of_flux(&self) -> f64 {
        (1.0 + self.c2) / (1.0 - self.c1)
    }
}

/// Twice the first Fresnel moment: 2 C1(x).
fn first(x: f64) -> f64 {
    moment(x, |mu| (2.0, 2.0 * mu))
}

/// Three times the second Fresnel moment: 3 C2(x).
fn second(x: f64) -> f64 {
    moment(x, |mu| (3.0 * mu, 3.0 * mu * mu))
}

/// int_0^1 F w(mu) mu dmu, where `weight` gives (w, w mu) and int_0^1 w mu dmu = 1.
///
/// Let n > 1 be the dense side's index over the thin side's, c the cosine in the thin side and mu the
/// one in the dense side. F is one function of both. In the thin side nothing is total and F is smooth
/// in c: integrate over c. In the dense side F = 1 below mu_c = sqrt(1 - 1/n^2), and above it F has the
/// slope of a square root in mu; but Snell's n^2 (1 - mu^2) = 1 - c^2 gives mu dmu = c dc / n^2, and in
/// c it is smooth again:
///   int F w mu dmu = int_0^mu_c w mu dmu + (1/n^2) int_0^1 F w(mu(c)) c dc.
/// With w = 2 the first part is 1 - 1/n^2: hence the identity 1 - 2 C1(n) = (1 - 2 C1(1/n)) / n^2.
fn moment(x: f64, weight: impl Fn(f64) -> (f64, f64)) -> f64 {
    const TOLERANCE: f64 = 1e-15;
    let n = x.max(1.0 / x);
    if x < 1.0 {
        return integrate(|c| fresnel(c, n).reflectance * weight(c).1, 0.0, 1.0, TOLERANCE).value;
    }
    let critical = (1.0 - 1.0 / (n * n)).sqrt();
    let total = integrate(|mu| weight(mu).1, 0.0, critical, TOLERANCE).value;
    let partial = |c| {
        let surface = fresnel(c, n);
        surface.reflectance * weight(surface.cos_t).0 * c / (n * n)
    };
    total + integrate(partial, 0.0, 1.0, TOLERANCE).value
}

/// c[0] + x (c[1] + x (c[2] + ...)).
fn polynomial(coefficients: &[f64], x: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, c| sum * x + c)
}

/// 2 C1(x), Egan & Hilgeman 1979 as in Donner's thesis (2006, chapter 5); error up to 1.2e-3 for 1.05 <=
/// eta <= 2.
pub(super) fn egan_hilgeman_first(x: f64) -> f64 {
    if x < 1.0 {
        polynomial(&[-0.4399, 0.7099, -0.3319, 0.0636], 1.0 / x)
    } else {
        polynomial(&[-1.4399, 0.7099, 0.6681, 0.0636], x) / (x * x)
    }
}

/// 2 C1(x), d'Eon & Irving 2011, "A quantized-diffusion model for rendering translucent materials",
/// appendix; error up to 1.6e-3 for 1.05 <= eta <= 2.
pub(super) fn deon_irving_first(x: f64) -> f64 {
    if x < 1.0 {
        polynomial(&[0.919317, -3.4793, 6.75335, -7.80989, 4.98554, -1.36881], x)
    } else {
        polynomial(&[-9.23372, 22.2272, -20.9292, 10.2291, -2.54396, 0.254913], x)
    }
}

/// 3 C2(x), from the same place; error up to 4.6e-3.
///
/// Above 1 it is 135.926/x^3 - 656.175/x^2 + 1376.53/x - 1641.1 + 1213.67 x - ... + 1.91826 x^5, whose
/// terms cancel from thousands down to 0.03: in f64 that leaves 12 decimals. The coefficients are whole
/// numbers of 1e-5 and the sum is a polynomial over x^3, so that Horner's scheme with its rounding
/// errors carried along has all digits.
pub(super) fn deon_irving_second(x: f64) -> f64 {
    if x < 1.0 {
        return polynomial(&[0.828421, -2.62051, 3.36231, -1.95284, 0.236494, 0.145787], x);
    }
    let hundred_thousandths = [
        13_592_600.0,
        -65_617_500.0,
        137_653_000.0,
        -164_110_000.0,
        121_367_000.0,
        -56_855_600.0,
        16_479_800.0,
        -2_701_810.0,
        191_826.0,
    ];
    compensated_polynomial(&hundred_thousandths, x) / (1e5 * x * x * x)
}

/// [`polynomial`] as if in twice the digits, rounded once (Graillat, Langlois & Louvet 2005): the errors
/// of every product and every sum, which f64 holds exactly, make a polynomial of their own.
fn compensated_polynomial(coefficients: &[f64], x: f64) -> f64 {
    let (mut sum, mut errors) = (0.0, 0.0);
    for &c in coefficients.iter().rev() {
        let product = sum * x;
        let of_product = fma(sum, x, -product);
        sum = product + c;
        let part = sum - product;
        let of_sum = (product - (sum - part)) + (c - part);
        errors = errors * x + (of_product + of_sum);
    }
    sum + errors
}
