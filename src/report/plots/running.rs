//! Running means: one plot per cell of the mean against the number of passes, with the 95 % interval of
//! each estimator and the expected value of a claim. A valid interval covers the expected value for 19
//! of 20 estimators. With too heavy a tail the interval is narrow and lies beside it.

use super::section::{PlotFigure, Section, joined, mean_of};
use crate::report::plot::{Plot, PlotAxis, PlotPoint, Series, Size, Style};
use crate::results::pictures::{Running, Wanted};
use crate::results::record::{Against, Cell, EstimatorRun, Observable, Quantity};
use crate::results::store::Stored;
use crate::stats::moments::Moments;
use crate::stats::tails::critical_value;
use crate::stats::tree::Merge;

/// Confidence of the bands.
const CONFIDENCE: f64 = 0.95;

/// A plot for each cell and each requested picture.
pub(super) fn section(stored: &Stored, wanted: &[Wanted]) -> Section {
    let running = wanted.iter().filter_map(|wanted| match wanted {
        Wanted::Running(running) => Some(running),
        Wanted::Split(_) | Wanted::Strip(_) => None,
    });
    let mut drawn = Vec::new();
    for (number, running) in running.enumerate() {
        for (index, cell) in stored.record.cells.iter().enumerate() {
            let Some((plot, title)) = plot(stored, index, cell, running) else { continue };
            let name = format!("running-{}-{index:03}", number + 1);
            drawn.push(PlotFigure::of(name, title, CAPTION.into(), plot));
        }
    }
    Section { heading: "Means as passes add up".into(), text: String::new(), drawn, are_small: false }
}

const CAPTION: &str = "Mean over the first passes with the 95 % interval from their own variance; dashed: the \
                       value that is expected.";

fn plot(stored: &Stored, index: usize, cell: &Cell, running: &Running) -> Option<(Plot, String)> {
    let band = stored.record.bands.iter().position(|band| band.name == running.band)?;
    let is_shown = |run: &&EstimatorRun| {
        let is_named = running.estimators.as_ref().is_none_or(|names| names.contains(&run.estimator));
        is_named && run.control_of.is_none()
    };
    let runs: Vec<&EstimatorRun> = cell.runs.iter().filter(is_shown).collect();
    let first = runs.first()?.observables.first()?.name.clone();
    let observable =
        Observable { name: running.observable.clone().unwrap_or(first), class: running.class.clone() };
    let series: Vec<Series> = runs
        .iter()
        .filter_map(|run| {
            let estimator = run.estimator.clone();
            let quantity = Quantity { cell: index, estimator, observable: observable.clone(), band };
            let points = means(&stored.batches(&quantity)?);
            Some(Series::new(&run.estimator, Style::Line, points))
        })
        .collect();
    let expected = stored.record.comparisons.iter().find_map(|comparison| {
        let Quantity { cell, observable: of, band: own, .. } = &comparison.quantity;
        match comparison.against {
            Against::Value { value, .. } if (*cell, of, *own) == (index, &observable, band) => {
                Some(value)
            }
            _ => None,
        }
    });
    let levels: Vec<(f64, String)> =
        expected.map(|value| (value, "expected".into())).into_iter().collect();
    let range = Some(range(&series, expected)?);
    let title = joined(&[&cell.title(), &observable.name, &observable.class, &running.band]);
    let plot = Plot {
        x: PlotAxis::log("passes"),
        y: PlotAxis { range, ..PlotAxis::linear(mean_of(&observable.name)) },
        series,
        levels,
        size: Size::Wide,
    };
    Some((plot, title))
}

/// Mean and interval after each batch, except the first few, which have no interval.
fn means(batches: &[Moments]) -> Vec<PlotPoint> {
    let mut all = Moments::default();
    let mut points = Vec::new();
    for batch in batches {
        all = all.merge(*batch);
        if all.n < 8 {
            continue;
        }
        let reach = critical_value(1.0 - CONFIDENCE, all.n as f64 - 1.0) * all.std_error();
        points.push(PlotPoint::new(all.n as f64, all.mean, [all.mean - reach, all.mean + reach]));
    }
    points
}

/// The range of the vertical axis: the last three quarters of every line with its band, and the
/// expected value.
fn range(series: &[Series], expected: Option<f64>) -> Option<[f64; 2]> {
    let late = series.iter().flat_map(|series| &series.points[series.points.len() / 4..]);
    let heights = late.flat_map(|p| [p.low, p.high]).chain(expected).filter(|y| y.is_finite());
    let [low, high] = heights.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], y| [a.min(y), b.max(y)]);
    let margin = 0.05 * (high - low);
    (low < high).then_some([low - margin, high + margin])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::sample;

    #[test]
    fn means_and_intervals_are_those_of_the_first_passes() {
        let batches: Vec<Moments> = [[1.0, 3.0], [2.0, 2.0], [5.0, 1.0], [2.0, 4.0], [3.0, 3.0]]
            .iter()
            .map(|pair| pair.iter().fold(Moments::default(), |all, x| all.merge(Moments::of(*x))))
            .collect();
        let points = means(&batches);
        assert_eq!(points.iter().map(|p| p.x).collect::<Vec<_>>(), [8.0, 10.0]);
        assert!((points[0].y - 2.5).abs() < 1e-15 && (points[1].y - 2.6).abs() < 1e-15);
        // s^2 = (2.25 + .25 + .25 + .25 + 6.25 + 2.25 + .25 + 2.25) / 7 = 2, t(7) = 2.3646.
        assert!((points[0].high - 2.5 - 2.364_624 * (2.0f64 / 8.0).sqrt()).abs() < 1e-5);
    }

    #[test]
    fn a_plot_has_its_estimators_and_the_expected_value() {
        let stored = sample::stored(0.1);
        let cell = &stored.record.cells[0];
        let (run, observable) = (&cell.runs[0], &cell.runs[0].observables[0]);
        let wanted = Running {
            estimators: Some(vec![run.estimator.clone()]),
            observable: Some(observable.name.clone()),
            class: observable.class.clone(),
            band: stored.record.bands[0].name.clone(),
        };
        let (plot, _) = plot(&stored, 0, cell, &wanted).expect("a plot");
        assert_eq!(plot.series.len(), 1);
        assert!(!plot.series[0].points.is_empty());
        let unknown = Running { band: "ultraviolet".into(), ..wanted };
        assert!(super::plot(&stored, 0, cell, &unknown).is_none());
    }
}
