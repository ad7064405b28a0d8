//! Records, provenance, the atomic store, images.
//! Doors for `blake3`, `csv`, `exr` and `png`.

/// Files that are there whole or not at all.
pub mod atomic;
/// A sheet of pictures.
pub mod canvas;
/// Comma-separated text.
pub mod csv_text;
/// OpenEXR files.
pub mod exr_file;
/// A run's image, and the PNG that shows it.
pub mod image;
/// Canonical JSON and content hashes.
pub mod json;
/// What of a result is kept where its arrays are not.
pub mod manifest;
/// The table of everything that was measured.
pub mod measurements;
/// NumPy's array files.
pub mod npy;
/// What pictures an experiment asks for.
pub mod pictures;
/// What built and ran it.
pub mod provenance;
/// The record's layout.
pub mod record;
/// A small made-up record.
#[cfg(test)]
pub mod sample;
/// What a record holds of samplers.
pub mod sampler;
/// A record's folder.
pub mod store;
/// What it cost in time.
pub mod timing;
