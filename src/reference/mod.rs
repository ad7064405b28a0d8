//! Oracles: values with stated errors, from closed forms and quadrature. Oracles never use estimators.

/// Semi-infinite, index-matched, isotropically scattering media.
pub(crate) mod chandrasekhar;

/// Densities of direction maps by finite differences.
pub(crate) mod differences;

/// Light that a plane refracts: half-space and slab, parallel light and a point.
pub(crate) mod refracting_plane;

/// Exact single scattering of a convex body of flat facets under parallel light.
pub(crate) mod refracting_polyhedron;

/// Parallel light that a sphere refracts, and reflects once inside.
pub(crate) mod refracting_sphere;
