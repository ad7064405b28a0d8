//! Random streams, warps with their pdfs, distances, MIS. Sampling code takes uniform numbers, never a
//! generator, so that tests can enumerate and integrate it; only estimators hold a stream.

/// One index of many.
pub mod discrete;

/// Distances along a ray.
pub mod distance;

/// A lobe about an axis that is wide or narrow without losing its tail.
pub mod lobe;

/// Directions to a plane above a vertex.
pub mod plane;

/// Points of a plane about the origin.
pub mod radial;

/// The keyed random streams.
pub mod stream;

/// Points of a cloud by distance, independently.
pub mod thinning;

/// Points of a volume by direction and distance towards a given point.
pub mod towards;

/// Maps from the unit square, each beside its density.
pub mod warp;
