//! What holds for every model: scaling, limits, the far field, reciprocity, sampling, the way out,
//! refusals.

use std::f64::consts::PI;

use super::super::{Bssrdf, Entry, Exit, FittedDipole, Model, MomentKind, Outgoing, Scaling};
use crate::math::{DVec3, integrate};
use crate::optics::fresnel::fresnel;
use crate::optics::medium::Medium;
use crate::sampling::radial::Radial;

const EXACT: MomentKind = MomentKind::Exact;
const PLAIN: Model = Model::Classical { moments: EXACT, outgoing: Outgoing::Plain };
const CLASSICAL: Model = Model::Classical { moments: EXACT, outgoing: Outgoing::Normalized };
const BETTER: Model = Model::Better { moments: EXACT };
const DIRECTIONAL: Model = Model::Directional { moments: EXACT };
const SEARCHLIGHT: Model = Model::Normalized { scaling: Scaling::Searchlight, albedo: None };
const DIFFUSE: Model = Model::Normalized { scaling: Scaling::Diffuse, albedo: None };
const DMFP: Model = Model::Normalized { scaling: Scaling::DiffuseMeanFreePath, albedo: None };
const SKIN: Model = Model::Skin { reflectance: [0.44, 0.22, 0.13] };
const FITTED: Model = Model::Gaussians { dipole: FittedDipole::Better, moments: EXACT, terms: 6 };

fn all() -> [Model; 9] {
    [PLAIN, CLASSICAL, BETTER, DIRECTIONAL, SEARCHLIGHT, DIFFUSE, DMFP, SKIN, FITTED]
}

/// Media from much absorption to little, forward scattering too.
fn media() -> [Medium; 4] {
    [
        Medium::new(0.032, 0.74, 0.0),
        Medium::new(0.97, 0.07, 0.0),
        Medium::new(0.0021, 21.9, 0.9),
        Medium::new(0.5, 1.0, -0.3),
    ]
}

fn of(model: &Model, medium: &Medium, eta: f64) -> Bssrdf {
    model.of(1, 3, medium, eta).unwrap()
}

/// On the plane, along the normal.
fn at(model: &Bssrdf, r: f64) -> f64 {
    let entry = Entry { point: DVec3::ZERO, normal: DVec3::Z, dir: -DVec3::Z };
    model.kernel(&entry, &Exit { point: DVec3::new(0.6 * r, 0.8 * r, 0.0), normal: DVec3::Z })
}

/// An uneven pair of ends.
fn ends(scale: f64) -> (Entry, Exit) {
    let entry = Entry {
        point: scale * DVec3::new(0.3, 0.1, -0.2),
        normal: DVec3::new(0.0, 0.6, 0.8),
        dir: DVec3::new(0.48, -0.36, -0.8),
    };
    let normal = DVec3::new(0.64, -0.48, 0.6);
    (entry, Exit { point: scale * DVec3::new(1.1, -0.4, 0.5), normal })
}

/// K(r; k sigma) = k^2 K(k r; sigma). A fit solves equations that amplify rounding errors, most where it
/// is small.
#[test]
fn lengths_scale() {
    let k = 3.7;
    for medium in media() {
        let dense = Medium { sigma_t: k * medium.sigma_t, ..medium };
        for model in all().iter().filter(|model| **model != SKIN) {
            let [thin, thick] = [medium, dense].map(|medium| of(model, &medium, 1.3));
            let tolerance = if *model == FITTED { 1e-7 } else { 1e-11 };
            for r in [0.01, 0.3, 2.0] {
                let ratio = at(&thick, r) / (k * k * at(&thin, k * r));
                assert!((ratio - 1.0).abs() < tolerance, "{model:?} {medium:?} {r}: {ratio}");
                let ratio = thick.falloff(r) / (k * k * thin.falloff(k * r));
                assert!((ratio - 1.0).abs() < tolerance, "{model:?} {medium:?} {r}: {ratio}");
            }
            let [(entry, exit), (far_entry, far_exit)] = [ends(1.0), ends(k)];
            let (got, expected) =
                (thick.kernel(&entry, &exit), k * k * thin.kernel(&far_entry, &far_exit));
            assert!(
                (got - expected).abs() <= tolerance * expected,
                "{model:?} {medium:?}: {got} {expected}"
            );
            assert!((thick.sigma_tr / (k * thin.sigma_tr) - 1.0).abs() < 1e-14);
            assert!((thick.straight_sigma_t / (k * thin.straight_sigma_t) - 1.0).abs() < 1e-14);
        }
    }
}

