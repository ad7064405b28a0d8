//! Cost of counted work: fixed weights, so that efficiencies by counters are the same numbers on
//! every machine; and how well CPU time follows them.

use crate::results::record::EstimatorRun;
use crate::results::store::Stored;

/// Weights of the counters, in nanoseconds on the machine that they were measured on; only their ratios
/// matter. From a regression of CPU time on counters over the nine cells at three albedos (rounded),
/// which this prints:
///
/// ```text
/// cargo test --release --test integration -- --ignored --nocapture weights_are_those_of_path_tracing
/// ```
///
/// Accuracy: a fit predicted the least CPU times of those 27 runs of `path` to 28 %, of 24 of them to 17 %; a rough boundary
/// under a sky costs more than they predict, because light samples below the horizon are not counted.
/// Between kinds of estimators they may be off by the factors of [`crate::results::counted_work`].
/// They predict together; one by one they mean little, because in a path tracer rays are paths, medium
/// events and boundary events together: of the fits that are equally good this one charges the rays.
/// They are those of the unit sphere: a ray costs more in a mesh of many triangles. The last five are
/// what a point of a cloud costs, what a query of 1e4 to 1e6 points costs for each that it looks at, and
/// what a classical dipole costs a band, as
///
/// ```text
/// cargo bench -p benches --bench point_cloud
/// ```
///
/// prints them.
pub const WEIGHTS: [(&str, f64); 10] = [
    ("paths", 210.0),
    ("rays", 31.0),
    ("shadow_rays", 280.0),
    ("medium_events", 0.0),
    ("boundary_events", 0.0),
    ("cloud_points", 500.0),
    ("cloud_nodes", 30.0),
    ("cloud_candidates", 30.0),
    ("cloud_scanned", 4.0),
    ("bssrdf_evaluations", 40.0),
];

/// CPU time may drift by this much from the weights before they must be measured again.
pub const DRIFT_LIMIT: f64 = 0.1;

/// The weighted cost of every batch of a run.
///
/// # Errors
/// As a sentence: the record holds no counts by batch, or one that has no weight.
pub fn counted(stored: &Stored, run: &EstimatorRun) -> Result<Vec<f64>, String> {
    let weights: Vec<f64> = run.cost.keys().map(|name| weight(name).unwrap_or(f64::NAN)).collect();
    let unknown = run.cost.iter().find(|(name, count)| weight(name).is_none() && **count > 0);
    if let Some((name, _)) = unknown {
        return Err(format!("{} counts `{name}`, which has no weight", run.estimator));
    }
    let rows = batches(stored, run)
        .ok_or_else(|| format!("{} has no counts of work by batch", run.estimator))?;
    let cost = |row: &[f64]| {
        row.iter().zip(&weights).filter(|(n, _)| **n > 0.0).map(|(n, weight)| n * weight).sum()
    };
    Ok(rows.map(cost).collect())
}

/// One counter of every batch of a run.
pub fn counter(stored: &Stored, run: &EstimatorRun, name: &str) -> Option<Vec<f64>> {
    let index = run.cost.keys().position(|known| known == name)?;
    Some(batches(stored, run)?.map(|row| row[index]).collect())
}

fn batches<'a>(stored: &'a Stored, run: &EstimatorRun) -> Option<std::slice::ChunksExact<'a, f64>> {
    let array = stored.arrays.get(&run.costs)?;
    let fits = array.shape.len() == 2 && array.shape[1] == run.cost.len() && array.shape[1] > 0;
    fits.then(|| array.data.chunks_exact(array.shape[1]))
}

fn weight(name: &str) -> Option<f64> {
    WEIGHTS.iter().find(|(known, _)| *known == name).map(|(_, weight)| *weight)
}

/// Counts of one run in the order of [`WEIGHTS`], and what it took, CPU nanoseconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimedRun {
    /// Counts of the run, in the order of [`WEIGHTS`].
    pub counts: [f64; WEIGHTS.len()],
    /// CPU time of the run, ns.
    pub nanoseconds: f64,
}

/// The counts and times of all runs of a record that were timed whole.
pub fn timed(stored: &Stored) -> Vec<TimedRun> {
    let runs = stored.record.cells.iter().flat_map(|cell| cell.runs.iter().map(move |run| (cell, run)));
    let of = |(cell, run): (&crate::results::record::Cell, &EstimatorRun)| {
        let cost = stored.timing.as_ref()?.of(&cell.label, &run.estimator)?;
        let counts = WEIGHTS.map(|(name, _)| run.cost.get(name).copied().unwrap_or(0) as f64);
        let is_whole = cost.passes == run.passes && cost.cpu_seconds > 0.0;
        is_whole.then_some(TimedRun { counts, nanoseconds: 1e9 * cost.cpu_seconds })
    };
    runs.filter_map(of).collect()
}

/// The non-negative weights that predict the times best: least squares of relative errors. Weights that
/// come out negative are set to 0, the most negative first, and the others fitted again.
pub fn fit(runs: &[TimedRun]) -> [f64; WEIGHTS.len()] {
    let mut free: Vec<usize> =
        (0..WEIGHTS.len()).filter(|&k| runs.iter().any(|r| r.counts[k] > 0.0)).collect();
    loop {
        let weights = least_squares(runs, &free);
        let worst = (0..free.len()).min_by(|&a, &b| weights[a].total_cmp(&weights[b]));
        match worst {
            Some(k) if weights[k] < 0.0 => drop(free.remove(k)),
            _ => {
                let mut all = [0.0; WEIGHTS.len()];
                free.iter().zip(weights).for_each(|(&k, weight)| all[k] = weight);
                return all;
            }
        }
    }
}

