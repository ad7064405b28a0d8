//! One test a rule: the rendered message with its place.

use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::load::load_text;
use super::{Experiment, LoadOptions, Registry};
use crate::error::Error;
use crate::estimators::{EstimatorKind, Serves};
use crate::samplers;

/// Options of an estimator that only these tests register.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[allow(dead_code)]
struct StubOptions {
    /// Largest number of bounces.
    #[serde(default)]
    #[schemars(range(min = 1))]
    max_bounces: Option<u32>,
    /// Sampling strategy.
    #[serde(default)]
    strategy: Option<StubStrategy>,
}

#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[allow(dead_code)]
enum StubStrategy {
    /// All of them.
    All,
    /// None of them.
    None,
}

/// The registry of the tests: `path` and `snee`.
pub(crate) fn registry() -> Registry {
    let entry = |kind, doc| {
        let options_schema = || schemars::schema_for!(StubOptions);
        let build = |_: &_, _| Err(crate::error::Error::input("never built"));
        EstimatorKind { kind, doc, serves: Serves::ALL, options_schema, build }
    };
    let estimators = vec![entry("path", "Path tracing."), entry("snee", "Specular connections.")];
    Registry { estimators, samplers: samplers::KINDS.to_vec() }
}

/// The parts of a good experiment; every test replaces one.
pub(crate) const GOOD: &str = r#"name = "good"
seed = 1
bands = { rgb = {} }
object.shape.sphere = { radius_mm = 1.0 }
object.boundary.smooth = { eta = 1.3 }
object.medium.coefficients = { sigma_t_per_mm = 10, albedo = [0.9, 0.8, 0.7], g = 0 }
sensor.probe = { point_mm = [0, 0, 3], toward = [0, 0, -1] }
budget.passes = 16
[[light]]
directional = { toward = [1, 1, 1], irradiance = 1.0 }
[[estimator]]
name = "mis"
path = {}
"#;

pub(crate) fn try_load(text: &str, sets: &[&str]) -> Result<Experiment, Error> {
    let sets = sets.iter().map(|s| s.to_string()).collect();
    load_text(Path::new("x.toml"), text, &LoadOptions { sets, setting: None }, &registry())
}

pub(crate) fn good(text: &str) -> Experiment {
    try_load(text, &[]).unwrap_or_else(|error| panic!("{error}"))
}

/// The good experiment with `old` replaced, its errors rendered.
fn refused(old: &str, new: &str) -> String {
    assert!(GOOD.contains(old), "the good experiment has no `{old}`");
    errors(&GOOD.replace(old, new))
}

/// The good experiment with `more` after it, its errors rendered.
fn refused_with(more: &str) -> String {
    errors(&format!("{GOOD}{more}"))
}

fn errors(text: &str) -> String {
    match try_load(text, &[]) {
        Ok(_) => panic!("accepted:\n{text}"),
        Err(error) => error.to_string(),
    }
}

/// A message of one finding: rule, place and help.
fn holds(message: &str, rule: &str, place: &str, help: &str) {
    for part in [&format!("error: {rule}\n"), &format!("x.toml:{place}\n"), help] {
        assert!(message.contains(part), "no `{part}` in:\n{message}");
    }
    assert!(!message.contains("2 errors"), "more than one finding:\n{message}");
}

#[test]
fn a_good_file_is_accepted() {
    let experiment = good(GOOD);
    assert_eq!((experiment.cells.len(), experiment.cells[0].label.as_str()), (1, "base"));
}

mod cells;
mod claims;
mod objects;
mod pictures;
mod robust;
mod units;
mod walk;
