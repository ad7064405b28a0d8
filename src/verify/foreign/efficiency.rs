//! Variance times seconds of images of other renderers, over that of a record.

use super::images::Planes;
use super::pixels::BandImages;
use crate::math::ln;
use crate::results::image::Picture;
use crate::results::record::{Cell, EstimatorRun, Observable};
use crate::results::store::Stored;
use crate::stats::efficiency::{LogRatio, jackknife_log_error};
use crate::stats::hypothesis::Estimate;
use crate::stats::moments::Moments;
use crate::stats::tree::Merge;

/// Fewer seeds than this give no variance.
const MIN_SEEDS: usize = 4;

/// Confidence of the interval.
const CONFIDENCE: f64 = 0.95;

/// An interval wider than this factor either way decides nothing.
const WIDEST: f64 = 2.0;

/// One pixel's share of the spread above which a single sample dominates the variance.
const SHARE: f64 = 0.05;

/// The ratio of costs at equal error: how much longer the other renderer takes.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Ratio {
    /// Band name.
    pub band: String,
    /// (variance of a pixel's mean x seconds) of the images over that of the record, pixels averaged.
    pub ratio: f64,
    /// Its 95 % interval.
    pub interval: [f64; 2],
    /// Why it is not resolved.
    pub unresolved: Option<String>,
}

/// The ratio in every band, for a run of a cell. `seconds` are CPU seconds of all the images, and of the
/// record's run.
///
/// log V of the images is the pooled variance of their pixels, its error by a jackknife over seeds; of
/// the record's, that of its pixels, its error by a jackknife over batches of the sum of its tiles'
/// variances, which is the same sum of pixels. Seconds are taken as exact. t has K - 1 degrees of
/// freedom.
pub(crate) fn ratios(
    stored: &Stored,
    cell: usize,
    run: &EstimatorRun,
    planes: &Planes,
    seconds: [f64; 2],
) -> Vec<Ratio> {
    let Some(picture) = Picture::of(stored, run) else { return vec![] };
    let cell = &stored.record.cells[cell];
    let bands = stored.record.bands.iter().enumerate();
    bands
        .map(|(index, about)| {
            let band = BandImages::of(planes, &picture, index, run.passes);
            let pixels: Vec<usize> = (0..band.ours.len()).collect();
            let seeds = band.theirs.len();
            let theirs: f64 = pixels.iter().map(|&i| band.variance(i)).sum();
            let ours: f64 = band.ours_error.iter().map(|e| e * e).sum();
            let theirs = (theirs * seconds[0], seeds_error(&band, &pixels));
            let ours = (ours * seconds[1], batches_error(stored, cell, run, index));
            let log = Estimate {
                value: ln(theirs.0 / ours.0),
                std_error: (theirs.1 * theirs.1 + ours.1 * ours.1).sqrt(),
                dof: (seeds as f64 - 1.0).max(1.0),
            };
            let found = LogRatio { log };
            let interval: [f64; 2] = found.interval(CONFIDENCE).into();
            let share = band.largest_share(&pixels);
            let unresolved = if seeds < MIN_SEEDS {
                Some(format!("{seeds} seeds; at least {MIN_SEEDS} are needed"))
            } else if !(log.value.is_finite() && log.std_error.is_finite()) {
                Some("a side has zero variance".into())
            } else if share > SHARE + 10.0 / pixels.len() as f64 {
                Some(format!("one pixel holds {:.0} % of the images' spread", 100.0 * share))
            } else if interval[1] > WIDEST * found.ratio() {
                Some(format!("the interval is wider than a factor of {WIDEST} either way"))
            } else {
                None
            };
            Ratio { band: about.name.clone(), ratio: found.ratio(), interval, unresolved }
        })
        .collect()
}

/// The error of the logarithm of the pixels' pooled variance, by leaving out a seed at a time.
fn seeds_error(band: &BandImages, pixels: &[usize]) -> f64 {
    if band.theirs.len() < 3 {
        return f64::INFINITY;
    }
    let without = |out: usize| {
        let left = band.theirs.iter().enumerate().filter(|(k, _)| *k != out);
        let left: Vec<&[f64]> = left.map(|(_, seed)| *seed).collect();
        let part = BandImages { theirs: left, ours: vec![], ours_error: vec![], ..*band };
        pixels.iter().map(|&i| part.squares(i)).sum::<f64>() / (part.seeds() - 1.0)
    };
    jackknife_log_error(&(0..band.theirs.len()).map(without).collect::<Vec<_>>())
}

/// The same of the record, by leaving out a batch at a time. A tile's factor, pixels squared, is nearly
/// the same for all and left out.
fn batches_error(stored: &Stored, cell: &Cell, run: &EstimatorRun, band: usize) -> f64 {
    let is_tile = |o: &Observable| cell.region_of(o).is_some_and(|region| region.tile.is_some());
    let tiles = run.observables.iter().enumerate().filter(|(_, o)| is_tile(o));
    let tiles: Vec<Vec<Moments>> = tiles.filter_map(|(o, _)| stored.moments(run, o, band)).collect();
    let batches = tiles.first().map_or(0, Vec::len);
    let without = |out: usize| {
        let variance = |tile: &Vec<Moments>| {
            let left = tile.iter().enumerate().filter(|(b, _)| *b != out).map(|(_, m)| *m);
            left.reduce(Merge::merge).map_or(f64::NAN, |m| m.variance())
        };
        tiles.iter().map(variance).sum::<f64>()
    };
    jackknife_log_error(&(0..batches).map(without).collect::<Vec<_>>())
}
