//! Efficiency along the axes of a sweep: a line for each of the other axes' labels, with the 95 %
//! intervals.

use std::collections::BTreeMap;

use super::section::{Content, PlotFigure, Section, band_name, joined, shown_bands};
use crate::report::document::slug;
use crate::report::plot::{COLOURS, Plot, PlotAxis, PlotPoint, Series, Size, Style};
use crate::report::summary;
use crate::results::record::CostMeasure;
use crate::results::store::Stored;
use crate::verify::comparisons::EfficiencyRow;

/// Most lines of one plot: each has its own colour.
const MOST_LINES: usize = COLOURS.len();
/// Fewest numbers that make a numeric axis.
const FEWEST: usize = 3;

/// A plot for each axis, pair of estimators and band.
pub(super) fn section(stored: &Stored, rows: &[EfficiencyRow]) -> Section {
    let axes = axes(stored);
    let mut drawn = Vec::new();
    for cost in [CostMeasure::Cpu, CostMeasure::Counters] {
        let chosen = summary::chosen(stored, rows, cost);
        for axis in &axes {
            for values in places(stored, axis) {
                let word = if values.what == *axis {
                    String::new()
                } else {
                    format!("-{}", slug(&values.what))
                };
                let name = format!("efficiency-{}-{}{word}", words(cost).1, slug(axis));
                drawn.extend(of_axis(stored, &chosen, &values, (axis, cost), &name));
            }
        }
    }
    Section {
        heading: "Efficiency along the sweep".into(),
        text: "A over B: variance of a pass times its cost, of B over that of A; above 1, A is the better. Bars and \
               shaded areas are 95 % intervals; hollow points are not resolved (more passes may move them)."
            .into(),
        drawn,
        are_small: true,
    }
}

/// The name of a measure of cost, and its part of a file name.
fn words(cost: CostMeasure) -> (&'static str, &'static str) {
    match cost {
        CostMeasure::Cpu => ("CPU time", "cpu"),
        CostMeasure::Counters => ("counted work", "counters"),
    }
}

/// Axes with more than one label, in the order of the cells' names.
fn axes(stored: &Stored) -> Vec<String> {
    let cells = &stored.record.cells;
    let names =
        cells.first().map(|cell| cell.axes.keys().cloned().collect::<Vec<_>>()).unwrap_or_default();
    let varies = |axis: &String| cells.iter().any(|cell| cell.axes.get(axis) != cells[0].axes.get(axis));
    names.into_iter().filter(varies).collect()
}

/// Places of the labels of an axis in a plot.
struct Places {
    /// Label of the axis.
    what: String,
    /// Label -> position on the axis.
    at: BTreeMap<String, f64>,
    /// Names of the places 0, 1, ... of an axis of categories.
    names: Vec<String>,
}

/// The labels of an axis: as numbers where all labels have one (`0.2`, or `albedo-0.5`, grouped by
/// word); else as categories in the order of the cells.
fn places(stored: &Stored, axis: &str) -> Vec<Places> {
    let mut labels: Vec<&String> = Vec::new();
    for cell in &stored.record.cells {
        let label = cell.axes.get(axis);
        labels.extend(label.filter(|label| !labels.contains(label)));
    }
    let mut words: Vec<(String, BTreeMap<String, f64>)> = Vec::new();
    for label in &labels {
        let Some((word, number)) = number(label) else { continue };
        match words.iter_mut().find(|(known, _)| *known == word) {
            Some((_, at)) => drop(at.insert(label.to_string(), number)),
            None => words.push((word, BTreeMap::from([(label.to_string(), number)]))),
        }
    }
    let is_numeric = words.iter().map(|(_, at)| at.len()).sum::<usize>() == labels.len();
    if is_numeric && words.iter().all(|(_, at)| at.len() >= FEWEST) {
        let what = |word: String| if word.is_empty() { axis.to_string() } else { word };
        return words
            .into_iter()
            .map(|(word, at)| Places { what: what(word), at, names: vec![] })
            .collect();
    }
    let at = labels.iter().enumerate().map(|(place, label)| (label.to_string(), place as f64)).collect();
    vec![Places { what: axis.into(), at, names: labels.into_iter().cloned().collect() }]
}

/// `0.2` -> ("", 0.2); `albedo-0.5` -> ("albedo", 0.5).
fn number(label: &str) -> Option<(String, f64)> {
    let (word, digits) = match label.rsplit_once('-') {
        Some((word, digits)) if !word.is_empty() && !word.ends_with('e') => (word, digits),
        _ => ("", label),
    };
    let value: f64 = digits.parse().ok()?;
    value.is_finite().then(|| (word.to_string(), value))
}

