//! The pictures of one cell, to be compared: one PNG an estimator for a reader without scripts, and what the page's
//! viewer needs beside.

use super::document::FigureBlock;

/// The pictures of one cell.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Viewer {
    /// The cell's label; empty without a sweep.
    pub cell: String,
    /// One tone-mapped PNG an estimator.
    pub figures: Vec<FigureBlock>,
}
