//! Radial profiles, their sampling, and Fresnel moments.

use super::super::moments::{deon_irving_first, deon_irving_second, egan_hilgeman_first};
use super::super::{Better, Classical, FresnelMoments, Gaussians, Normalized, Reduced, SKIN, Scaling};
use super::{OracleRow, OracleTable, half_unit};
use crate::optics::materials;
use crate::sampling::radial::{Dipole, Radial};

fn reduced(row: &OracleRow) -> Reduced {
    Reduced::new(row.number("sigma_a"), row.number("sigma_s_prime"))
}

#[test]
fn every_fresnel_moment_of_the_table() {
    let table = OracleTable::of(include_str!("../tables/fresnel_moments.csv"));
    for row in table.rows() {
        let eta = row.number("eta");
        let [inside, outside] = [eta, 1.0 / eta].map(FresnelMoments::exact);
        for (name, value) in [
            ("Fdr_int", inside.c1),
            ("Fdr_ext", inside.c1_external),
            ("Fdr_ext", outside.c1),
            ("Fdr_int", outside.c1_external),
            ("C2_int3", inside.c2),
            ("C2_ext3", outside.c2),
        ] {
            // At eta = 1 the table has the rounding of its own arithmetic, 3e-42, for 0.
            if eta == 1.0 { assert_eq!(value, 0.0) } else { row.has(name, value, 12) }
        }
        row.has("A_exact", inside.mismatch(), 12);
        row.has("A2_exact", inside.mismatch_of_flux(), 12);
        row.has("Cphi_exact", inside.c_phi(), 12);
        row.has("CE_exact", inside.c_e(), 12);
        row.has("poly_EH_int", egan_hilgeman_first(eta), 12);
        row.has("poly_C1_int", deon_irving_first(eta), 12);
        row.has("poly_C2_int", deon_irving_second(eta), 12);
        if eta > 1.0 {
            row.has("poly_EH_ext", egan_hilgeman_first(1.0 / eta), 12);
            row.has("poly_C1_ext", deon_irving_first(1.0 / eta), 12);
            row.has("poly_C2_ext", deon_irving_second(1.0 / eta), 12);
        } else {
            // 1/1 is not below 1: the table repeats the inner branch.
            row.has("poly_EH_ext", egan_hilgeman_first(1.0), 12);
            row.has("poly_C1_ext", deon_irving_first(1.0), 12);
            row.has("poly_C2_ext", deon_irving_second(1.0), 12);
        }
        let [hilgeman, irving] = [FresnelMoments::egan_hilgeman(eta), FresnelMoments::deon_irving(eta)];
        if eta == 1.0 {
            assert_eq!([hilgeman.c1, irving.c1, irving.c2], [0.0; 3]);
        } else {
            row.has("A_polyEH", hilgeman.mismatch(), 12);
            row.has("A2_poly", irving.mismatch_of_flux(), 12);
            assert_eq!(irving.c1_external, deon_irving_first(1.0 / eta));
            assert_eq!(hilgeman.c1_external, egan_hilgeman_first(1.0 / eta));
        }
    }
}

/// 1 - 2 C1(n) = (1 - 2 C1(1/n)) / n^2, from thin media to dense ones.
#[test]
fn moments_from_both_sides_belong_together() {
    for eta in [0.4, 0.75, 0.999, 1.000_001, 1.01, 1.3, 1.5, 2.4, 5.0] {
        let moments = FresnelMoments::exact(eta);
        let other = (1.0 - moments.c1_external) / (eta * eta);
        assert!((1.0 - moments.c1 - other).abs() < 1e-13, "{eta}: {moments:?}");
    }
}

/// 1e-9 relative is asked; what is printed is reached.
#[test]
fn every_value_of_the_dipole_profiles() {
    let table = OracleTable::of(include_str!("../tables/dipole_profiles.csv"));
    for row in table.rows() {
        let (reduced, eta, r) = (reduced(&row), row.number("eta"), row.number("r_mm"));
        let classical = |moments| Classical::new(&reduced, &moments).exitance(r);
        row.has("Rd_classical_polyEH", classical(FresnelMoments::egan_hilgeman(eta)), 12);
        row.has("Rd_classical_exactA", classical(FresnelMoments::exact(eta)), 12);
        row.has("Rd_better", Better::new(&reduced, &FresnelMoments::deon_irving(eta)).exitance(r), 12);
    }
}

