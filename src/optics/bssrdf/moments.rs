//! Angular moments of the Fresnel reflectance.

/// Where the moments come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MomentKind {
    /// By quadrature of the Fresnel equations.
    #[default]
    Exact,
    /// By the polynomials that the model's source uses.
    Polynomial,
}

/// 2 C1 = 2 int F mu dmu and 3 C2 = 3 int F mu^2 dmu for light inside that meets the boundary; 2 C1 also from outside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moments {
    /// 2 C1 from inside.
    pub c1: f64,
    /// 3 C2 from inside.
    pub c2: f64,
    /// 2 C1 from outside.
    pub c1_external: f64,
}

impl Moments {
    /// For an index inside over outside.
    pub fn new(_kind: MomentKind, eta: f64) -> Moments {
        if eta == 1.0 {
            return Moments { c1: 0.0, c2: 0.0, c1_external: 0.0 };
        }
        // Egan & Hilgeman 1979.
        let c1 = -1.4399 / (eta * eta) + 0.7099 / eta + 0.6681 + 0.0636 * eta;
        Moments { c1, c2: 0.0, c1_external: 1.0 - eta * eta * (1.0 - c1) }
    }
}