/// From both sides, eta -> 1 leads to the matched boundary; the polynomials would miss it by their own
/// error.
#[test]
fn boundaries_become_matched() {
    for medium in media() {
        for model in all() {
            let [below, matched, above] =
                [1.0 - 1e-7, 1.0, 1.0 + 1e-7].map(|eta| of(&model, &medium, eta));
            for r in [0.1, 1.0, 5.0] {
                for near in [&below, &above] {
                    let ratio = at(near, r) / at(&matched, r);
                    assert!((ratio - 1.0).abs() < 1e-4, "{model:?} {medium:?} {r}: {ratio}");
                }
            }
        }
    }
    let polynomial = Model::Better { moments: MomentKind::Polynomial };
    assert_eq!(at(&of(&polynomial, &media()[0], 1.0), 1.0), at(&of(&BETTER, &media()[0], 1.0), 1.0));
}

/// d ln(R r^2)/dr -> -s for the dipoles. The next terms are 1/(s r)^2 of it, from (1 + s r)/r^3, and at
/// most (z/r)^2 (1/2 + 3/(s r)), from d = r + z^2/(2r) - ...
#[test]
fn far_fields_fall_with_sigma_tr() {
    for medium in media() {
        for model in [PLAIN, CLASSICAL, BETTER] {
            let model = of(&model, &medium, 1.3);
            let s = model.sigma_tr;
            let (r, h) = (300.0 / s, 0.01 / s);
            let log = |r: f64| (model.falloff(r) * r * r).ln();
            let slope = (log(r + h) - log(r - h)) / (2.0 * h);
            let Radial::Dipole(sources) = model.techniques()[0].1 else { panic!("not a dipole's") };
            let z = sources.z_virtual;
            let bound = 1.1 / (s * s * r * r) + 0.6 * z * z / (r * r);
            assert!((slope / s + 1.0).abs() < bound, "{model:?}: {slope} {s}");
        }
    }
    // The better dipole's s is its own: with Grosjean's D.
    let medium = media()[0];
    let d = (2.0 * 0.032 + 0.74) / (3.0 * 0.772 * 0.772);
    assert!((of(&BETTER, &medium, 1.3).sigma_tr / (0.032f64 / d).sqrt() - 1.0).abs() < 1e-14);
    for model in [PLAIN, DIRECTIONAL, SEARCHLIGHT, SKIN] {
        let s = (3.0f64 * 0.032 * 0.772).sqrt();
        assert!((of(&model, &medium, 1.3).sigma_tr / s - 1.0).abs() < 1e-14);
    }
}

/// Ends exchanged: all except the directional dipole are functions of distance.
#[test]
fn reciprocity() {
    let (entry, exit) = ends(1.0);
    let back = Entry { point: exit.point, normal: exit.normal, dir: DVec3::new(-0.8, 0.6, 0.0) };
    for model in all() {
        let bssrdf = of(&model, &media()[0], 1.3);
        let there = bssrdf.kernel(&entry, &exit);
        let again = bssrdf.kernel(&back, &Exit { point: entry.point, normal: entry.normal });
        assert!(there > 0.0 && again > 0.0);
        assert_eq!(there == again, model != DIRECTIONAL, "{model:?}");
    }
}

