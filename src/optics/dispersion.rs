//! Refractive index by wavelength: the formulas of Cauchy and Sellmeier, and a few named glasses.

/// A dispersion formula over the wavelength l in micrometres.
#[derive(Clone, Debug, PartialEq)]
pub enum Dispersion {
    /// n = a + b/l^2 + c/l^4.
    Cauchy {
        /// Constant term.
        a: f64,
        /// Coefficient of l^-2, um^2.
        b_um2: f64,
        /// Coefficient of l^-4, um^4.
        c_um4: f64,
    },
    /// n^2 = 1 + sum_i b_i l^2 / (l^2 - c_i).
    Sellmeier {
        /// Strengths and squared resonance wavelengths, um^2.
        terms: Vec<[f64; 2]>,
    },
}

impl Dispersion {
    /// The index at a wavelength in nm; none where the formula gives no positive real number.
    pub fn eta(&self, wavelength_nm: f64) -> Option<f64> {
        let l2 = (wavelength_nm * 1e-3) * (wavelength_nm * 1e-3);
        let eta = match self {
            Dispersion::Cauchy { a, b_um2, c_um4 } => a + (b_um2 + c_um4 / l2) / l2,
            Dispersion::Sellmeier { terms } => {
                let sum: f64 = terms.iter().map(|[b, c]| b * l2 / (l2 - c)).sum();
                (1.0 + sum).sqrt()
            }
        };
        (eta.is_finite() && eta > 0.0).then_some(eta)
    }
}

/// A glass of known dispersion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Glass {
    /// Name in experiment files.
    pub name: &'static str,
    /// Sellmeier terms: strength and squared resonance wavelength in um^2.
    pub terms: [[f64; 2]; 3],
    /// Where the numbers come from.
    pub source: &'static str,
}

/// The glasses by name.
pub const GLASSES: [Glass; 2] = [
    Glass {
        name: "bk7",
        terms: [[1.03961212, 0.00600069867], [0.231792344, 0.0200179144], [1.01046945, 103.560653]],
        source: "SCHOTT N-BK7 data sheet",
    },
    Glass {
        name: "fused_silica",
        terms: [
            [0.6961663, 0.0684043 * 0.0684043],
            [0.4079426, 0.1162414 * 0.1162414],
            [0.8974794, 9.896161 * 9.896161],
        ],
        source: "Malitson 1965",
    },
];

/// The dispersion of a glass.
pub fn glass(name: &str) -> Option<Dispersion> {
    let glass = GLASSES.iter().find(|glass| glass.name == name)?;
    Some(Dispersion::Sellmeier { terms: glass.terms.to_vec() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_glasses_have_their_index() {
        let n = |name, nm| glass(name).unwrap().eta(nm).unwrap();
        // d, F and C lines; the data sheet states n_d = 1.51680 and the Abbe number 64.17.
        assert!((n("bk7", 587.5618) - 1.5168).abs() < 1e-5);
        let abbe = (n("bk7", 587.5618) - 1.0) / (n("bk7", 486.1327) - n("bk7", 656.2725));
        assert!((abbe - 64.17).abs() < 0.01, "{abbe}");
        assert!((n("fused_silica", 587.5618) - 1.45846).abs() < 1e-5);
    }

    #[test]
    fn cauchy_sums_its_terms() {
        let crown = Dispersion::Cauchy { a: 1.5, b_um2: 0.004, c_um4: 0.0001 };
        // At 500 nm: 1.5 + 0.004 * 4 + 0.0001 * 16.
        assert!((crown.eta(500.0).unwrap() - 1.5176).abs() < 1e-15);
    }

    #[test]
    fn an_index_that_is_not_real_is_none() {
        let terms = vec![[1.0, 0.26]];
        assert_eq!(Dispersion::Sellmeier { terms: terms.clone() }.eta(500.0), None);
        assert!(Dispersion::Sellmeier { terms }.eta(600.0).is_some());
        assert_eq!(Dispersion::Cauchy { a: -1.0, b_um2: 0.0, c_um4: 0.0 }.eta(500.0), None);
    }
}
