//! Measurements that tests of several estimators share.

use super::{Estimator, Layout, Scores};
use crate::sampling::stream::StreamKey;

/// Mean and standard error of every observable over passes on streams of the test's name, and the scores
/// with their anomalies.
pub(super) fn measure(
    estimator: &dyn Estimator,
    layout: &Layout,
    passes: u64,
    test: &str,
) -> (Vec<(f64, f64)>, Scores) {
    let mut scores = Scores::new(layout.clone());
    let key = StreamKey::named(test);
    let mut moments = vec![(0.0, 0.0); scores.observables.len()];
    for pass in 0..passes {
        scores.clear();
        estimator.pass(&[0], &key.pass(pass), &mut scores);
        // Welford's update: a variance of 0 comes out as 0.
        for ((mean, m2), x) in moments.iter_mut().zip(&scores.observables) {
            let before = x - *mean;
            *mean += before / (pass + 1) as f64;
            *m2 += before * (x - *mean);
        }
    }
    let n = passes as f64;
    let estimate = |(mean, m2): (f64, f64)| (mean, (m2 / (n * (n - 1.0).max(1.0))).sqrt());
    (moments.into_iter().map(estimate).collect(), scores)
}
