//! The one open trait and the estimators, one file each, named as the literature names them.
//!
//! An estimator is built for one cell and runs passes: it turns a pass's random streams into scores
//! and knows no file, thread or statistic. The runner folds scores into moments, zeros included.

mod bands;
pub mod bssrdf_density;
pub mod bssrdf_probe;
pub mod bssrdf_rays;
mod bssrdf_single;
mod choice;
mod crossing;
mod emergence;
mod history;
mod illumination;
pub mod light_trace;
pub mod path;
pub mod point_cloud;
mod scores;
pub mod snee;
mod walk;

pub use history::{History, TransportClass};
pub use scores::{Anomaly, Cost, Layout, ObservableName, Scores};
pub use walk::Roulette;

use crate::sampling::stream::PassKey;

/// Turns random numbers into scores.
pub trait Estimator: Send + Sync {
    /// Runs one independent realisation of every observable for these bands and adds it to the
    /// zeroed scores.
    fn pass(&self, bands: &[usize], key: &PassKey, scores: &mut Scores);

    /// Whether one call traces each band alone or all of them on shared paths.
    fn band_use(&self) -> BandUse {
        BandUse::EachAlone
    }

    /// What the mean of the scores is.
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

    /// Memory that a pass takes for itself, bytes.
    fn working_bytes(&self) -> usize {
        0
    }

    /// What a reader of its results must know, as a transport that it cannot sample.
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
    /// Band index.
    pub band: usize,
    /// In this class, and in the total.
    pub class: TransportClass,
    /// Why.
    pub reason: String,
}

/// What the mean of an estimator's scores is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Bias {
    /// The integral.
    Unbiased,
    /// Something that tends to the integral as passes grow.
    Consistent,
    /// Something else, for this reason.
    Biased(String),
}

#[cfg(test)]
mod rings_tests;
