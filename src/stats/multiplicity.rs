//! Many tests under one error rate.

/// Holm's adjusted p-values: rejecting those below `level` keeps the probability of any false
/// rejection below `level`, whatever the dependence between the tests.
///
/// With p sorted upwards, adjusted(i) = max over j <= i of min(1, (m - j) p(j)), j counted from 0.
/// S. Holm, "A simple sequentially rejective multiple test procedure" (1979). A p-value that is no
/// number counts as a test and stays no number.
pub(crate) fn holm(p: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p.len()).collect();
    order.sort_by(|&a, &b| p[a].total_cmp(&p[b]));
    let mut adjusted = vec![0.0; p.len()];
    let mut largest: f64 = 0.0;
    for (rank, &i) in order.iter().enumerate() {
        largest = largest.max((p[i] * (p.len() - rank) as f64).min(1.0));
        adjusted[i] = if p[i].is_nan() { p[i] } else { largest };
    }
    adjusted
}

#[cfg(test)]
mod tests {
    use super::*;

    // By hand: 4 * 0.01, max(that, 3 * 0.02), max(that, 2 * 0.03), max(that, 0.5).
    #[test]
    fn small_example() {
        assert_eq!(holm(&[0.5, 0.01, 0.03, 0.02]), [0.5, 0.04, 0.06, 0.06]);
        assert_eq!(holm(&[0.7, 0.9]), [1.0, 1.0]);
        assert!(holm(&[]).is_empty());
    }

    #[test]
    fn a_p_value_that_is_no_number_never_passes() {
        let adjusted = holm(&[0.01, f64::NAN, 0.5]);
        assert!((adjusted[0] - 0.03).abs() < 1e-15 && adjusted[1].is_nan() && adjusted[2] == 1.0);
    }
}
