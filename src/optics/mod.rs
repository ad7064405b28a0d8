//! Fresnel, microfacets, boundaries, phase functions, media, spectra and materials: scalar, one band.

/// The refractive surface as a whole.
pub mod boundary;

/// Reflectance of a smooth dielectric.
pub mod fresnel;

/// Homogeneous media.
pub mod medium;

/// Distributions of microfacet normals.
pub mod microfacet;

/// Phase functions.
pub mod phase;
