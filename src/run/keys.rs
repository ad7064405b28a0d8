//! Names of random streams: which data are hashed into their keys, and which are not.

use serde_json::{Value, json};

use crate::results::json::{canonical, hash_bytes};
use crate::sampling::stream::StreamKey;

/// Version of what enters a key; raising it changes the random numbers of every experiment.
pub(crate) const KEY_VERSION: u32 = 1;

/// Stage that a sequence of passes belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stage {
    /// The short run that turns a budget into passes.
    Pilot,
    /// Passes of the run.
    Main,
    /// The second look at what failed in the first.
    Retest,
}

impl Stage {
    /// Name in keys and records.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Stage::Pilot => "pilot",
            Stage::Main => "main",
            Stage::Retest => "retest",
        }
    }
}

/// Everything that names a sequence of passes. Intentionally absent: claims, budget, threads, block
/// size, the order of a sweep, an estimator's options (so that options can be compared on one stream).
#[derive(Clone, Debug)]
pub(crate) struct StreamName<'a> {
    /// Name of the experiment.
    pub experiment: &'a str,
    /// Its seed, where it has one.
    pub seed: Option<u64>,
    /// Text that a fresh look adds to the key.
    pub fresh: Option<&'a str>,
    /// The cell's physics in canonical form, without the keys that the experiment pairs over.
    pub content: &'a Value,
    /// Names of the bands that the passes score.
    pub bands: &'a [&'a str],
    /// Name of the estimator.
    pub estimator: &'a str,
    /// Stage that the streams belong to.
    pub stage: Stage,
}

impl StreamName<'_> {
    /// The key of this sequence.
    pub(crate) fn key(&self) -> StreamKey {
        let mut name = json!({
            "version": KEY_VERSION,
            "experiment": self.experiment,
            "seed": self.seed,
            "content": self.content,
            "bands": self.bands,
            "estimator": self.estimator,
            "stage": self.stage.name(),
        });
        if let Some(fresh) = self.fresh {
            name["fresh"] = json!(fresh);
        }
        StreamKey::new(hash_bytes(canonical(&name).as_bytes()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::stream::Purpose;

    fn first(name: &StreamName) -> f64 {
        name.key().pass(0).stream(0, Purpose::Walk).draw()
    }

    /// Every part of the name changes the stream; equal names give equal streams.
    #[test]
    fn each_part_of_the_name_enters() {
        let (a, b) = (json!({"radius_mm": 1.0}), json!({"radius_mm": 2.0}));
        let base = StreamName {
            experiment: "x",
            seed: Some(1),
            fresh: None,
            content: &a,
            bands: &["R"],
            estimator: "mis",
            stage: Stage::Main,
        };
        let variants = [
            StreamName { experiment: "y", ..base.clone() },
            StreamName { seed: Some(2), ..base.clone() },
            StreamName { seed: None, ..base.clone() },
            StreamName { fresh: Some("monday"), ..base.clone() },
            StreamName { content: &b, ..base.clone() },
            StreamName { bands: &["G"], ..base.clone() },
            StreamName { bands: &["R", "G"], ..base.clone() },
            StreamName { estimator: "snee", ..base.clone() },
            StreamName { stage: Stage::Pilot, ..base.clone() },
            StreamName { stage: Stage::Retest, ..base.clone() },
        ];
        assert_eq!(first(&base), first(&base.clone()));
        for variant in variants {
            assert_ne!(first(&base), first(&variant), "{variant:?}");
        }
    }
}
