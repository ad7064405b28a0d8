//! Fresnel, microfacets, boundaries, phase functions, media, spectra and materials: scalar, for one band.

/// Light that diffuses from one point of a surface to another.
pub mod bssrdf;

/// The refractive surface as a whole.
pub mod boundary;

/// Reflectance of a smooth dielectric.
pub mod fresnel;

/// Turns and flights drawn towards where importance grows.
pub mod guided;

/// Directions of a single bounce towards a point, in proportion to phase function and geometry.
pub mod joint;

/// Homogeneous media.
pub mod medium;

/// Distributions of microfacet normals.
pub mod microfacet;

/// Phase functions.
pub mod phase;

/// Dispersion formulas.
pub mod dispersion;

/// Bands as linear sRGB, through the CIE colour matching functions.
pub mod colour;

/// Measured materials.
pub mod materials;

/// The spectrum of skin.
pub mod skin;
pub(crate) mod upsampling;
