//! The trait of estimators, the one open trait.

use super::{GuideSlice, Scores, TransportClass};
use crate::sampling::stream::PassKey;

/// Turns random numbers into scores.
pub trait Estimator: Send + Sync {
    /// Does lengthy work that all passes share, such as training the guides of walks. Called once before the first pass;
    /// efficiency ratios include its CPU time.
    fn prepare(&self) {}

    /// Runs one independent realisation of every observable for these bands and adds it to the
    /// zeroed scores.
    fn pass(&self, bands: &[usize], key: &PassKey, scores: &mut Scores);

    /// Runs several passes, each with the scores of [`Estimator::pass`], to the last bit: keys and scores one for each.
    fn passes(&self, bands: &[usize], keys: &[PassKey], scores: &mut [Scores]) {
        keys.iter().zip(scores).for_each(|(key, scores)| self.pass(bands, key, scores));
    }

    /// How many passes of these bands are to run together, at least 1: as many as cost less so than one by one. Asked for after
    /// [`Estimator::prepare`].
    fn passes_at_once(&self, _bands: &[usize]) -> u64 {
        1
    }

    /// Whether one call traces each band alone or all of them on shared paths.
    fn band_use(&self) -> BandUse {
        BandUse::EachAlone
    }

    /// The relation of the mean of the scores to the integral.
    fn bias(&self) -> Bias {
        Bias::Unbiased
    }

    /// The model whose integral this estimates; none if it is light transport itself. Estimators of one
    /// integral have to agree; between different integrals there is a model error, which is measured and is
    /// not a failure.
    fn model(&self) -> Option<String> {
        None
    }

    /// Bands and classes that are known beforehand to have a mean that is far from normal for any affordable
    /// number of passes.
    fn heavy_tails(&self) -> Vec<HeavyTail> {
        Vec::new()
    }

    /// Memory that it holds for all passes, beside the scene, bytes.
    fn held_bytes(&self) -> usize {
        0
    }

    /// Memory that a pass takes for itself, bytes.
    fn working_bytes(&self) -> usize {
        0
    }

    /// The guide of its walks, band by band, for pictures; empty if walks are not guided.
    fn guides(&self) -> Vec<Option<GuideSlice>> {
        Vec::new()
    }

    /// Notes for the reader of its results, such as transport that it cannot sample.
    fn notes(&self) -> Vec<String> {
        Vec::new()
    }
}

/// How an estimator treats bands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BandUse {
    /// Every band has its own passes, streams and cost.
    EachAlone,
    /// One pass scores all bands and has one cost.
    Shared,
}

/// Scores whose sample mean has no valid interval.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HeavyTail {
    /// Index of the band.
    pub band: usize,
    /// The transport class; the total over all classes is affected too.
    pub class: TransportClass,
    /// Why, for the report.
    pub reason: String,
}

/// How the mean of an estimator's scores is related to the integral.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Bias {
    /// Equal to the integral for any number of passes.
    Unbiased,
    /// Something that tends to the integral as passes grow.
    Consistent,
    /// Something else, for this reason.
    Biased(String),
}
