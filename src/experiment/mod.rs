//! Experiment files: schema, validation, build.

/// What a file may say.
pub mod schema;
