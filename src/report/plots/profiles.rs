//! Exitance by the distance between entry and exit: the rings of a sensor.

use std::f64::consts::PI;

use super::section::{PlotFigure, Section, band_name, joined, runs, shown_bands};
use crate::report::plot::{Plot, PlotAxis, PlotPoint, Series, Style};
use crate::results::record::{Cell, EstimatorRun, Observable, Quantity};
use crate::results::store::Stored;
use crate::stats::hypothesis::Estimate;

/// A plot for each cell and band, where the sensor has rings.
pub(super) fn section(stored: &Stored) -> Section {
    let edges: Vec<f64> = stored.record.resolved["sensor"]["rings"]["edges_mm"]
        .as_array()
        .map(|edges| edges.iter().filter_map(|edge| edge.as_f64()).collect())
        .unwrap_or_default();
    let cells = stored.record.cells.iter().enumerate();
    let bands = shown_bands(stored);
    let of_cell = |(index, cell): (usize, &Cell)| {
        let plots = bands.iter().map(|band| of_band(stored, (index, cell), *band, &edges));
        plots.collect::<Vec<_>>()
    };
    Section {
        heading: "Radial profiles".into(),
        text: "Radial profile: light that leaves in a ring around the point where it came in, over the ring's \
               area, at the middle of the ring, with its 95 % interval."
            .into(),
        drawn: match edges.len() {
            0 | 1 => Vec::new(),
            _ => cells.flat_map(of_cell).collect(),
        },
        are_small: true,
    }
}

fn of_band(stored: &Stored, (index, cell): (usize, &Cell), band: usize, edges: &[f64]) -> PlotFigure {
    let line = |run: &EstimatorRun| {
        let point = |ring: usize| {
            let observable = Observable { name: format!("ring_{ring}"), class: "all".into() };
            let quantity = Quantity { cell: index, estimator: run.estimator.clone(), observable, band };
            let mean = Estimate::of_batches(&stored.batches(&quantity)?);
            let [from, to] = [edges[ring], edges[ring + 1]];
            let area = PI * (to - from) * (to + from);
            let (value, std_error) = (mean.value / area, mean.std_error / area);
            Some(PlotPoint::of(0.5 * (from + to), &Estimate { value, std_error, ..mean }))
        };
        let points: Vec<PlotPoint> =
            (0..edges.len() - 1).filter_map(point).filter(|p| p.y > 0.0).collect();
        Series::new(&run.estimator, Style::Line, points)
    };
    let (x, y) = (PlotAxis::log("distance / mm"), PlotAxis::log("exitance / area, W/mm^4"));
    PlotFigure::of(
        format!("profile-{index:03}-{}", band + 1),
        joined(&[&cell.label, band_name(stored, band)]),
        "A ring whose mean is not above 0 has no point.".into(),
        Plot::small(x, y, runs(cell).map(line).collect()),
    )
}

#[cfg(test)]
mod tests {
    use super::super::section::Content;
    use super::*;
    use crate::results::sample;

    #[test]
    fn rings_make_a_profile() {
        let mut stored = sample::stored(0.1);
        assert!(section(&stored).drawn.is_empty());
        stored.record.resolved["sensor"] = serde_json::json!({"rings": {"edges_mm": [0.0, 1.0, 3.0]}});
        for run in &mut stored.record.cells[0].runs {
            for (ring, observable) in run.observables.iter_mut().enumerate() {
                *observable = Observable { name: format!("ring_{ring}"), class: "all".into() };
            }
        }
        let section = section(&stored);
        assert_eq!(section.drawn.len(), 2, "a plot a band");
        let Content::Plots(plots) = &section.drawn[0].content else { panic!("plots") };
        let points = &plots[0].series[0].points;
        assert_eq!(points.iter().map(|p| p.x).collect::<Vec<_>>(), [0.5, 2.0]);
        assert!(points.iter().all(|p| p.low < p.y && p.y < p.high && p.low > 0.0));
        // Both rings of the sample have a mean of 1.
        let areas = [PI, 8.0 * PI];
        assert!(points.iter().zip(areas).all(|(p, area)| (p.y * area - 1.0).abs() < 0.1), "{points:?}");
    }
}
