//! Ratios of positive estimates, on a logarithmic scale.

use super::hypothesis::critical_value;
use crate::math;

/// A ratio's logarithm and its standard error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LogRatio {
    /// Natural logarithm of the ratio.
    pub log: f64,
    /// Its standard error.
    pub std_error: f64,
    /// Degrees of freedom of the error.
    pub dof: f64,
}

impl LogRatio {
    /// Of two independent estimates, each with the error of its logarithm.
    pub fn of(numerator: (f64, f64), denominator: (f64, f64), dof: f64) -> LogRatio {
        let (ea, eb) = (numerator.1, denominator.1);
        let log = math::ln(numerator.0 / denominator.0);
        LogRatio { log, std_error: (ea * ea + eb * eb).sqrt(), dof }
    }

    /// The ratio.
    pub fn ratio(&self) -> f64 {
        math::exp(self.log)
    }

    /// The interval that Student's t gives the ratio, missing it with probability `level`.
    pub fn interval(&self, level: f64) -> [f64; 2] {
        let half = critical_value(level, self.dof) * self.std_error;
        [math::exp(self.log - half), math::exp(self.log + half)]
    }
}

/// The delete-one jackknife's standard error of a positive estimate's logarithm: from the estimates
/// that leave one block out each, se^2 = (n - 1) / n sum (log - mean log)^2. Infinite for fewer than two.
pub fn jackknife_log_error(without_one: &[f64]) -> f64 {
    if without_one.len() < 2 {
        return f64::INFINITY;
    }
    let n = without_one.len() as f64;
    let logs: Vec<f64> = without_one.iter().map(|x| math::ln(*x)).collect();
    let mean = logs.iter().sum::<f64>() / n;
    ((n - 1.0) / n * logs.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>()).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    // For a plain mean the jackknife is the standard error; for its logarithm that over the mean.
    #[test]
    fn the_jackknife_of_a_mean() {
        let data: Vec<f64> = (0..40).map(|i| 100.0 + f64::from(i * 7 % 11)).collect();
        let n = data.len() as f64;
        let sum: f64 = data.iter().sum();
        let squares: f64 = data.iter().map(|x| (x - sum / n) * (x - sum / n)).sum();
        let expected = (squares / (n * (n - 1.0))).sqrt() / (sum / n);
        let without: Vec<f64> = data.iter().map(|x| (sum - x) / (n - 1.0)).collect();
        assert!((jackknife_log_error(&without) / expected - 1.0).abs() < 1e-3);
        assert_eq!(jackknife_log_error(&[1.0]), f64::INFINITY);
    }

    // scipy: t.isf(0.025, 7) = 2.364624251592785.
    #[test]
    fn intervals() {
        let ratio = LogRatio::of((6.0, 0.03), (2.0, 0.04), 7.0);
        assert!((ratio.ratio() - 3.0).abs() < 1e-12 && (ratio.std_error - 0.05).abs() < 1e-15);
        let [low, high] = ratio.interval(0.05);
        assert!((high / 3.0 - (0.05f64 * 2.364624251592785).exp()).abs() < 1e-9);
        assert!((low * high - 9.0).abs() < 1e-9);
    }
}
