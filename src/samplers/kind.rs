//! Kinds of samplers: the name and the options under which an experiment asks for one.

use schemars::Schema;
use serde::Deserialize;
use serde_json::Value as Json;

use super::sampler::Sampler;
use crate::error::{Error, Result};

/// One kind of sampler.
#[derive(Clone, Copy, Debug)]
pub struct SamplerKind {
    /// The name under which a `[[sampler]]` asks for it.
    pub kind: &'static str,
    /// What it draws, in one line.
    pub doc: &'static str,
    /// The schema of its options; they refuse unknown keys and keep to the keywords that validation
    /// understands.
    pub options_schema: fn() -> Schema,
    /// Builds it from its validated options.
    pub build: fn(&Json) -> Result<Box<dyn Sampler>>,
}

impl SamplerKind {
    /// The schema of its options as JSON, with its own definitions beside it.
    pub fn options(&self) -> Json {
        (self.options_schema)().to_value()
    }
}

/// Options from their validated JSON.
///
/// # Errors
/// JSON that does not fit the options, which validation has refused before.
pub fn read_options<T: for<'a> Deserialize<'a>>(options: &Json) -> Result<T> {
    T::deserialize(options).map_err(|error| Error::input(format!("sampler options: {error}")))
}

/// A sampler whose options may be refused.
pub(super) fn some<T>(sampler: Option<T>) -> Result<T> {
    sampler.ok_or_else(|| {
        Error::input(
            "sampler options: they leave nothing to sample (a point on the ray's origin, or weights that \
             are all 0)",
        )
    })
}

/// A kind from its name, its line of documentation, the type of its options, and how it is built from
/// them (`?` works there).
macro_rules! sampler_kind {
    ($kind:literal, $doc:literal, $options:ty => $build:expr) => {
        $crate::samplers::SamplerKind {
            kind: $kind,
            doc: $doc,
            options_schema: || schemars::schema_for!($options),
            build: |json| {
                let build: fn($options) -> $crate::error::Result<_> = $build;
                Ok(Box::new(build($crate::samplers::read_options(json)?)?))
            },
        }
    };
}
pub(super) use sampler_kind;
