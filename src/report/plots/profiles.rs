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
        let absolute = bands.iter().map(|band| of_band(stored, (index, cell), *band, &edges));
        let ratios =
            bands.iter().filter_map(|band| over_transport(stored, (index, cell), *band, &edges));
        absolute.chain(ratios).collect::<Vec<_>>()
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
            let mean = ring_mean(stored, (index, run), band, ring)?;
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
        joined(&[&cell.title(), band_name(stored, band)]),
        "A ring whose mean is not above 0 has no point.".into(),
        Plot::small(x, y, runs(cell).map(line).collect()),
    )
}

/// The mean of a ring.
fn ring_mean(
    stored: &Stored,
    (cell, run): (usize, &EstimatorRun),
    band: usize,
    ring: usize,
) -> Option<Estimate> {
    let observable = Observable { name: format!("ring_{ring}"), class: "all".into() };
    let quantity = Quantity { cell, estimator: run.estimator.clone(), observable, band };
    Some(Estimate::of_batches(&stored.batches(&quantity)?))
}

/// Every model over the first estimator of light transport; nothing where there is not one of each.
fn over_transport(
    stored: &Stored,
    (index, cell): (usize, &Cell),
    band: usize,
    edges: &[f64],
) -> Option<PlotFigure> {
    let transport = runs(cell).find(|run| run.model.is_none())?;
    let line = |run: &EstimatorRun| {
        let point = |ring: usize| {
            let [model, truth] = [run, transport].map(|run| ring_mean(stored, (index, run), band, ring));
            let (model, truth) = (model?, truth?);
            let value = model.value / truth.value;
            // By the delta method, as model errors have it.
            let square = |of: &Estimate| (of.std_error / of.value) * (of.std_error / of.value);
            let std_error = value * (square(&model) + square(&truth)).sqrt();
            let ratio = Estimate { value, std_error, dof: model.dof.min(truth.dof) };
            let is_known = truth.value > 0.0 && model.value > 0.0;
            is_known.then(|| PlotPoint::of(0.5 * (edges[ring] + edges[ring + 1]), &ratio))
        };
        Series::new(&run.estimator, Style::Line, (0..edges.len() - 1).filter_map(point).collect())
    };
    let models: Vec<Series> = runs(cell).filter(|run| run.model.is_some()).map(line).collect();
    if models.is_empty() {
        return None;
    }
    let y = PlotAxis::log(format!("model over {}", transport.estimator));
    let mut plot = Plot::small(PlotAxis::log("distance / mm"), y, models);
    plot.levels = vec![(1.0, transport.estimator.clone())];
    Some(PlotFigure::of(
        format!("profile-ratio-{index:03}-{}", band + 1),
        joined(&[&cell.title(), band_name(stored, band), "model over transport"]),
        format!("Each model over `{}`, with the errors of both sides.", transport.estimator),
        plot,
    ))
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
        // Against light transport: two more, with one line.
        let mut modelled = stored.clone();
        modelled.record.cells[0].runs[1].model = Some("dipole".into());
        let section = super::section(&modelled);
        assert_eq!(section.drawn.len(), 4);
        let Content::Plots(ratios) = &section.drawn[2].content else { panic!("plots") };
        assert_eq!((ratios[0].series.len(), ratios[0].y.label.as_str()), (1, "model over mis"));
        assert!(ratios[0].series[0].points.iter().all(|p| (p.y - 1.0).abs() < 0.1 && p.low < p.y));
        // Both rings of the sample have a mean of 1.
        let areas = [PI, 8.0 * PI];
        assert!(points.iter().zip(areas).all(|(p, area)| (p.y * area - 1.0).abs() < 0.1), "{points:?}");
    }
}
