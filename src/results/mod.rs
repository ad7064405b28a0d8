//! Records, provenance, the atomic store, images.

/// The record's layout.
pub mod record;
