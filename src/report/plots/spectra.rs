//! Means by wavelength, and the resulting colour.

use super::section::{Content, PlotFigure, Section, mean_of, runs};
use crate::report::plot::{Plot, PlotAxis, PlotPoint, Series, Style};
use crate::results::image::{gain, shown_bytes};
use crate::results::number::with_error;
use crate::results::record::{Band, Cell, EstimatorRun};
use crate::results::store::Stored;
use crate::stats::hypothesis::Estimate;
use crate::stats::moments::Moments;

/// Fewest bands that make a spectrum.
const FEWEST: usize = 4;

/// A plot and a colour for each cell, where the bands have wavelengths.
pub(super) fn section(stored: &Stored) -> Section {
    let bands = &stored.record.bands;
    let is_spectrum = bands.len() >= FEWEST && bands.iter().all(|band| band.range_nm.is_some());
    let cells = stored.record.cells.iter().enumerate();
    Section {
        heading: "Spectra".into(),
        text: "Mean of the sensor's first observable by band, with 95 % intervals, and the colour that it gives: \
               the sum over the bands of mean times display colour (CIE 1931, linear sRGB), shown at the \
               exposure of the pictures."
            .into(),
        drawn: match is_spectrum {
            true => cells.flat_map(|(index, cell)| of_cell(stored, index, cell)).collect(),
            false => Vec::new(),
        },
        are_small: true,
    }
}

fn of_cell(stored: &Stored, index: usize, cell: &Cell) -> [PlotFigure; 2] {
    let means = |run: &EstimatorRun| -> Vec<Estimate> {
        let bands = 0..stored.record.bands.len();
        bands.filter_map(|band| Some(Estimate::of_batches(&stored.moments(run, 0, band)?))).collect()
    };
    let runs: Vec<(&EstimatorRun, Vec<Estimate>)> = runs(cell).map(|run| (run, means(run))).collect();
    let line = |(run, means): &(&EstimatorRun, Vec<Estimate>)| {
        let points = means.iter().zip(&stored.record.bands).map(|(mean, band)| {
            let [from, to] = band.range_nm.unwrap_or_default();
            PlotPoint::of(0.5 * (from + to), mean)
        });
        Series::new(&run.estimator, Style::Line, points.collect())
    };
    let series = runs.iter().map(line).collect();
    let observable = runs.first().and_then(|(run, _)| run.observables.first());
    let y = observable.map_or("mean".into(), |of| mean_of(&of.name));
    let plot = Plot::small(PlotAxis::linear("wavelength / nm"), PlotAxis::linear(y), series);
    let stops = stored.record.resolved["display"]["exposure_stops"].as_f64().unwrap_or(0.0);
    let colours: Vec<(String, [Estimate; 3])> =
        runs.iter().filter_map(|(run, _)| Some((run.estimator.clone(), colour(stored, run)?))).collect();
    let rgb = |(name, rgb): &(String, [Estimate; 3])| {
        let [r, g, b] = rgb.map(|c| with_error(c.value, c.std_error));
        format!("{name}: linear sRGB {r}, {g}, {b}.")
    };
    let caption = colours.iter().map(rgb).collect::<Vec<_>>().join(" ");
    let shown =
        |(name, rgb): (String, [Estimate; 3])| (name, shown_bytes(rgb.map(|c| c.value), gain(stops)));
    let swatches = colours.into_iter().map(shown).collect();
    [
        PlotFigure::of(
            format!("spectrum-{index:03}"),
            cell.title(),
            "Bands at their middle.".into(),
            plot,
        ),
        PlotFigure {
            name: format!("colour-{index:03}"),
            title: cell.title(),
            caption: format!("{caption} Exposure {stops:+} stops."),
            content: Content::Swatches(swatches),
        },
    ]
}

/// Linear sRGB of a run's spectrum. Its error is that of the sums over bands in each batch: bands may
/// share their paths.
fn colour(stored: &Stored, run: &EstimatorRun) -> Option<[Estimate; 3]> {
    let bands = &stored.record.bands;
    let moments: Vec<Vec<Moments>> =
        (0..bands.len()).map(|band| stored.moments(run, 0, band)).collect::<Option<_>>()?;
    let channel = |c: usize| {
        let batch = |batch: usize| {
            let part =
                |(moments, band): (&Vec<Moments>, &Band)| moments[batch].mean * band.display_rgb[c];
            Moments {
                n: moments[0][batch].n,
                mean: moments.iter().zip(bands).map(part).sum(),
                ..Moments::default()
            }
        };
        let batches: Vec<Moments> = (0..moments[0].len()).map(batch).collect();
        Estimate::of_batches(&batches)
    };
    Some([0, 1, 2].map(channel))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::plot::swatches;
    use crate::results::record::Band;
    use crate::results::sample;

    #[test]
    fn a_spectrum_needs_wavelengths() {
        let mut stored = sample::stored(0.1);
        assert!(section(&stored).drawn.is_empty());
        let band = |k: usize| Band {
            name: format!("b{k}"),
            range_nm: Some([400.0 + 50.0 * k as f64, 450.0 + 50.0 * k as f64]),
            display_rgb: [0.1, 0.2, 0.3],
        };
        stored.record.bands = (0..4).map(band).collect();
        // The arrays of the sample have two bands: here each occurs twice.
        for array in
            stored.arrays.values_mut().filter(|array| array.shape.len() == 4 && array.shape[3] == 5)
        {
            let twice = |rows: &[f64]| [rows, rows].concat();
            array.data = array.data.chunks(10).flat_map(twice).collect();
            array.shape[2] = 4;
        }
        let section = section(&stored);
        assert_eq!(section.drawn.len(), 2);
        let Content::Plots(plots) = &section.drawn[0].content else { panic!("plots") };
        assert_eq!(
            plots[0].series[0].points.iter().map(|p| p.x).collect::<Vec<_>>(),
            [425.0, 475.0, 525.0, 575.0]
        );
        let Content::Swatches(colours) = &section.drawn[1].content else { panic!("colours") };
        // Means near 1 in four bands: linear 0.4, 0.8, 1.2 are 170, 231, 255 in sRGB.
        let off = |[r, g, b]: [u8; 3]| [r.abs_diff(170), g.abs_diff(231), b.abs_diff(255)];
        assert!(off(colours[0].1).iter().all(|d| *d <= 1), "{colours:?}");
        assert!(
            section.drawn[1].caption.contains("linear sRGB 0.4")
                && section.drawn[1].caption.contains('(')
        );
        assert!(swatches::to_svg(colours).contains("rgb("));
    }
}
