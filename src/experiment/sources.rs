//! Where the values of an experiment were written, for findings that show only when it is built.

use super::document::{Node, Value};
use super::overrides::is_within;
use super::sweep::SweepAxis;
use crate::error::Place;

/// The file with its overrides applied, and the rows of its sweep.
#[derive(Clone, Debug)]
pub(crate) struct Sources {
    root: Node,
    axes: Vec<SweepAxis>,
}

impl Sources {
    /// Of a file and its sweep.
    pub(super) fn new(root: Node, axes: Vec<SweepAxis>) -> Sources {
        Sources { root, axes }
    }

    /// Of values that no file states.
    #[cfg(test)]
    pub(crate) fn none() -> Sources {
        let root = super::document::parse("", "").unwrap_or_else(|_| panic!("an empty text is TOML"));
        Sources { root, axes: Vec::new() }
    }

    /// Where the value at a dotted key was written, or what holds it where it has been left out: in the
    /// row that the cell `cell` takes from the sweep, or else in the file.
    pub(crate) fn place(&self, cell: usize, key: &str) -> Option<Place> {
        let swept = self.row(cell).find(|(name, _)| is_within(key, name));
        let (node, depth) = match swept {
            Some((name, value)) => (value, name.split('.').count()),
            None => (&self.root, 0),
        };
        let words = key.split('.').skip(depth);
        let mut found = node;
        for word in words {
            match found.at(&[word]) {
                Some(inner) => found = inner,
                None => break,
            }
        }
        let place = match &found.value {
            Value::Table(_) => found.key.as_ref().unwrap_or(found.place()),
            _ => found.place(),
        };
        (swept.is_some() || !std::ptr::eq(found, &self.root)).then(|| place.clone())
    }

    /// The keys that a cell takes from the sweep, and their values; the last axis is the fastest.
    fn row(&self, cell: usize) -> impl Iterator<Item = &(String, Node)> {
        let mut rest = cell;
        let points = self.axes.iter().rev().filter_map(move |axis| {
            let count = axis.points.len().max(1);
            let point = axis.points.get(rest % count);
            rest /= count;
            point
        });
        points.flat_map(|point| &point.sets)
    }
}
