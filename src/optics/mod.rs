//! Stub.

/// How bands are shown.
pub mod colour;

/// Refractive index by wavelength.
pub mod dispersion;

/// Measured materials.
pub mod materials;
