//! The directional dipole between every pair of ends of a table, and its degenerate ends.

use super::super::{DirectionalDipole, DirectionalTerms, Entry, Exit, FresnelMoments, Reduced};
use super::{OracleRow, OracleTable, half_unit};
use crate::math::{DVec3, Frame};
use crate::optics::fresnel::fresnel;

const COORDINATES: [&str; 18] = [
    "xi_x", "xi_y", "xi_z", "ni_x", "ni_y", "ni_z", "wi_x", "wi_y", "wi_z", "xo_x", "xo_y", "xo_z",
    "no_x", "no_y", "no_z", "wo_x", "wo_y", "wo_z",
];

/// Ends: xi, ni, wi, xo, no, wo, the directions away from the surface.
type Ends = [f64; 18];

fn vectors(ends: &Ends) -> [DVec3; 6] {
    std::array::from_fn(|i| DVec3::from_slice(&ends[3 * i..3 * i + 3]))
}

/// Direction of travel inside, and the transmitted part.
fn refract(w: DVec3, normal: DVec3, eta: f64) -> (DVec3, f64) {
    let cos = w.dot(normal);
    let surface = fresnel(cos, eta);
    ((normal * cos - w) / eta - normal * surface.cos_t, 1.0 - surface.reflectance)
}

fn model(row: &OracleRow) -> DirectionalDipole {
    let (sigma_a, sigma_s, g) = (row.number("sigma_a"), row.number("sigma_s"), row.number("g"));
    let reduced = Reduced::new(sigma_a, sigma_s * (1.0 - g));
    DirectionalDipole::new(&reduced, sigma_a + sigma_s, &FresnelMoments::deon_irving(row.number("eta")))
}

