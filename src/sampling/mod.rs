//! Random streams, warps with their pdf twins, distances, MIS. Sampling code takes uniform numbers,
//! never a generator, so that it can be enumerated and integrated; only estimators hold a stream.

/// Flight distances.
pub mod distance;

/// The keyed random streams.
pub mod stream;

/// Maps from the unit square, each beside its density.
pub mod warp;

/// The balance heuristic for two techniques with one sample each (Veach & Guibas 1995): the weight of
/// a sample drawn with `pdf` that the other technique could have drawn with `other`.
#[inline]
pub fn balance(pdf: f64, other: f64) -> f64 {
    pdf / (pdf + other)
}
