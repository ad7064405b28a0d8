//! Kinds of estimators: the name and the options under which an experiment asks for one, and which
//! scenes it serves.

use std::sync::Arc;

use schemars::Schema;
use serde::Deserialize;
use serde_json::Value as Json;

use super::estimator::Estimator;
use super::serves::Serves;
use crate::error::{Error, Result};
use crate::scene::Scene;

/// One kind of estimator.
#[derive(Clone, Copy, Debug)]
pub struct EstimatorKind {
    /// The name under which an `[[estimator]]` asks for it.
    pub kind: &'static str,
    /// Description of the method, in one line.
    pub doc: &'static str,
    /// The scenes that it serves. Its constructor refuses all others by [`EstimatorKind::check`].
    pub serves: Serves,
    /// The schema of its options, `|| schemars::schema_for!(Options)`; options must refuse unknown
    /// keys and keep to the keywords that validation understands.
    pub options_schema: fn() -> Schema,
    /// Builds it from its validated options and a scene.
    pub build: BuildEstimator,
}

/// Builds an estimator from its validated options and a scene.
pub type BuildEstimator = fn(&Json, Arc<Scene>) -> Result<Box<dyn Estimator>>;

impl EstimatorKind {
    /// Refuses a scene that it does not serve.
    ///
    /// # Errors
    /// Why it cannot serve this scene, and which estimator can.
    pub fn check(&self, scene: &Scene) -> Result<()> {
        self.serves.check(self.kind, scene)
    }

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
    T::deserialize(options).map_err(|error| Error::input(format!("estimator options: {error}")))
}

/// The default of options that are on unless they are switched off.
pub(super) fn on() -> bool {
    true
}

/// The default of counts.
pub(super) fn one() -> usize {
    1
}