/// Kernels of many distances have the bits of those of one, also where the exponentials underflow.
#[test]
fn kernels_together_as_one_by_one() {
    for medium in media() {
        for model in all().iter().filter(|model| **model != DIRECTIONAL) {
            let bssrdf = of(model, &medium, 1.3);
            for reach in [1.0, 100.0, 2000.0].map(|reach| reach / bssrdf.sigma_tr) {
                // Along an axis, where the distance is that number.
                let distances: Vec<f64> = (1..=67).map(|k| reach * f64::from(k) / 67.0).collect();
                let mut together = vec![0.0; distances.len()];
                bssrdf.kernels(&distances, &mut together);
                let entry = Entry { point: DVec3::ZERO, normal: DVec3::Z, dir: -DVec3::Z };
                for (kernel, &r) in together.iter().zip(&distances) {
                    let exit = Exit { point: DVec3::new(r, 0.0, 0.0), normal: DVec3::Z };
                    let one = bssrdf.kernel(&entry, &exit);
                    assert_eq!(kernel.to_bits(), one.to_bits(), "{model:?} at {r}");
                }
            }
        }
    }
}

/// The hemispherical exitance under T21: R for the normalised, less by 2 C1(1/eta) for the plain
/// classical dipole.
#[test]
fn the_way_out() {
    for eta in [0.8, 1.0, 1.3, 1.5] {
        let passes = |mu: f64| 2.0 * PI * mu * (1.0 - fresnel(mu, eta).reflectance);
        let critical = (1.0 - eta * eta).max(0.0).sqrt();
        let passed = integrate(passes, critical, 1.0, 1e-12).value;
        for medium in media() {
            for model in all().iter().filter(|model| **model != DIRECTIONAL) {
                let bssrdf = of(model, &medium, eta);
                let exitance = at(&bssrdf, 0.7) * passed;
                let lost = if *model == PLAIN { passed / PI } else { 1.0 };
                let ratio = exitance / (bssrdf.falloff(0.7) * lost);
                assert!((ratio - 1.0).abs() < 1e-9, "{model:?} {eta}: {ratio}");
            }
        }
    }
}

/// Kernel over density, on a plane: constant where the techniques follow the kernel exactly, within a
/// hundredth for the better dipole's.
#[test]
fn techniques_follow_the_kernel() {
    for (medium, eta) in
        media().into_iter().flat_map(|medium| [0.8, 1.0, 1.3, 1.5].map(|eta| (medium, eta)))
    {
        for model in all().iter().filter(|model| **model != DIRECTIONAL) {
            let bssrdf = of(model, &medium, eta);
            let techniques = bssrdf.techniques();
            assert!((techniques.iter().map(|t| t.0).sum::<f64>() - 1.0).abs() < 1e-14);
            let reach = 10.0 / bssrdf.sigma_tr.min(1.0);
            let pdf = |r: f64| {
                techniques.iter().map(|(share, radial)| share * radial.pdf_area(r)).sum::<f64>()
            };
            let radii = (1..200).map(|i| reach * f64::from(i) * f64::from(i) / 4e4);
            // Numbers near the least of f64 have no digits left.
            let radii: Vec<f64> = radii.filter(|&r| pdf(r) > 1e-290).collect();
            assert!(radii.len() > 20, "{model:?} {medium:?}");
            let ratios: Vec<f64> = radii.iter().map(|&r| bssrdf.falloff(r) / pdf(r)).collect();
            let least = ratios.iter().copied().fold(f64::INFINITY, f64::min);
            let most = ratios.iter().copied().fold(0.0, f64::max);
            let bound = if *model == BETTER { 1.01 } else { 1.0 + 1e-9 };
            assert!(most / least < bound, "{model:?} {medium:?} {eta}: {least} {most}");
        }
    }
}

