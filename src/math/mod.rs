//! Vectors, frames, and every transcendental function that results use.
//! The only module that uses `glam` and `libm`: the C library chooses its sine by CPU; that of `libm` is the
//! same everywhere.

pub use glam::{DVec2, DVec3, UVec2, Vec3};

macro_rules! portable {
    ($($name:ident $(, $second:ident)? = $libm:ident : $doc:literal;)*) => { $(
        #[doc = $doc]
        #[inline]
        pub fn $name(x: f64 $(, $second: f64)?) -> f64 {
            libm::$libm(x $(, $second)?)
        }
    )* };
}

portable! {
    exp_m1 = expm1: "e^x - 1, accurate near 0.";
    ln_1p = log1p: "ln(1 + x), accurate near 0.";
    log2 = log2: "Logarithm to base 2.";
    log10 = log10: "Logarithm to base 10.";
    pow, y = pow: "x^y.";
    cbrt = cbrt: "Cube root.";
    sin = sin: "Sine.";
    cos = cos: "Cosine.";
    tan = tan: "Tangent.";
    asin = asin: "Arc sine.";
    acos = acos: "Arc cosine.";
    atan = atan: "Arc tangent.";
    atan2, y = atan2: "Angle of the point (y, x): `atan2(y, x)` as in C, first argument the ordinate.";
    erf = erf: "Error function.";
    erfc = erfc: "Complementary error function, relative accuracy kept in the tail.";
    ln_gamma = lgamma: "Logarithm of |Gamma(x)|.";
}

/// The golden ratio less 1: its multiples spread evenly over the unit interval, and with i / n they make Fibonacci's lattice.
pub const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// x y + z rounded once, in software: the exact remainder of a product. Slow, and the same everywhere.
pub fn fma(x: f64, y: f64, z: f64) -> f64 {
    libm::fma(x, y, z)
}

#[cfg(test)]
mod bits;
mod exponential;
mod frame;
mod inverse;
pub mod lanes;
mod logarithm;
mod quadrature;
mod turns;
mod vectors;

pub use exponential::exp;
pub(crate) use exponential::{NEAR, exp_near};
pub use frame::{Frame, renormalized};
pub use inverse::{bracketed_root, erf_inv, increasing_root, lambert_excess};
pub use logarithm::ln;
pub(crate) use logarithm::ln_of_normal;
pub use quadrature::{Integral, gauss_kronrod, integrate};
pub use turns::sin_cos_turns;
pub(crate) use vectors::{Lanewise, Vectorized, of_each, vectorized};
