//! Rules of `[[picture]]`.

use super::At;
use super::claims::{Known, axis, band, estimator};
use crate::experiment::picture::{PictureEntry, SplitEntry};
use crate::experiment::schema::SensorEntry;

/// The rules of one picture.
pub(crate) fn picture(at: At, picture: &PictureEntry, known: &Known) {
    if let Some(words) = &picture.split {
        split(at.to("split"), words, known);
    }
    if let Some(words) = &picture.running {
        let at = at.to("running");
        for (i, name) in words.estimators.iter().flatten().enumerate() {
            estimator(at.to("estimators").item(i), name, known);
        }
        band(at.to("band"), &words.band, known);
    }
    if let Some(words) = &picture.strip {
        estimator(at.to("strip").to("estimator"), &words.estimator, known);
    }
}

fn split(at: At, words: &SplitEntry, known: &Known) {
    estimator(at.to("left"), &words.left, known);
    estimator(at.to("right"), &words.right, known);
    if words.left == words.right {
        at.to("right").report_help(
            format!("`{}` is left and right", words.left),
            "a split picture compares two estimators: name two",
        );
    }
    if let Some(stops) = words.exposure_stops.filter(|stops| stops.is_nan() || stops.abs() > 64.0) {
        at.to("exposure_stops").report(format!("must be between -64 and 64, is {stops}"));
    }
    let Some(axes) = known.axes else { return };
    for (key, name) in [("rows", &words.rows), ("columns", &words.columns)] {
        if let Some(name) = name {
            axis(at.to(key), name, axes);
        }
    }
    if words.rows.is_some() && words.rows == words.columns {
        at.to("columns").report("rows and columns are the same axis");
    }
}

/// Pictures need pixels: `at` is the list of pictures, `sensor` that of a cell.
pub(crate) fn has_pixels(at: At, sensor: &SensorEntry) {
    let kinds = [("split", "a split picture"), ("strip", "a strip of bands")];
    let of = |i: usize| kinds.iter().find(|(key, _)| at.item(i).has(key)).map(|(_, kind)| (i, kind));
    let Some((first, kind)) = (0..at.count()).find_map(of) else { return };
    if !sensor.has_pixels() {
        at.item(first).report_help(
            format!("{kind} needs pixels, and the sensor has none"),
            "take an `orthographic` or a `perspective` sensor in every cell, or drop the picture",
        );
    }
}