/// Solves the normal equations of sum (sum_k w_k n_k / t - 1)^2 over the counters `free`; the diagonal
/// is raised by 1e-9 of itself, because counters may depend on each other.
fn least_squares(runs: &[TimedRun], free: &[usize]) -> Vec<f64> {
    let x = |run: &TimedRun, k: usize| run.counts[free[k]] / run.nanoseconds;
    let size = free.len();
    let sum = |f: &dyn Fn(&TimedRun) -> f64| runs.iter().map(f).sum::<f64>();
    let mut rows: Vec<Vec<f64>> = (0..size)
        .map(|i| {
            let products = (0..size)
                .map(|j| sum(&|run| x(run, i) * x(run, j)) * if i == j { 1.0 + 1e-9 } else { 1.0 });
            products.chain([sum(&|run| x(run, i))]).collect()
        })
        .collect();
    // Gauss-Jordan; the matrix is positive definite, so no pivot is sought.
    for i in 0..size {
        let pivot = rows[i].clone();
        for (_, row) in rows.iter_mut().enumerate().filter(|(j, _)| *j != i) {
            let factor = row[i] / pivot[i];
            row.iter_mut().zip(&pivot).for_each(|(a, b)| *a -= factor * b);
        }
    }
    (0..size).map(|i| rows[i][size] / rows[i][i]).collect()
}

/// How far the predictions of [`WEIGHTS`] are from those of weights fitted to these runs: the largest
/// relative deviation over the runs from the common factor between them (another machine's speed).
/// Nothing for fewer runs than counters.
pub fn drift(runs: &[TimedRun]) -> Option<f64> {
    let counted = (0..WEIGHTS.len()).filter(|&k| runs.iter().any(|run| run.counts[k] > 0.0)).count();
    if runs.is_empty() || runs.len() < counted {
        return None;
    }
    let fitted = fit(runs);
    let predicted = |run: &TimedRun, weights: &dyn Fn(usize) -> f64| -> f64 {
        (0..WEIGHTS.len()).map(|k| weights(k) * run.counts[k]).sum()
    };
    let ratio = |run: &TimedRun| predicted(run, &|k| fitted[k]) / predicted(run, &|k| WEIGHTS[k].1);
    let mut ratios: Vec<f64> = runs.iter().map(ratio).collect();
    ratios.sort_by(f64::total_cmp);
    let middle = ratios[ratios.len() / 2];
    ratios.iter().map(|r| (r / middle - 1.0).abs()).reduce(f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::sample;

    const N: usize = WEIGHTS.len();

    /// Runs of all mixtures of two amounts of work, at `speed` and with weights that are off by
    /// `factors`.
    fn runs(speed: f64, factors: [f64; N]) -> Vec<TimedRun> {
        let counts = |i: usize| std::array::from_fn(|k| if (i >> k) & 1 == 1 { 9e6 } else { 1e6 });
        let time = |counts: [f64; N]| -> f64 {
            (0..N).map(|k| factors[k] * WEIGHTS[k].1 * counts[k]).sum::<f64>() * speed
        };
        (0..1 << N).map(counts).map(|counts| TimedRun { counts, nanoseconds: time(counts) }).collect()
    }

    #[test]
    fn weights_come_out_again_on_any_machine() {
        let fitted = fit(&runs(3.0, [1.0; N]));
        for (fitted, (name, weight)) in fitted.iter().zip(WEIGHTS) {
            assert!((fitted - 3.0 * weight).abs() < 1e-4, "{name}: {fitted}");
        }
        assert!(drift(&runs(3.0, [1.0; N])).expect("a drift") < 1e-6);
        assert!(drift(&runs(1.0, [1.0; N])[..4]).is_none());
    }

    #[test]
    fn a_drift_is_seen() {
        let drift =
            drift(&runs(1.0, std::array::from_fn(|k| if k == 2 { 3.0 } else { 1.0 }))).expect("a drift");
        assert!(drift > DRIFT_LIMIT, "{drift}");
    }

    #[test]
    fn negative_weights_are_not_fitted() {
        let mut runs = runs(1.0, [1.0; N]);
        // Time falls with the paths.
        runs.iter_mut().for_each(|run| run.nanoseconds -= 15.0 * run.counts[0].min(2e6));
        assert!(fit(&runs).iter().all(|w| *w >= 0.0), "{:?}", fit(&runs));
    }

    #[test]
    fn batches_are_weighed() {
        let mut stored = sample::stored(0.1);
        let run = stored.record.cells[0].runs[0].clone();
        let rays = WEIGHTS[1].1;
        assert_eq!(counted(&stored, &run), Ok(vec![16.0 * rays; 64]));
        assert_eq!(counter(&stored, &run, "rays"), Some(vec![16.0; 64]));
        stored.record.cells[0].runs[0].cost.insert("solves".into(), 3);
        let run = stored.record.cells[0].runs[0].clone();
        assert!(counted(&stored, &run).is_err_and(|why| why.contains("`solves`")));
    }
}