/// The materials of the library are those of the tables, as far as the tables go.
#[test]
fn tables_and_materials_agree() {
    let table = OracleTable::of(include_str!("../tables/dipole_profiles.csv"));
    let albedos = OracleTable::of(include_str!("../tables/dipole_albedo.csv"));
    let of = |row: &OracleRow| {
        let material = materials::find(row.text("material")).unwrap();
        (material, ["R", "G", "B"].iter().position(|band| *band == row.text("band")).unwrap())
    };
    for row in table.rows() {
        let (material, band) = of(&row);
        assert_eq!(material.sigma_a[band], row.number("sigma_a"));
        assert_eq!(material.reduced_sigma_s[band], row.number("sigma_s_prime"));
        assert_eq!(material.eta, row.number("eta"));
    }
    for row in albedos.rows() {
        let (material, band) = of(&row);
        assert_eq!(material.reflectance[band], row.number("Rd_published"));
    }
}

#[test]
fn every_value_of_the_dipoles_radial_sampling() {
    let table = OracleTable::of(include_str!("../tables/dipole_radial_sampling.csv"));
    for row in table.rows() {
        let material = materials::find(row.text("material")).unwrap();
        let band = ["R", "G", "B"].iter().position(|band| *band == row.text("band")).unwrap();
        let reduced = Reduced::new(material.sigma_a[band], material.reduced_sigma_s[band]);
        let shape = Classical::new(&reduced, &FresnelMoments::egan_hilgeman(material.eta)).shape();
        let s = shape.sigma_tr;
        let weights = [shape.z_real, shape.z_virtual].map(|z| (-s * z).exp());
        let w_real = weights[0] / (weights[0] + weights[1]);
        row.has("w_real", w_real, 12);
        // The same source twice leaves half of the numbers to each branch: 0.25 is u = 0.5 of the first.
        let lobe = |z| Radial::Dipole(Dipole { z_real: z, z_virtual: z, ..shape }).sample_radius(0.25);
        row.has("r_real_u0.5", lobe(shape.z_real), 12);
        row.has("r_virt_u0.5", lobe(shape.z_virtual), 12);
        let distribution = |r: f64| {
            let inside = |z: f64| {
                let d = r.hypot(z);
                1.0 - z / d * (s * (z - d)).exp()
            };
            w_real * inside(shape.z_real) + (1.0 - w_real) * inside(shape.z_virtual)
        };
        for (name, q) in [("r_q10", 0.1), ("r_q50", 0.5), ("r_q90", 0.9), ("r_q99", 0.99)] {
            let r = row.number(name);
            let half = half_unit(r, 12);
            // 4 eps: what F itself is computed to.
            let [below, above] = [r - half, r + half].map(distribution);
            assert!(below <= q + 1e-15 && above >= q - 1e-15, "{name} {:?}", row.fields);
        }
    }
}

#[test]
fn every_value_of_normalized_diffusion() {
    let table = OracleTable::of(include_str!("../tables/normalized_diffusion.csv"));
    for row in table.rows() {
        let (albedo, r) = (row.number("A"), row.number("r_mm"));
        row.has("s_searchlight", Scaling::Searchlight.shape(albedo), 12);
        row.has("s_diffuse", Scaling::Diffuse.shape(albedo), 12);
        row.has("s_dmfp", Scaling::DiffuseMeanFreePath.shape(albedo), 12);
        let normalized = Normalized::new(Scaling::Searchlight, albedo, 1.0);
        row.has("R", normalized.exitance(r), 12);
        let d = normalized.d();
        let cdf = -0.25 * (-r / d).exp_m1() - 0.75 * (-r / (3.0 * d)).exp_m1();
        row.has("cdf", cdf, 12);
    }
}

#[test]
fn the_gaussians_of_skin_are_the_published_ones() {
    let table = OracleTable::of(include_str!("../tables/skin_gaussians.csv"));
    assert_eq!(table.rows.len(), SKIN.len());
    for (row, (variance, weights)) in table.rows().zip(SKIN) {
        assert_eq!(row.number("variance_mm2"), variance);
        assert_eq!(["w_red", "w_green", "w_blue"].map(|name| row.number(name)), weights);
    }
    for band in 0..3 {
        let skin = Gaussians::skin(band, 1.0);
        assert!((skin.total() - 1.0).abs() < 1e-15);
        assert!((Gaussians::skin(band, 0.25).total() - 0.25).abs() < 1e-15);
        let literal = |r: f64| -> f64 {
            let term = |(v, w): &(f64, [f64; 3])| {
                w[band] * (-r * r / (2.0 * v)).exp() / (2.0 * std::f64::consts::PI * v)
            };
            SKIN.iter().map(term).sum()
        };
        for r in [0.0, 0.05, 0.3, 1.0, 4.0] {
            assert!((skin.exitance(r) / literal(r) - 1.0).abs() < 1e-14, "{band} {r}");
        }
    }
}
