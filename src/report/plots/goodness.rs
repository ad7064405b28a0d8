//! The chi-square test as pictures: observed and expected shares of a sampler's bins, and residuals.

use super::section::{Content, PlotFigure, Section};
use crate::report::plot::{Plot, PlotAxis, PlotPoint, Series, Size, Style};
use crate::results::sampler::SamplerRun;
use crate::results::store::Stored;

/// One picture per sampler.
pub(super) fn section(stored: &Stored) -> Section {
    let runs = stored.record.samplers.iter().enumerate();
    Section {
        heading: "Observed, expected, residual".into(),
        text: "Coarse bins in the order of their partition, discrete outcomes last. Above: draws counted \
               (points) and expected (line), per draw. Below: (observed - expected) / sqrt(expected), near \
               normal where the sampler draws from its density; the chi-square statistic is the sum of their \
               squares."
            .into(),
        drawn: runs.filter_map(|(index, run)| of_sampler(stored, index, run)).collect(),
        are_small: true,
    }
}

fn of_sampler(stored: &Stored, index: usize, run: &SamplerRun) -> Option<PlotFigure> {
    let bins = stored.bins(&run.coarse)?;
    let samples = run.samples as f64;
    let expected = |mass: f64| mass * samples;
    // Outcomes without mass and without draws are left out.
    let is_there = |(_, observed, mass): &(f64, f64, f64)| *observed > 0.0 || *mass > 0.0;
    let places = || {
        bins.observed
            .iter()
            .zip(bins.mass)
            .enumerate()
            .map(|(i, (o, m))| (i as f64, *o, *m))
            .filter(is_there)
    };
    let share = |(x, observed, _): (f64, f64, f64)| PlotPoint::bare(x, observed / samples);
    let mass = |(x, _, mass): (f64, f64, f64)| PlotPoint::bare(x, mass);
    let possible = || places().filter(|(_, _, mass)| *mass > 0.0);
    let residual = |(x, observed, mass): (f64, f64, f64)| {
        PlotPoint::bare(x, (observed - expected(mass)) / expected(mass).sqrt())
    };
    let residuals: Vec<PlotPoint> = possible().map(residual).collect();
    let largest = residuals.iter().map(|p| p.y.abs()).fold(0.0, f64::max);
    let impossible: f64 =
        places().filter(|(_, _, mass)| *mass <= 0.0).map(|(_, observed, _)| observed).sum();
    let last = bins.observed.len() as f64 - 0.5;
    let x = |label: &str| PlotAxis { range: Some([-0.5, last]), ..PlotAxis::linear(label) };
    let shares = vec![
        Series::new("expected", Style::Line, places().map(mass).collect()),
        Series::new("observed", Style::Marks, places().map(share).collect()),
    ];
    let zero = vec![PlotPoint::bare(-0.5, 0.0), PlotPoint::bare(last, 0.0)];
    // As long a name as above, so that the bins of both plots are aligned.
    let residuals =
        vec![Series::new("", Style::Guide, zero), Series::new("residual", Style::Bars, residuals)];
    let above = Plot::small(x(""), PlotAxis::linear("share"), shares);
    let below =
        Plot { size: Size::Flat, ..Plot::small(x("bin"), PlotAxis::linear("residual"), residuals) };
    let mut caption =
        format!("{} draws, {} bins; largest residual {largest:.2}.", run.samples, bins.observed.len());
    if impossible > 0.0 {
        caption += &format!(" {impossible} draws in bins without mass.");
    }
    Some(PlotFigure {
        name: format!("goodness-{index:03}"),
        title: run.sampler.clone(),
        caption,
        content: Content::Plots(vec![above, below]),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::npy::Array;
    use crate::results::sample;

    /// 100 draws in three bins of masses 0.25, 0.75 and 0, and an outcome that neither can be nor was.
    #[test]
    fn residuals_are_in_standard_deviations_and_the_impossible_is_noted() {
        let mut stored = sample::stored(0.1);
        let run = serde_json::json!({
            "sampler": "coin", "kind": "test", "samples": 100, "coarse": "c", "fine": null, "serial": null,
            "deltas": [],
            "nulls": 0, "null": "never", "outside": 0, "own_density_differs": 0, "own_density_largest": 0.0,
            "total": 1.0, "total_bound": 0.0, "evaluations": 1, "senseless": 0, "senseless_contrasts": 0,
            "exhausted": false, "contrasts": [],
        });
        stored.record.samplers = vec![serde_json::from_value(run).expect("a sampler")];
        let bins = [[30.0, 69.0, 1.0, 0.0], [0.25, 0.75, 0.0, 0.0], [0.0; 4]].concat();
        stored.arrays.insert("c".into(), Array::new(vec![3, 4], bins));
        let section = section(&stored);
        let Content::Plots(plots) = &section.drawn[0].content else { panic!("plots") };
        let values = |plot: usize, series: usize| {
            plots[plot].series[series].points.iter().map(|p| p.y).collect::<Vec<_>>()
        };
        assert_eq!((values(0, 0), values(0, 1)), (vec![0.25, 0.75, 0.0], vec![0.3, 0.69, 0.01]));
        // (30 - 25) / 5 and (69 - 75) / sqrt(75).
        assert_eq!(values(1, 1), [1.0, -6.0 / 75f64.sqrt()]);
        assert!(
            section.drawn[0].caption.contains("largest residual 1.00. 1 draws in bins without mass")
        );
    }
}
