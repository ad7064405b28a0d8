//! Fits by Gaussians.

use super::super::{Better, Classical, FresnelMoments, GaussianFit, Gaussians, Reduced, Term, fit};
use crate::optics::materials::MATERIALS;

/// More Gaussians fit better, the integral is kept, and six are as close as the module states.
#[test]
fn fits_of_dipoles() {
    for material in &MATERIALS {
        for band in 0..3 {
            let reduced = Reduced::new(material.sigma_a[band], material.reduced_sigma_s[band]);
            let moments = FresnelMoments::exact(material.eta);
            let classical = Classical::new(&reduced, &moments);
            let better = Better::new(&reduced, &moments);
            let length = 1.0 / reduced.sigma_t;
            let of = |terms| {
                [
                    (
                        fit(|r| classical.exitance(r), classical.total(), length, terms),
                        classical.total(),
                    ),
                    (fit(|r| better.exitance(r), better.total(), length, terms), better.total()),
                ]
            };
            let (few, many) = (of(2), of(6));
            for ((few, _), (many, total)) in few.iter().zip(&many) {
                assert!((many.gaussians.total() / total - 1.0).abs() < 1e-13);
                assert!(many.error.l2 < few.error.l2, "{} {band}", material.name);
                let stated = if material.sigma_a[band] > 0.0 { 0.021 } else { 0.025 };
                assert!(many.error.l2 < stated, "{} {band}: {:?}", material.name, many.error);
            }
        }
    }
}

fn literal_error(fit: &GaussianFit, exitance: impl Fn(f64) -> f64, far: f64) -> (f64, f64) {
    let (mut most, mut peak, mut off, mut all) = (0.0f64, 0.0f64, 0.0, 0.0);
    let n = 200_000;
    for i in 0..n {
        let r = far * (f64::from(i) + 0.5) / f64::from(n);
        let [value, fitted] = [exitance(r), fit.gaussians.exitance(r)].map(|f| r * f);
        most = most.max((value - fitted).abs());
        peak = peak.max(value);
        off += (value - fitted) * (value - fitted);
        all += value * value;
    }
    (most / peak, (off / all).sqrt())
}

/// The errors are those of a finer, even quadrature, and small.
#[test]
fn stated_errors_are_the_errors() {
    let reduced = Reduced::new(0.032, 0.74);
    let classical = Classical::new(&reduced, &FresnelMoments::exact(1.3));
    let fitted = fit(|r| classical.exitance(r), classical.total(), 1.0 / reduced.sigma_t, 4);
    let (max, l2) = literal_error(&fitted, |r| classical.exitance(r), 150.0);
    assert!((fitted.error.max / max - 1.0).abs() < 0.02, "{:?} {max}", fitted.error);
    assert!((fitted.error.l2 / l2 - 1.0).abs() < 0.02, "{:?} {l2}", fitted.error);
}

/// Sums of Gaussians of a geometric sequence come back.
#[test]
fn sums_of_gaussians_are_found() {
    let terms = [(0.2, 0.3), (0.5, 0.3 * 9.0), (0.1, 0.3 * 81.0)];
    let sum = Gaussians::new(terms.map(|(weight, variance)| Term { weight, variance }));
    let found = fit(|r| sum.exitance(r), sum.total(), 1.0, 3);
    assert!(found.error.l2 < 0.02, "{:?}", found.error);
    for (term, (weight, variance)) in found.gaussians.terms().iter().zip(terms) {
        assert!((term.weight - weight).abs() < 0.02 && (term.variance / variance - 1.0).abs() < 0.1);
    }
    let again = fit(|r| sum.exitance(r), sum.total(), 1.0, 3);
    assert_eq!(found, again);
}
