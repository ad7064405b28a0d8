//! The spectral absorption and scattering of skin, one homogeneous layer.
//!
//! Donner & Jensen, "A Spectral BSSRDF for Shading Human Skin" (2006), after Jacques (1998), l in nm,
//! all in 1/mm:
//!   eumelanin      6.6e10 l^-3.33          pheomelanin   2.9e14 l^-4.75
//!   baseline       0.0244 + 8.53 e^(-(l - 154)/66.2)
//!   scattering     sigma_s' = 14.74 l^-0.22 + 2.2e11 l^-4
//! and haemoglobin (150 g/l of blood, 64500 g/mol) from its molar extinction: ln 10 * eps * 150/64500
//! /10 per mm.
//!   sigma_a = m (b eu + (1 - b) pheo) + h (o HbO2 + (1 - o) Hb) + (1 - m - h) baseline
//! with the volume fractions m of melanosomes and h of blood, the share b of eumelanin, and the
//! oxygenation o. Real skin has its melanin above its blood; mixing them in one layer keeps the colours
//! and loses the layers' order.

use std::sync::LazyLock;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::math::{exp, ln, pow};

/// Skin by its constituents: volume fractions, and the mean cosine of the phase function.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SkinFractions {
    /// Melanosomes: about 0.01 in light skin, 0.4 in dark.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub melanin: f64,
    /// Eumelanin of all melanin.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub eumelanin_share: f64,
    /// Blood: about 0.002 to 0.07.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub blood: f64,
    /// Oxygenated haemoglobin of all: about 0.7.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub oxygenation: f64,
    /// Mean cosine; sigma_s = sigma_s' / (1 - g). Without it g = 0 and sigma_s = sigma_s'.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = -1, "exclusiveMaximum" = 1))]
    pub g: Option<f64>,
}

/// Rows of wavelength, HbO2 and Hb.
const TABLE: &str = include_str!("skin_chromophores.csv");

static HAEMOGLOBIN: LazyLock<Vec<[f64; 3]>> = LazyLock::new(|| {
    let rows = TABLE.lines().filter(|line| line.starts_with(|c: char| c.is_ascii_digit()));
    rows.map(|row| {
        let mut numbers = row.split(',').map(|n| n.parse().expect("the table holds numbers"));
        std::array::from_fn(|_| numbers.next().expect("a row has four columns"))
    })
    .collect()
});

/// The wavelengths of the table, nm.
pub const RANGE_NM: [f64; 2] = [380.0, 780.0];

impl SkinFractions {
    /// Absorption and reduced scattering, 1/mm, at a wavelength in [`RANGE_NM`]; outside it the table's
    /// ends hold.
    pub fn at(&self, nm: f64) -> (f64, f64) {
        let [oxygenated, deoxygenated] = haemoglobin(nm);
        let melanin = self.eumelanin_share * 6.6e10 * pow(nm, -3.33)
            + (1.0 - self.eumelanin_share) * 2.9e14 * pow(nm, -4.75);
        let blood = self.oxygenation * oxygenated + (1.0 - self.oxygenation) * deoxygenated;
        let baseline = 0.0244 + 8.53 * exp(-(nm - 154.0) / 66.2);
        let rest = 1.0 - self.melanin - self.blood;
        let absorption = self.melanin * melanin + self.blood * blood + rest * baseline;
        (absorption, 14.74 * pow(nm, -0.22) + 2.2e11 / (nm * nm * nm * nm))
    }

    /// The means over a band, nm.
    pub fn band(&self, [from, to]: [f64; 2]) -> (f64, f64) {
        const STEPS: usize = 16;
        let middle = |k: usize| from + (to - from) * (k as f64 + 0.5) / STEPS as f64;
        let add = |(a, s): (f64, f64), (b, t): (f64, f64)| (a + b, s + t);
        let (a, s) = (0..STEPS).map(|k| self.at(middle(k))).fold((0.0, 0.0), add);
        (a / STEPS as f64, s / STEPS as f64)
    }
}

/// Absorption of blood whose haemoglobin is oxygenated or not, 1/mm.
fn haemoglobin(nm: f64) -> [f64; 2] {
    let rows = &*HAEMOGLOBIN;
    let after = rows.partition_point(|row| row[0] <= nm).clamp(1, rows.len() - 1);
    let ([from, a, b], [to, c, d]) = (rows[after - 1], rows[after]);
    let share = ((nm - from) / (to - from)).clamp(0.0, 1.0);
    let per_mm = ln(10.0) * 150.0 / 64500.0 / 10.0;
    [a + share * (c - a), b + share * (d - b)].map(|extinction| per_mm * extinction)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pure(melanin: f64, eumelanin_share: f64, blood: f64, oxygenation: f64) -> SkinFractions {
        SkinFractions { melanin, eumelanin_share, blood, oxygenation, g: None }
    }

    /// Each constituent alone, to the six digits of a table computed elsewhere: l; HbO2, Hb, eumelanin,
    /// pheomelanin, baseline, sigma_s'.
    #[test]
    fn constituents() {
        for (nm, expected) in [
            (400.0, [142.563, 119.572, 142.786, 126.652, 0.231942, 12.5387]),
            (550.0, [23.0344, 28.6013, 49.4466, 27.9046, 0.0459305, 6.08226]),
            (700.0, [0.155291, 0.96081, 22.1497, 8.87528, 0.0266336, 4.40428]),
        ] {
            let (_, scattering) = pure(0.0, 0.0, 0.0, 0.0).at(nm);
            let found = [
                pure(0.0, 0.0, 1.0, 1.0).at(nm).0,
                pure(0.0, 0.0, 1.0, 0.0).at(nm).0,
                pure(1.0, 1.0, 0.0, 0.0).at(nm).0,
                pure(1.0, 0.0, 0.0, 0.0).at(nm).0,
                pure(0.0, 0.0, 0.0, 0.0).at(nm).0,
                scattering,
            ];
            for (found, expected) in found.into_iter().zip(expected) {
                assert!((found / expected - 1.0).abs() < 5e-6, "{nm}: {found} {expected}");
            }
        }
    }

    #[test]
    fn bands_are_means() {
        let skin = pure(0.02, 0.7, 0.03, 0.7);
        let (narrow, at) = (skin.band([559.999, 560.001]), skin.at(560.0));
        assert!((narrow.0 / at.0 - 1.0).abs() < 1e-4 && (narrow.1 / at.1 - 1.0).abs() < 1e-4);
        let (wide, halves) = (skin.band([400.0, 700.0]), [[400.0, 550.0], [550.0, 700.0]]);
        let mean = halves.map(|half| skin.band(half).0).iter().sum::<f64>() / 2.0;
        assert!((wide.0 / mean - 1.0).abs() < 0.03, "{wide:?} {mean}");
    }
}
