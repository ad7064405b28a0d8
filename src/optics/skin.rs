//! The spectral absorption and scattering of skin, one homogeneous layer.
//!
//! Donner & Jensen, "A Spectral BSSRDF for Shading Human Skin" (2006), after Jacques (1998), l in nm,
//! all in 1/mm:
//!   eumelanin      6.6e10 l^-3.33          pheomelanin   2.9e14 l^-4.75
//!   baseline       0.0244 + 8.53 e^(-(l - 154)/66.2)
//!   scattering     sigma_s' = 14.74 l^-0.22 + 2.2e11 l^-4
//! and haemoglobin (150 g/l of blood, 64500 g/mol) from its molar extinction: ln 10 * eps * 150/64500
//! /10 per mm, linear between the 2 nm of its table.
//!   sigma_a = m (b eu + (1 - b) pheo) + h (o HbO2 + (1 - o) Hb) + (1 - m - h) baseline
//! with the volume fractions m of melanosomes and h of blood, the share b of eumelanin, and the
//! oxygenation o. In real skin, melanin lies above the blood; mixing them in one layer keeps the colours and
//! ignores the order of the layers.

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
const TABLE: &str = include_str!("haemoglobin.csv");

static HAEMOGLOBIN: LazyLock<Vec<[f64; 3]>> = LazyLock::new(|| {
    let rows = TABLE.lines().filter(|line| line.starts_with(|c: char| c.is_ascii_digit()));
    rows.map(|row| {
        let mut numbers = row.split(',').map(|n| n.parse().expect("the table holds numbers"));
        std::array::from_fn(|_| numbers.next().expect("a row has three columns"))
    })
    .collect()
});

/// The wavelengths that the model is used at, nm: the visible ones. The table of haemoglobin is wider.
pub const RANGE_NM: [f64; 2] = [380.0, 780.0];

impl SkinFractions {
    /// Absorption and reduced scattering, 1/mm, at a wavelength in [`RANGE_NM`].
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

    /// The means over a band, nm, by midpoints at most 0.5 nm apart: the table has a row each 2 nm.
    pub fn band(&self, [from, to]: [f64; 2]) -> (f64, f64) {
        let steps = (2.0 * (to - from)).ceil().max(16.0);
        let middle = |k: usize| from + (to - from) * (k as f64 + 0.5) / steps;
        let add = |(a, s): (f64, f64), (b, t): (f64, f64)| (a + b, s + t);
        let (a, s) = (0..steps as usize).map(|k| self.at(middle(k))).fold((0.0, 0.0), add);
        (a / steps, s / steps)
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
        // Split where neither part's midpoints are the whole's.
        let wide = skin.band([400.0, 700.0]);
        let parts = [[400.0, 412.3], [412.3, 700.0]];
        let mean =
            parts.map(|[from, to]| (to - from) * skin.band([from, to]).0).iter().sum::<f64>() / 300.0;
        assert!((wide.0 / mean - 1.0).abs() < 1e-4, "{wide:?} {mean}");
    }

    /// Blood alone, from 415 to 430 and from 595 to 610 nm: the integral of the linear interpolant is
    /// that of the trapezoid rule on the table's rows, of which 415 and 595 lie between two. By another
    /// program.
    #[test]
    fn bands_of_blood_are_the_table_s() {
        for (band, expected) in BLOOD_BANDS {
            for (oxygenation, expected) in [1.0, 0.0].into_iter().zip(expected) {
                let found = pure(0.0, 0.0, 1.0, oxygenation).band(band).0;
                assert!((found / expected - 1.0).abs() < 5e-4, "{band:?}: {found} {expected}");
            }
        }
    }

    /// The whole table: every 2 nm from 250 to 1000, the sums of its columns, and those of wavelength
    /// times column, computed from the source. A changed or exchanged number moves one of them.
    #[test]
    fn the_table_is_whole() {
        let rows = &*HAEMOGLOBIN;
        assert_eq!(rows.len(), 376);
        assert!(rows.iter().enumerate().all(|(i, row)| row[0] == 250.0 + 2.0 * i as f64));
        let sum = |of: &dyn Fn(&[f64; 3]) -> f64| rows.iter().map(of).sum::<f64>();
        let sums = [sum(&|r| r[1]), sum(&|r| r[2]), sum(&|r| r[0] * r[1]), sum(&|r| r[0] * r[2])];
        let expected = [18249467.999999996, 20888640.543999992, 7226230190.400001, 8439039291.9920025];
        for (found, expected) in sums.into_iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12 * expected, "{found} {expected}");
        }
    }

    /// Wavelengths of peaks and of steep flanks, and odd ones between two rows: HbO2 and Hb, 1/(cm M).
    #[test]
    fn extinctions_at_and_between_the_peaks() {
        for (nm, expected) in EXTINCTIONS {
            let per_mm = ln(10.0) * 150.0 / 645_000.0;
            let found = haemoglobin(nm).map(|absorption| absorption / per_mm);
            for (found, expected) in found.into_iter().zip(expected) {
                assert!((found / expected - 1.0).abs() < 1e-12, "{nm}: {found} {expected}");
            }
        }
    }

    const BLOOD_BANDS: [([f64; 2], [f64; 2]); 4] = [
        ([415.0, 430.0], [218.360463, 235.077267]),
        ([535.0, 550.0], [26.9720534, 25.9470282]),
        ([595.0, 610.0], [1.61496536, 7.48144168]),
        ([400.0, 700.0], [34.9846276, 43.0397303]),
    ];

    const EXTINCTIONS: [(f64, [f64; 2]); 19] = [
        (380.0, [109564.0, 145232.0]),
        (390.0, [167748.0, 167780.0]),
        (420.0, [480360.0, 407560.0]),
        (421.0, [456120.0, 418720.0]),
        (450.0, [62816.0, 103292.0]),
        (453.0, [56208.0, 49405.0]),
        (480.0, [26629.2, 14550.0]),
        (510.0, [20035.2, 25773.6]),
        (540.0, [53236.0, 46592.0]),
        (541.0, [53264.0, 47370.0]),
        (570.0, [44496.0, 45072.0]),
        (580.0, [50104.0, 37020.0]),
        (600.0, [3200.0, 14677.2]),
        (601.0, [2932.0, 14149.8]),
        (630.0, [610.0, 5148.8]),
        (660.0, [319.6, 3226.56]),
        (690.0, [276.0, 2051.96]),
        (750.0, [518.0, 1405.24]),
        (780.0, [710.0, 1075.44]),
    ];
}
