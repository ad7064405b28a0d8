//! An axis of the sweep, its points, and the columns of their rows.

use std::collections::BTreeMap;

use super::document::Node;
use crate::error::Place;

/// One axis of the sweep.
#[derive(Clone, Debug)]
pub struct SweepAxis {
    /// Name of the axis.
    pub name: String,
    /// Its points in order.
    pub points: Vec<AxisPoint>,
}

/// One point of an axis.
#[derive(Clone, Debug)]
pub struct AxisPoint {
    /// Label of the point on its axis.
    pub label: String,
    /// Place in the file.
    pub place: Place,
    /// The dotted keys that it sets, and the values.
    pub sets: Vec<(String, Node)>,
    /// The columns of its row.
    pub columns: BTreeMap<String, RowField>,
    /// The line of its CSV file, counted from 1.
    pub csv_line: Option<usize>,
}

/// One field of a row.
#[derive(Clone, Debug)]
pub struct RowField {
    /// The value as text.
    pub text: String,
    /// Place in the file.
    pub place: Place,
}