fn of_axis(
    stored: &Stored,
    rows: &[&EfficiencyRow],
    places: &Places,
    (axis, cost): (&str, CostMeasure),
    name: &str,
) -> Vec<PlotFigure> {
    let mut pairs: Vec<(&str, &str)> =
        rows.iter().map(|row| (&*row.candidate, &*row.baseline)).collect();
    pairs.sort_unstable();
    pairs.dedup();
    let mut drawn = Vec::new();
    for (candidate, baseline) in pairs {
        for band in shown_bands(stored) {
            let own = |row: &&&EfficiencyRow| {
                (&*row.candidate, &*row.baseline) == (candidate, baseline)
                    && row.band == stored.record.bands[band].name
                    && row.quoted().is_some()
            };
            let rows: Vec<&EfficiencyRow> = rows.iter().filter(own).copied().collect();
            let lines = lines(stored, &rows, axis, places);
            if lines.iter().all(|line| line.points.len() < 2) {
                continue;
            }
            let values: Vec<f64> = places.at.values().copied().collect();
            let wide = values.iter().all(|x| *x > 0.0)
                && values.iter().fold(0.0, |a: f64, b| a.max(*b))
                    > 5.0 * values.iter().fold(f64::MAX, |a, b| a.min(*b));
            let x = PlotAxis {
                is_log: wide && places.names.is_empty(),
                names: places.names.clone(),
                ..PlotAxis::linear(&places.what)
            };
            let dropped = lines.len().saturating_sub(MOST_LINES);
            let mut caption =
                format!("By {}, variance of {}.", words(cost).0, summary::metric_words(rows[0]));
            if dropped > 0 {
                caption += &format!(" {dropped} lines more are in comparisons.csv.");
            }
            let plot = Plot {
                x,
                y: PlotAxis::log(format!("efficiency, {candidate} over {baseline}")),
                series: lines.into_iter().take(MOST_LINES).collect(),
                levels: vec![(1.0, "equal".into())],
                size: Size::Small,
            };
            drawn.push(PlotFigure {
                name: slug(&joined(&[name, candidate, band_name(stored, band)])).replace("--", "-"),
                title: joined(&[&format!("{candidate} over {baseline}"), band_name(stored, band)]),
                caption,
                content: Content::Plots(vec![plot]),
            });
        }
    }
    drawn
}

/// A line for the labels of the other axes.
fn lines(stored: &Stored, rows: &[&EfficiencyRow], axis: &str, places: &Places) -> Vec<Series> {
    let style = if places.names.is_empty() { Style::Line } else { Style::Marks };
    let mut lines: Vec<Series> = Vec::new();
    for row in rows {
        let Some(cell) = stored.record.cells.iter().find(|cell| cell.label == row.cell) else {
            continue;
        };
        let Some(place) = cell.axes.get(axis).and_then(|label| places.at.get(label)) else { continue };
        let others = cell.axes.iter().filter(|(name, _)| *name != axis).map(|(_, label)| label.as_str());
        let name = joined(&others.collect::<Vec<_>>());
        let Some([ratio, low, high]) = row.quoted() else { continue };
        let mut point = PlotPoint::new(*place, ratio, [low, high]);
        point.is_firm = row.resolved;
        match lines.iter_mut().find(|line| line.name == name) {
            Some(line) => line.points.push(point),
            None => lines.push(Series { name, points: vec![point], style }),
        }
    }
    // Marks of several lines in one category are placed side by side.
    let count = lines.len() as f64;
    for (number, line) in lines.iter_mut().enumerate() {
        line.points.sort_by(|a, b| a.x.total_cmp(&b.x));
        let aside =
            if style == Style::Marks { 0.12 * (number as f64 - 0.5 * (count - 1.0)) } else { 0.0 };
        line.points.iter_mut().for_each(|point| point.x += aside.clamp(-0.4, 0.4));
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::sample;
    use crate::verify::comparisons::comparisons;

    #[test]
    fn labels_are_numbers_where_they_can_be() {
        assert_eq!(number("0.2"), Some((String::new(), 0.2)));
        assert_eq!(number("1e-3"), Some((String::new(), 1e-3)));
        assert_eq!(number("rough-0.04"), Some(("rough".into(), 0.04)));
        assert_eq!((number("smooth"), number("rough-x"), number("-")), (None, None, None));
    }

    /// Three cells of an axis of numbers give a line of three points.
    #[test]
    fn a_sweep_gives_lines() {
        let mut stored = sample::stored(0.1);
        for (place, label) in ["0.04", "0.2", "0.5"].into_iter().enumerate() {
            let mut cell = stored.record.cells[0].clone();
            cell.label = label.into();
            cell.axes = BTreeMap::from([("alpha".into(), label.into())]);
            if place == 0 {
                stored.record.cells.clear();
            }
            stored.record.cells.push(cell);
        }
        let section = section(&stored, &comparisons(&stored));
        // By counted work alone, as no time was measured; for two bands.
        let names: Vec<&str> = section.drawn.iter().map(|drawn| drawn.name.as_str()).collect();
        assert_eq!(names, ["efficiency-counters-alpha-snee-r", "efficiency-counters-alpha-snee-g"]);
        let Content::Plots(plots) = &section.drawn[0].content else { panic!("plots") };
        assert_eq!(
            (plots[0].series.len(), plots[0].x.label.as_str(), plots[0].x.is_log),
            (1, "alpha", true)
        );
        assert_eq!(plots[0].series[0].points.iter().map(|p| p.x).collect::<Vec<_>>(), [0.04, 0.2, 0.5]);
        stored.record.cells.truncate(1);
        assert!(super::section(&stored, &comparisons(&stored)).drawn.is_empty(), "one point is no line");
    }
}
