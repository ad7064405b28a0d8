//! Lower confidence bounds that need no moment beyond the mean, for data whose tail is not resolved.
//!
//! Let x_1 .. x_n be independent and never negative, all with the mean m. For any r > 0 and 0 < l < 1
//! the product of the n factors 1 + l (x_i / r - 1) is never negative, and its expectation is
//! (1 + l (m / r - 1))^n, at most 1 where m <= r. So is that of the average M(r) of such products over
//! several l, and by Markov's inequality P(M(r) >= 1/a) <= a where m <= r. M falls in r: with the bound
//! b = sup { r : M(r) >= 1/a }, b > m means M(m) >= 1/a, which has probability at most a. No variance is
//! assumed, no limit theorem, and no cut is chosen: one large x_i enters a product as one factor, whose
//! logarithm is what a cut at about r / l would leave of it. (I. Waudby-Smith, A. Ramdas, "Estimating
//! means of bounded random variables by betting", Journal of the Royal Statistical Society B 86 (2024);
//! the products need no upper bound of x_i on this side.)
//!
//! *Of a variance.* The variance of a block of passes is an unbiased estimate of V, never negative, and
//! blocks are independent: their bound is one of V, whatever the tail of the scores. Where V is
//! infinite, every bound holds.
//!
//! *Of an efficiency.* E = V_A c_A / (V_B c_B), baseline A over candidate B, where only the tail of A is
//! not resolved. The bound of V_A at level a/2 times the lower end of the Student interval of
//! c_A / (V_B c_B) at a/2 (`stats::efficiency`, which keeps the correlation of the two) is below E with
//! probability at least 1 - a, whatever the dependence between the two (Bonferroni).

use super::efficiency::{Efficiency, JackknifeBlock, Values};
use super::hypothesis::Estimate;
use super::tails::{bisect, critical_value};
use super::tree::Merge;
use crate::math::{exp, ln, ln_1p};

/// The shares l: the best one falls with the relative spread of the values; of seven, the average costs
/// at most ln 7 in the exponent.
const SHARES: [f64; 7] = [0.8, 0.4, 0.2, 0.1, 0.05, 0.025, 0.0125];

/// What the common mean of independent values is at least, but for a probability of `level`; nothing
/// where a value is negative or not finite. The number of values must not depend on them.
pub(crate) fn mean_at_least(values: &[f64], level: f64) -> Option<f64> {
    let is_good = |x: &f64| x.is_finite() && *x >= 0.0;
    if values.is_empty() || !values.iter().all(is_good) {
        return None;
    }
    // ln M(r) >= ln (1/a), by its largest term.
    let is_exceeded = |r: f64| {
        let product = |l: &f64| values.iter().map(|x| ln_1p(l * (x / r - 1.0))).sum::<f64>();
        let logs = SHARES.map(|l| product(&l));
        let largest = logs.iter().fold(f64::NEG_INFINITY, |most, log| most.max(*log));
        let average = logs.iter().map(|log| exp(log - largest)).sum::<f64>() / SHARES.len() as f64;
        largest + ln(average) >= -ln(level)
    };
    // M(mean) <= 1: the arithmetic mean of the factors is 1 there, and their geometric mean is less.
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let least = 1e-12 * mean;
    if mean == 0.0 || !is_exceeded(least) {
        return Some(0.0);
    }
    // `bisect` gives the upper end of what it cannot tell apart.
    Some(bisect(is_exceeded, least, mean) * (1.0 - 1e-13))
}

/// What the variance of a pass is at least, but for a probability of `level`. Blocks of one pass are
/// taken in pairs.
pub(crate) fn variance_at_least(blocks: &[JackknifeBlock], values: Values, level: f64) -> Option<f64> {
    let has_single = values == Values::Scores && blocks.iter().any(|block| block.moments.n < 2);
    let width = if has_single { 2 } else { 1 };
    let joined = blocks.chunks_exact(width).map(|chunk| {
        let moments = chunk.iter().map(|block| block.moments).reduce(Merge::merge);
        moments.map_or(f64::NAN, |moments| values.variance(&moments))
    });
    mean_at_least(&joined.collect::<Vec<_>>(), level)
}

impl Efficiency {
    /// What the ratio is at least, with `confidence`, where only the tail of arm A is not resolved;
    /// nothing where that of B is not. `a` are the blocks of arm A.
    pub(crate) fn at_least(
        &self,
        a: &[JackknifeBlock],
        values: Values,
        machine: &Estimate,
        confidence: f64,
    ) -> Option<f64> {
        let level = 0.5 * (1.0 - confidence);
        let rest = self.rest.with_control(machine).log;
        let rest = rest.value - critical_value(2.0 * level, rest.dof) * rest.std_error;
        let variance = variance_at_least(a, values, level)?;
        Some(variance * exp(rest)).filter(|bound| *bound > 0.0 && self.b_is_resolved)
    }
}

#[cfg(test)]
mod tests {
    use super::super::calibration::NamedRng;
    use super::super::efficiency::compare;
    use super::super::moments::Moments;
    use super::*;

