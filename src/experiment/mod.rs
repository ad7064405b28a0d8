//! Experiment files: schema, validation, build.

/// A TOML text as a tree with places.
pub mod document;

/// Setting values by dotted key.
pub mod overrides;

/// The estimators that a program knows by name.
pub mod registry;

/// What a file may say.
pub mod schema;

/// The JSON Schema of a file.
pub mod schema_json;

/// "Did you mean".
pub mod suggest;

/// The walk along the schema.
pub mod validate;