/// Falls nowhere; and the directional dipole's is the classical profile.
#[test]
fn falloffs_do_not_increase() {
    for medium in media() {
        for model in all() {
            let bssrdf = of(&model, &medium, 1.3);
            let values: Vec<f64> = (1..2000).map(|i| bssrdf.falloff(0.01 * f64::from(i))).collect();
            assert!(values.windows(2).all(|pair| pair[1] <= pair[0]), "{model:?} {medium:?}");
            assert!(values[0] > 0.0 && bssrdf.falloff(0.0) >= values[0]);
        }
        for r in [0.0, 0.5, 3.0] {
            let [directional, classical] =
                [DIRECTIONAL, PLAIN].map(|model| of(&model, &medium, 1.3).falloff(r));
            assert_eq!(directional, classical);
        }
    }
}

#[test]
fn what_is_left_out_and_what_goes_straight() {
    let medium = Medium::new(0.1, 2.0, 0.6);
    for model in all() {
        let bssrdf = of(&model, &medium, 1.3);
        let leaves_out = [PLAIN, CLASSICAL, BETTER, FITTED].contains(&model);
        assert_eq!(bssrdf.leaves_out_single, leaves_out, "{model:?}");
        // Delta-Eddington takes the part g^2 for straight.
        let straight = if model == DIRECTIONAL { 0.1 + 2.0 * (1.0 - 0.36) } else { 2.1 };
        assert!((bssrdf.straight_sigma_t - straight).abs() < 1e-14);
        assert_eq!(bssrdf.fit_error.is_some(), model == FITTED);
    }
}

/// A given albedo is the total; without one it is the classical dipole's.
#[test]
fn albedos_of_normalized_diffusion() {
    let medium = media()[0];
    let total = |albedo: Option<Vec<f64>>, band: usize| {
        let model = Model::Normalized { scaling: Scaling::Diffuse, albedo };
        let bssrdf = model.of(band, 3, &medium, 1.3).unwrap();
        // F has no square root at 0 in x = sqrt(r).
        integrate(|x| 4.0 * PI * x * x * x * bssrdf.falloff(x * x), 0.0, 15.0, 1e-12).value
    };
    let classical = of(&PLAIN, &medium, 1.3);
    let own = integrate(|r| 2.0 * PI * r * classical.falloff(r), 0.0, 200.0, 1e-12).value;
    for (albedo, band, expected) in
        [(Some(vec![0.3]), 2, 0.3), (Some(vec![0.3, 0.5, 0.9]), 1, 0.5), (None, 0, own)]
    {
        let got = total(albedo, band);
        assert!((got - expected).abs() < 1e-9, "{got} {expected}");
    }
}

#[test]
fn what_does_not_fit_is_refused() {
    let clear = Medium::new(0.1, 0.0, 0.0);
    for model in all().iter().filter(|model| **model != SKIN) {
        assert!(model.of(0, 3, &clear, 1.3).unwrap_err().contains("does not scatter"), "{model:?}");
    }
    let medium = media()[0];
    let refusal =
        |model: &Model, bands: usize, medium: &Medium| model.of(0, bands, medium, 1.3).unwrap_err();
    assert!(refusal(&SKIN, 1, &medium).contains("three bands"));
    assert!(refusal(&DMFP, 3, &Medium::new(0.0, 1.0, 0.0)).contains("does not absorb"));
    let albedo = |albedo| Model::Normalized { scaling: Scaling::Searchlight, albedo: Some(albedo) };
    assert!(refusal(&albedo(vec![0.5, 0.5]), 3, &medium).contains("has 2 numbers"));
    assert!(refusal(&albedo(vec![]), 3, &medium).contains("has 0 numbers"));
    assert!(refusal(&albedo(vec![1.5]), 3, &medium).contains("at most 1"));
    assert!(refusal(&albedo(vec![f64::NAN]), 3, &medium).contains("NaN"));
    assert!(refusal(&Model::Skin { reflectance: [0.0, 0.5, 0.5] }, 3, &medium).contains("above 0"));
    let fitted = |terms| Model::Gaussians { dipole: FittedDipole::Classical, moments: EXACT, terms };
    assert!(refusal(&fitted(0), 3, &medium).contains("1 to 12"));
    assert!(refusal(&fitted(13), 3, &medium).contains("1 to 12"));
}
