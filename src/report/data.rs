//! Input of the views of a record.

use super::document::{FigureBlock, ViewerBlock};
use super::plots::Section;
use super::split::SplitFigure;
use crate::results::measurements::Measurement;
use crate::results::provenance::Provenance;
use crate::results::store::Stored;
use crate::verify::comparisons::EfficiencyRow;
use crate::verify::model_errors::ModelError;
use crate::verify::verdict::Verdict;

/// What a crash between record and timing leaves.
pub(super) const FOREIGN_TIMING: &str =
    "The file timing.json is of another record and was left out; run the experiment again to time it";

/// Everything that a report is made from.
pub(crate) struct ReportData {
    /// The record, with its timing where it was measured.
    pub stored: Stored,
    /// Build and machine, where they were noted.
    pub provenance: Option<Provenance>,
    /// The verdicts on its claims.
    pub verdicts: Vec<Verdict>,
    /// The mean of every observable.
    pub rows: Vec<Measurement>,
    /// Efficiencies of pairs of estimators.
    pub comparisons: Vec<EfficiencyRow>,
    /// Errors of models against light transport.
    pub model_errors: Vec<ModelError>,
    /// The pictures by cell, in viewers that compare them.
    pub viewers: Vec<ViewerBlock>,
    /// The split picture at the head of the page, where there are pictures.
    pub lead: Option<FigureBlock>,
    /// Grids of split pictures.
    pub splits: Vec<SplitFigure>,
    /// Pictures band by band.
    pub strips: Vec<FigureBlock>,
    /// Sections of plots, in the report's order.
    pub plots: Vec<Section>,
}