/// The columns that the ends give.
fn columns(model: &DirectionalDipole, ends: &Ends, eta: f64) -> [(&'static str, f64); 10] {
    let [xi, ni, wi, xo, no, wo] = vectors(ends);
    let [(dir, t12), (back, t21)] = [refract(wi, ni, eta), refract(wo, no, eta)];
    let entry = Entry { point: xi, normal: ni, dir };
    let exit = Exit { point: xo, normal: no };
    let DirectionalTerms { real, mirrored, d_r, d_v, mu0 } = model.parts(&entry, &exit);
    let reverse =
        model.parts(&Entry { point: xo, normal: no, dir: back }, &Exit { point: xi, normal: ni });
    [
        ("d_r", d_r),
        ("d_v", d_v),
        ("mu0", mu0),
        ("S_real", real),
        ("S_virt", mirrored),
        ("Sd", real - mirrored),
        ("T12", t12),
        ("T21", t21),
        ("S_full", t12 * model.kernel(&entry, &exit) * t21),
        ("Sd_reversed", reverse.real - reverse.mirrored),
    ]
}

/// To the 12 digits printed, where the ends, which have 12 digits themselves, determine as many: to half
/// a unit of the last digit and what half a unit in the last digit of every coordinate moves the value
/// by.
#[test]
fn every_value_of_the_table() {
    let table = OracleTable::of(include_str!("../tables/directional_dipole.csv"));
    let (mut negative, mut not_reciprocal) = (0, 0);
    for row in table.rows() {
        let (model, eta) = (model(&row), row.number("eta"));
        let ends: Ends = COORDINATES.map(|name| row.number(name));
        let values = columns(&model, &ends, eta);
        let mut moves = [0.0; 10];
        for i in 0..18 {
            let mut other = ends;
            other[i] += half_unit(ends[i], 12);
            for (moved, (a, b)) in moves.iter_mut().zip(values.iter().zip(columns(&model, &other, eta)))
            {
                *moved += (a.1 - b.1).abs();
            }
        }
        for ((name, value), moved) in values.into_iter().zip(moves) {
            let expected = row.number(name);
            // Else the test would be of nothing.
            assert!(
                moved <= 1e-8 * expected.abs() || expected.abs() < 1e-9,
                "{name} {moved} {:?}",
                row.fields
            );
            row.is_within(name, value, half_unit(expected, 12) + moved);
        }
        negative += usize::from(row.number("Sd") < 0.0);
        let ratio = row.number("Sd") / row.number("Sd_reversed");
        not_reciprocal += usize::from((ratio - 1.0).abs() > 0.1);
    }
    assert!(negative >= 8 && not_reciprocal > 20, "{negative} {not_reciprocal}");
}

fn typical() -> DirectionalDipole {
    let reduced = Reduced::new(0.032, 0.74);
    DirectionalDipole::new(&reduced, reduced.sigma_t, &FresnelMoments::exact(1.3))
}

/// A turn that is about no axis in particular.
fn turn(v: DVec3) -> DVec3 {
    let frame = Frame::about(DVec3::new(0.36, -0.48, 0.8));
    let w = frame.to_world(v);
    Frame::about(DVec3::new(-0.6, 0.64, -0.48)).to_world(DVec3::new(w.y, -w.x, w.z))
}

/// Ends with the same point; with the exit straight below: on a slab, on a sphere with the ray along the
/// line or not.
#[test]
fn degenerate_ends_are_finite_and_turn_with_the_scene() {
    let oblique = DVec3::new(0.48, -0.36, -0.8);
    let tilted = DVec3::new(0.28, 0.0, -0.96);
    for (point, normal, dir) in [
        (DVec3::ZERO, DVec3::Z, -DVec3::Z),
        (DVec3::ZERO, DVec3::Z, oblique),
        (DVec3::ZERO, -DVec3::Z, oblique),
        (DVec3::ZERO, DVec3::X, -DVec3::Z),
        (-2.0 * DVec3::Z, -DVec3::Z, oblique),
        (-2.0 * DVec3::Z, -DVec3::Z, -DVec3::Z),
        (-2.0 * DVec3::Z, tilted, -DVec3::Z),
        (-2.0 * DVec3::Z, tilted, oblique),
    ] {
        let parts = |t: &dyn Fn(DVec3) -> DVec3| {
            let entry = Entry { point: t(DVec3::ZERO), normal: t(DVec3::Z), dir: t(dir) };
            typical().parts(&entry, &Exit { point: t(point), normal: t(normal) })
        };
        let (plain, turned) = (parts(&|v| v), parts(&turn));
        for (a, b) in [(plain.real, turned.real), (plain.mirrored, turned.mirrored)] {
            assert!(a.is_finite() && a != 0.0, "{plain:?}");
            assert!((a / b - 1.0).abs() < 1e-9, "{point} {normal} {dir}: {plain:?} {turned:?}");
        }
    }
}

/// On a plane n_i* is the normal: nothing depends on where azimuths begin.
#[test]
fn ordinary_ends_turn_with_the_scene() {
    let entry = |t: &dyn Fn(DVec3) -> DVec3| Entry {
        point: t(DVec3::new(0.3, 0.1, -0.2)),
        normal: t(DVec3::new(0.0, 0.6, 0.8)),
        dir: t(DVec3::new(0.48, -0.36, -0.8)),
    };
    let exit = |t: &dyn Fn(DVec3) -> DVec3| Exit {
        point: t(DVec3::new(1.1, -0.4, 0.5)),
        normal: t(DVec3::new(0.64, -0.48, 0.6)),
    };
    let plain = typical().parts(&entry(&|v| v), &exit(&|v| v));
    let turned = typical().parts(&entry(&turn), &exit(&turn));
    assert!((plain.real / turned.real - 1.0).abs() < 1e-12);
    assert!((plain.mirrored / turned.mirrored - 1.0).abs() < 1e-12);
}

/// The exitance of the fluence phi of the source, C_phi phi - C_E D n.grad phi, by differences: S' is
/// that over pi 4 C_phi(1/eta) per power, for an exit that looks away so that nothing is corrected
/// except the distance, which the table has; here the virtual source, which uses its own distance
/// throughout.
#[test]
fn the_kernel_is_the_exitance_of_the_rays_fluence() {
    let reduced = Reduced::new(0.032, 0.74);
    let moments = FresnelMoments::exact(1.3);
    let model = DirectionalDipole::new(&reduced, reduced.sigma_t, &moments);
    let entry = Entry { point: DVec3::ZERO, normal: DVec3::Z, dir: DVec3::new(0.48, -0.36, -0.8) };
    let d = 1.0 / (3.0 * reduced.sigma_t);
    let s = model.sigma_tr();
    let up = 2.0 * moments.mismatch_of_flux() * 2.131 * d / reduced.albedo.sqrt();
    let w = DVec3::new(entry.dir.x, entry.dir.y, -entry.dir.z);
    let fluence = |x: DVec3| {
        let r = x.length();
        let ray = 1.0 + 3.0 * d * (1.0 + s * r) / (r * r) * x.dot(w);
        (-s * r).exp() / (4.0 * std::f64::consts::PI * d * r) * ray
    };
    for normal in [DVec3::Z, DVec3::new(0.6, 0.0, 0.8), DVec3::new(0.0, -0.8, 0.6)] {
        let exit = Exit { point: DVec3::new(1.2, 0.7, 0.0), normal };
        let x = exit.point - up * DVec3::Z;
        let h = 1e-4;
        let slope = (fluence(x + h * normal) - fluence(x - h * normal)) / (2.0 * h);
        let exitance = moments.c_phi() * fluence(x) - moments.c_e() * d * slope;
        let expected = exitance / (std::f64::consts::PI * moments.passed());
        let got = model.parts(&entry, &exit).mirrored;
        assert!((got / expected - 1.0).abs() < 1e-6, "{normal}: {got} {expected}");
    }
}
