//! Records, provenance, the atomic store, images.
//! The only module that uses `blake3`, `exr` and `png`; it shares `csv` with `experiment`.

/// Files that are there whole or not at all.
pub mod atomic;
/// A canvas for pictures.
pub mod canvas;
/// How far counted work may be from CPU time.
pub mod counted_work;
/// Comma-separated text.
pub mod csv_text;
/// OpenEXR files.
pub mod exr_file;
pub(crate) mod hdr_file;
/// A run's image, and the PNG that shows it.
pub mod image;
/// Canonical JSON and content hashes.
pub mod json;
/// The arrays of a record, and the names of their axes.
pub mod layout;
/// Letters for labels in pictures.
mod letters;
/// One writer at a time in a results folder.
pub(crate) mod lock;
/// The summary of a result that is kept without its arrays.
pub mod manifest;
/// The table of everything that was measured.
pub mod measurements;
/// NumPy's array files.
pub mod npy;
/// Numbers with their uncertainty.
pub(crate) mod number;
/// Pictures that an experiment asks for.
pub mod pictures;
/// Build and machine of a run.
pub mod provenance;
/// The record's layout.
pub mod record;
/// A small made-up record.
#[cfg(test)]
pub mod sample;
/// Samplers in a record.
pub mod sampler;
/// A record's folder.
pub mod store;
/// Times of a run.
pub mod timing;
