//! Chandrasekhar's exact solution for the half-space without a boundary and with isotropic scattering
//! (Radiative Transfer, 1950): the H function and what follows from it.
//!
//! H solves 1/H(mu) = sqrt(1 - w) + (w/2) int_0^1 x H(x) / (mu + x) dx for albedo w. Its logarithm is
//!   ln H(mu) = -(mu/pi) int_0^{pi/2} ln(1 - w t cot t) / (cos^2 t + mu^2 sin^2 t) dt,
//! an ordinary integral for w < 1.

use std::f64::consts::{FRAC_PI_2, PI};

use crate::math::{Integral, cos, exp, integrate, ln_1p, sin};

/// H at albedo `w` in [0, 1) and cosine `mu` in (0, 1], with its error.
pub(crate) fn h(w: f64, mu: f64) -> Integral {
    let integrand = |t: f64| {
        let (sin, cos) = (sin(t), cos(t));
        // t cot t is 1 - t^2/3 near 0, and 0 at pi/2.
        let t_cot_t = if t < 1e-4 { 1.0 - t * t / 3.0 } else { t * cos / sin };
        ln_1p(-w * t_cot_t) / (cos * cos + mu * mu * sin * sin)
    };
    // For small mu the integrand peaks within mu of pi/2.
    let knee = FRAC_PI_2 - 4.0 * mu.min(0.3);
    let parts = [integrate(integrand, 0.0, knee, 1e-13), integrate(integrand, knee, FRAC_PI_2, 1e-13)];
    let [value, error] = [|i: &Integral| i.value, |i: &Integral| i.error]
        .map(|pick: fn(&Integral) -> f64| parts.iter().map(pick).sum::<f64>());
    let h = exp(-mu / PI * value);
    Integral { value: h, error: h * mu / PI * error + 1e-15 * h }
}

/// Bidirectional reflectance f_r (1/sr) between the cosines `mu0` of incidence and `mu` of exit:
/// w / (4 pi (mu + mu0)) H(mu) H(mu0), with its error.
pub(crate) fn brdf(w: f64, mu0: f64, mu: f64) -> Integral {
    let (a, b) = (h(w, mu0), h(w, mu));
    let factor = w / (4.0 * PI * (mu + mu0));
    Integral {
        value: factor * a.value * b.value,
        error: factor * (a.error * b.value + a.value * b.error),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The integral equation that defines H, closed by another quadrature.
    #[test]
    fn h_solves_its_equation() {
        for w in [0.1, 0.5, 0.9, 0.99] {
            for mu in [0.05, 0.3, 1.0] {
                let x_h = |x: f64| if x == 0.0 { 0.0 } else { x * h(w, x).value / (mu + x) };
                let right = (1.0 - w).sqrt() + 0.5 * w * integrate(x_h, 0.0, 1.0, 1e-10).value;
                assert!((right * h(w, mu).value - 1.0).abs() < 1e-9, "w {w} mu {mu}");
            }
        }
    }

    /// Values of an independent computation at 20 digits (mpmath, the same integral).
    #[test]
    fn known_values() {
        let known = [
            (0.1, 0.05, 1.007_808_971_226),
            (0.5, 1.0, 1.251_259_563_383),
            (0.9, 0.05, 1.099_678_288_027),
        ];
        for (w, mu, expected) in known {
            let got = h(w, mu);
            assert!((got.value - expected).abs() < 2e-12 && got.error < 1e-11, "{got:?} {expected}");
        }
    }

    /// The table that the verification experiment compares with is this solution.
    #[test]
    fn the_table_of_the_experiment_is_this_solution() {
        let table = include_str!("../../experiments/verify/chandrasekhar_brdf.csv");
        let rows: Vec<Vec<f64>> = table
            .lines()
            .filter(|line| !line.starts_with('#'))
            .skip(1)
            .map(|line| line.split(',').map(|x| x.parse().expect("a number")).collect())
            .collect();
        assert_eq!(rows.len(), 77);
        for row in rows {
            let [w, mu0, mu, _, f_r, ..] = row[..] else { panic!("{row:?}") };
            let radiance = row[8];
            assert!((brdf(w, mu0, mu).value / f_r - 1.0).abs() < 1e-11, "{row:?}");
            assert!((f_r * mu0 / radiance - 1.0).abs() < 1e-11, "{row:?}");
            // Single scattering: w / (4 pi (mu + mu0)).
            assert!((w / (4.0 * PI * (mu + mu0)) * mu0 / row[9] - 1.0).abs() < 1e-11, "{row:?}");
        }
    }
}