    // Two values 0 and 1, level 1/2, and the product by hand: with share l, (1 - l) (1 + l (1/r - 1)).
    // At r = 0.1 the seven are 1.64, 2.76, 2.24, 1.71, 1.3775, 1.194375, 1.09859375: mean 1.7172; the
    // bound is where the mean is 2. It is linear in 1/r, with the means 0.66832589 of (1 - l)^2 and
    // 0.10488839 of (1 - l) l: r = 0.10488839 / (2 - 0.66832589).
    #[test]
    fn a_bound_by_hand() {
        let found = mean_at_least(&[0.0, 1.0], 0.5).expect("a bound");
        assert!((found / 0.0787643105 - 1.0).abs() < 1e-8, "{found}");
        assert_eq!(mean_at_least(&[0.0; 8], 0.5), Some(0.0));
        assert_eq!(mean_at_least(&[1.0, -1e-9], 0.5), None);
        assert_eq!(mean_at_least(&[1.0, f64::NAN], 0.5), None);
        // 64 equal values c: the share 0.8 alone gives 64 ln(1 + 0.8 (c/r - 1)) = ln 40 + ln 7, so that
        // c/r = 1.1151 and r = 2.690; the other shares add a little.
        let equal = mean_at_least(&[3.0; 64], 0.025).expect("a bound");
        assert!(equal > 2.690 && equal < 2.70, "{equal}");
    }

    /// How often the bound of the variance of Pareto scores with tail index `index` is above the truth,
    /// at level 0.025, over 64 blocks of 32 passes, and the median of the bound over the truth.
    fn pareto(index: f64, runs: usize) -> (usize, f64) {
        let mut draws = NamedRng::of(&format!("variance of Pareto {index}"));
        let truth = index / ((index - 1.0) * (index - 1.0) * (index - 2.0));
        let mut bounds: Vec<f64> = (0..runs)
            .map(|_| {
                let block = |d: &mut NamedRng| JackknifeBlock {
                    moments: d.moments(32, |d| (1.0 - d.uniform()).powf(-1.0 / index)),
                    cost: 1.0,
                };
                let blocks: Vec<JackknifeBlock> = (0..64).map(|_| block(&mut draws)).collect();
                variance_at_least(&blocks, Values::Scores, 0.025).expect("a bound") / truth
            })
            .collect();
        bounds.sort_by(f64::total_cmp);
        (bounds.iter().filter(|bound| **bound > 1.0).count(), bounds[runs / 2])
    }

    // Of 1000 bounds at level 0.025, 41 or more lie above the truth with probability 1.7e-3 if each does
    // with 0.025. The variance is finite, its estimate has none (index 2.2, 3) or one (5). The bounds are
    // worth something: the sample variance itself, at index 2.2, has a median of 0.4.
    #[test]
    fn bounds_of_heavy_tails_hold() {
        for (index, worth) in [(2.2, 0.15), (3.0, 0.4), (5.0, 0.6)] {
            let (above, median) = pareto(index, 1000);
            println!("Pareto {index}: {above} of 1000 above, median {median:.3} of the truth");
            assert!(above <= 40 && median > worth && median < 1.0, "{index}: {above} {median}");
        }
    }

    // The whole bound, of 97.5 %: a Pareto baseline, exponential scores of the candidate, costs of both
    // random and in part common to both.
    #[test]
    fn bounds_of_efficiencies_hold() {
        let mut draws = NamedRng::of("efficiency of a Pareto baseline");
        // V = 3 / 4 for index 3, 1 for the exponential; the baseline costs twice as much.
        let (truth, mut above, mut all) = (2.0 * 0.75, 0, vec![]);
        let quiet = Estimate::known(0.0, 0.0);
        for _ in 0..500 {
            let mut arms = [vec![], vec![]];
            for _ in 0..64 {
                let common = 0.2 * draws.normal();
                for (arm, cost) in [(0, 2.0), (1, 1.0)] {
                    let moments = draws.moments(32, |d| match arm {
                        0 => (1.0 - d.uniform()).powf(-1.0 / 3.0),
                        _ => d.exponential(),
                    });
                    let cost = 32.0 * cost * (common + 0.1 * draws.normal()).exp();
                    arms[arm].push(JackknifeBlock { moments, cost });
                }
            }
            let found = compare(&arms[0], &arms[1], Values::Scores).expect("a ratio");
            let bound = found.at_least(&arms[0], Values::Scores, &quiet, 0.975).unwrap_or(0.0);
            above += u32::from(bound > truth);
            all.push(bound / truth);
        }
        all.sort_by(f64::total_cmp);
        println!("{above} of 500 above, median {:.3} of the truth", all[250]);
        assert!(above <= 24 && all[250] > 0.3, "{above} {}", all[250]);
    }

    // Blocks of one pass have no variance; their pairs do.
    #[test]
    fn single_passes_are_paired() {
        let block = |x: f64| JackknifeBlock { moments: Moments::of(x), cost: 1.0 };
        let singles: Vec<JackknifeBlock> = (0..64).map(|i| block(f64::from(i % 2))).collect();
        // Every pair has the variance 1/2.
        let found = variance_at_least(&singles, Values::Scores, 0.025);
        assert_eq!(found, mean_at_least(&[0.5; 32], 0.025));
    }
}
