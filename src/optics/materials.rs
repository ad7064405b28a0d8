//! Measured homogeneous materials: Jensen, Marschner, Levoy and Hanrahan, "A Practical Model for
//! Subsurface Light Transport", SIGGRAPH 2001, Figure 5.
//!
//! The measurement gives reduced coefficients and no phase function: use them with g = 0 and
//! `sigma_s` = `reduced_sigma_s`, or with sigma_s = reduced_sigma_s / (1 - g) (similarity).
//! Caution: a widely copied transcription has the red `sigma_a` of both chickens ten times too small
//! (0.0015 and 0.0018); 0.015 and 0.018 reproduce the published reflectance.

/// A measured material; the arrays hold the bands R, G, B.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeasuredMaterial {
    /// Name in experiment files.
    pub name: &'static str,
    /// Reduced scattering coefficient sigma_s (1 - g), 1/mm.
    pub reduced_sigma_s: [f64; 3],
    /// Absorption coefficient, 1/mm.
    pub sigma_a: [f64; 3],
    /// Published diffuse reflectance.
    pub reflectance: [f64; 3],
    /// Refractive index inside over outside.
    pub eta: f64,
}

/// Where the numbers come from.
pub const SOURCE: &str = "Jensen, Marschner, Levoy, Hanrahan 2001, Figure 5";

const fn material(
    name: &'static str,
    reduced_sigma_s: [f64; 3],
    sigma_a: [f64; 3],
    reflectance: [f64; 3],
    eta: f64,
) -> MeasuredMaterial {
    MeasuredMaterial { name, reduced_sigma_s, sigma_a, reflectance, eta }
}

/// The materials by name.
pub const MATERIALS: [MeasuredMaterial; 12] = [
    material("apple", [2.29, 2.39, 1.97], [0.003, 0.0034, 0.046], [0.85, 0.84, 0.53], 1.3),
    material("chicken1", [0.15, 0.21, 0.38], [0.015, 0.077, 0.19], [0.31, 0.15, 0.1], 1.3),
    material("chicken2", [0.19, 0.25, 0.32], [0.018, 0.088, 0.2], [0.32, 0.16, 0.1], 1.3),
    material("cream", [7.38, 5.47, 3.15], [0.0002, 0.0028, 0.0163], [0.98, 0.9, 0.73], 1.3),
    material("ketchup", [0.18, 0.07, 0.03], [0.061, 0.97, 1.45], [0.16, 0.01, 0.0], 1.3),
    material("marble", [2.19, 2.62, 3.0], [0.0021, 0.0041, 0.0071], [0.83, 0.79, 0.75], 1.5),
    material("potato", [0.68, 0.7, 0.55], [0.0024, 0.009, 0.12], [0.77, 0.62, 0.21], 1.3),
    material("skimmilk", [0.7, 1.22, 1.9], [0.0014, 0.0025, 0.0142], [0.81, 0.81, 0.69], 1.3),
    material("skin1", [0.74, 0.88, 1.01], [0.032, 0.17, 0.48], [0.44, 0.22, 0.13], 1.3),
    material("skin2", [1.09, 1.59, 1.79], [0.013, 0.07, 0.145], [0.63, 0.44, 0.34], 1.3),
    material("spectralon", [11.6, 20.4, 14.9], [0.0, 0.0, 0.0], [1.0, 1.0, 1.0], 1.3),
    material("wholemilk", [2.55, 3.21, 3.77], [0.0011, 0.0024, 0.014], [0.91, 0.88, 0.76], 1.3),
];

/// The material of a name.
pub fn find(name: &str) -> Option<&'static MeasuredMaterial> {
    MATERIALS.iter().find(|material| material.name == name)
}

/// The names of all materials.
pub fn names() -> Vec<&'static str> {
    MATERIALS.iter().map(|material| material.name).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_holds_the_published_numbers() {
        let skin = find("skin1").unwrap();
        assert_eq!(skin.reduced_sigma_s, [0.74, 0.88, 1.01]);
        assert_eq!(skin.sigma_a, [0.032, 0.17, 0.48]);
        assert_eq!((skin.eta, find("marble").unwrap().eta), (1.3, 1.5));
        assert_eq!(find("ketchup").unwrap().sigma_a[2], 1.45);
        assert!(find("skin").is_none());
        assert_eq!(find("skin2").unwrap().sigma_a, [0.013, 0.07, 0.145]);
        assert_eq!(find("chicken2").unwrap().reduced_sigma_s, [0.19, 0.25, 0.32]);
    }

    /// All twelve rows of the figure: sums over materials by band, weighted by their place, computed
    /// from the source. A changed or exchanged number moves one of them.
    #[test]
    fn the_table_is_whole() {
        let sums = |of: fn(&MeasuredMaterial) -> [f64; 3]| {
            let weighted = |band: usize| {
                MATERIALS.iter().enumerate().map(|(i, m)| (i + 1) as f64 * of(m)[band]).sum::<f64>()
            };
            [weighted(0), weighted(1), weighted(2)]
        };
        let found = [sums(|m| m.reduced_sigma_s), sums(|m| m.sigma_a), sums(|m| m.reflectance)];
        let expected = [[232.84, 342.91, 289.62], [0.8646, 7.649, 15.2754], [56.18, 48.77, 40.13]];
        for (found, expected) in found.as_flattened().iter().zip(expected.as_flattened()) {
            assert!((found - expected).abs() < 1e-11, "{found} {expected}");
        }
        assert_eq!(MATERIALS.iter().filter(|m| m.eta == 1.5).count(), 1);
        assert!(MATERIALS.is_sorted_by(|a, b| a.name < b.name));
    }

    /// The reflectance of the paper's own dipole, R = a'/2 (1 + exp(-4/3 A z)) exp(-z) with
    /// z = sqrt(3 (1 - a')), tells the right transcription of chicken from the copied wrong one.
    #[test]
    fn the_coefficients_reproduce_the_published_reflectance() {
        for material in &MATERIALS {
            for band in 0..3 {
                let (s, a) = (material.reduced_sigma_s[band], material.sigma_a[band]);
                let r = dipole_reflectance(s / (s + a), material.eta);
                let published = material.reflectance[band];
                assert!((r - published).abs() < 0.03, "{} {band}: {r} {published}", material.name);
            }
        }
        assert!((dipole_reflectance(0.15 / 0.1515, 1.3) - 0.31).abs() > 0.2);
    }

    fn dipole_reflectance(albedo: f64, eta: f64) -> f64 {
        let fresnel = -1.440 / (eta * eta) + 0.710 / eta + 0.668 + 0.0636 * eta;
        let a = (1.0 + fresnel) / (1.0 - fresnel);
        let z = (3.0 * (1.0 - albedo)).sqrt();
        0.5 * albedo * (1.0 + crate::math::exp(-4.0 / 3.0 * a * z)) * crate::math::exp(-z)
    }
}
