//! The trait of estimators, the one open trait.

use super::{GuideSlice, Scores, TransportClass};
use crate::sampling::stream::PassKey;

/// Turns random numbers into scores.
pub trait Estimator: Send + Sync {
    /// Makes what all passes need and takes longer than a moment, such as what walks learn from a warm-up. Called once before
    /// the first pass; ratios of efficiency count its CPU time.
    fn prepare(&self) {}

    /// Runs one independent realisation of every observable for these bands and adds it to the
    /// zeroed scores.
    fn pass(&self, bands: &[usize], key: &PassKey, scores: &mut Scores);

    /// Whether one call traces each band alone or all of them on shared paths.
    fn band_use(&self) -> BandUse {
        BandUse::EachAlone
    }

    /// What the mean of the scores converges to.
    fn bias(&self) -> Bias {
        Bias::Unbiased
    }

    /// The model whose integral this estimates; none where it is light transport itself. Estimators of
    /// one integral have to agree; between different ones lies a model error, which is measured and no
    /// failure.
    fn model(&self) -> Option<String> {
        None
    }

    /// Bands and classes in which the mean of any affordable number of passes is far from normal, known
    /// beforehand.
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

    /// What guides its walks, band by band, for pictures; empty where nothing does.
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
