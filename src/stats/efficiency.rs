//! Efficiency at equal cost: the log ratio of two estimators' variance times cost, with an interval from
//! a block jackknife, and the conditions under which such a number means anything.
//!
//! For arms A and B, R = log(V_A c_A) - log(V_B c_B): V is the variance of one pass, pooled over all
//! blocks, c the cost of one pass, sum cost / sum n. At R < 0, A reaches an error at less cost: exp(-R)
//! is its gain.
//!
//! *Why a jackknife.* An F interval for V_A/V_B assumes normal values and covers 23 % (9 %) instead of 95 %
//! on lognormal ones of sigma 1 (1.5); the mean of per-block log variances is biased by the concavity of the logarithm, and
//! differently for two shapes. Leaving out one block at a time and recomputing the pooled ratio measures its
//! spread whatever the shape of the distribution. It also treats V and c together, which are correlated: long
//! paths cost more and vary more.
//!
//! *Unequal blocks* (a partial last one). With n_k of n passes in block k and h_k = n / n_k, the
//! pseudo-value of f is h_k f - (h_k - 1) f(without k), and
//!   J = sum pseudo_k / h_k,   var J = (1/B) sum (pseudo_k - J)^2 / (h_k - 1)
//! (F. Busing, E. Meijer, R. van der Leeden, "Delete-m jackknife for unequal m" (1999)). With equal
//! blocks this is Tukey's (B - 1)/B sum (f(without k) - mean)^2. As R is a difference of a function of
//! A's blocks and one of B's, deleting block k of both arms changes it by the sum of the two changes:
//! with e_k = (pseudo_k - J) / sqrt(B (h_k - 1)) in each arm, the joint variance is sum (e_k(A) -
//! e_k(B))^2, which keeps the covariance of blocks that ran side by side. Arms with different numbers of
//! blocks are independent: their variances add, and Satterthwaite's dof holds.
//!
//! *Variances as values.* Where a pass is an image, V is the variance of a pixel, averaged over the
//! pixels. Of every two consecutive passes x and y, d = (x - y)^2 / 2, averaged over the pixels, is an
//! unbiased estimate of it, and the pairs are independent: V is the mean of d (`Values::Variances`),
//! whatever correlation there is between the pixels of one pass. By itself a pair of passes is a poor
//! estimate, with var(d) / V^2 = (kurtosis + 1) / 2 for one pixel; the mean of n / 2 of them has
//! (kurtosis + 1) / n, where the variance of all n values has (kurtosis - 1) / n: nothing is lost where
//! tails are heavy, and where they are not, the pixels average it out.
//!
//! *What a control adds.* Let ln of the CPU time of arm X in block k be x + d_k + m_X + e_Xk: the cost of X, the
//! effect of the machine on all arms at that time, its effect on this arm alone for the whole run (its place in
//! the order, the contents of the caches), and scatter. In a ratio of interleaved arms d_k cancels, the
//! jackknife over blocks measures e, and nothing measures m_A - m_B, of variance 2 t^2. The control C repeats
//! the work of the baseline at another place: r = ln of its time over that of A estimates m_C - m_A, and the
//! expectation of r^2 is 2 t^2 + the scatter of the control, so that
//!   var(ln E) = s^2 + r^2
//! is not too small on average. A single control may by chance be smaller than t. The k cells of a record have
//! controls of the same machine; r^2 is their mean, or that of the cell where it is larger. r^2 has k degrees
//! of freedom and s^2 those of the jackknife, nu; the sum has (s^2 + r^2)^2 / (s^4 / nu + r^4 / k)
//! (Satterthwaite). Simulated 95 % intervals then have a coverage of at least 94 % for any t where k >= 2. With
//! one cell they have it up to t = s / 2; beyond, where the machine dominates, coverage may be 88 %, and without
//! the control 33 % (`stats::calibration`).
//!
//! The quoted R is not bias-corrected: its bias is of order 1/n, its error of order 1/sqrt(n).

use std::fmt;

use super::hypothesis::{Estimate, Test};
use super::moments::Moments;
use super::tails::critical_value;
use super::tree::Merge;
use crate::math::{exp, ln};

/// The fewest blocks of an arm: below, Student's interval is too wide to be of use.
pub const FEWEST_BLOCKS: usize = 8;

/// The largest share of an arm's sum of squares that one pass may hold.
pub const LARGEST_SHARE: f64 = 0.05;

/// Meaning of a block's values, and so of V.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Values {
    /// Scores of passes: V is their variance.
    Scores,
    /// Unbiased estimates of V: their mean is.
    Variances,
}

impl Values {
    pub(super) fn variance(self, moments: &Moments) -> f64 {
        match self {
            Values::Scores => moments.variance(),
            Values::Variances => moments.mean,
        }
    }

    /// Of a block, the sum of the terms that V is the mean of, and of their squares; `mean` is that of
    /// all scores.
    fn terms(self, moments: &Moments, mean: f64) -> (f64, f64) {
        match self {
            Values::Scores => about(moments, mean),
            Values::Variances => {
                let sum = moments.n as f64 * moments.mean;
                (sum, moments.m2 + sum * moments.mean)
            }
        }
    }
}

/// Passes that ran together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JackknifeBlock {
    /// Moments of the passes' values.
    pub moments: Moments,
    /// Their total cost, in any unit that both arms share: CPU seconds, rays.
    pub cost: f64,
}

/// Why there is no ratio.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoRatio {
    /// Fewer than [`FEWEST_BLOCKS`] blocks in an arm, or an empty block.
    TooFewBlocks,
    /// A moment or a cost is not finite, or a cost is not positive.
    NotFinite,
    /// An arm's passes (perhaps without one block) are all equal: its variance has no logarithm.
    ZeroVariance,
}

impl fmt::Display for NoRatio {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            NoRatio::TooFewBlocks => "an arm has too few blocks, or an empty one",
            NoRatio::NotFinite => "a moment or a cost is not finite, or a cost is not positive",
            NoRatio::ZeroVariance => "an arm has zero variance, at least without one of its blocks",
        })
    }
}

/// A ratio, A over B, by its logarithm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LogRatio {
    /// The logarithm, with its jackknife error and the error's degrees of freedom.
    pub log: Estimate,
}

impl LogRatio {
    /// Estimate of the ratio.
    pub fn ratio(&self) -> f64 {
        exp(self.log.value)
    }

    /// The ratio with the error that controls show of the machine, as [`machine`] has it.
    pub fn with_control(&self, machine: &Estimate) -> LogRatio {
        LogRatio { log: self.log.minus(machine) }
    }

    /// Half the width of the two-sided Student interval of `log`.
    pub fn half_width(&self, confidence: f64) -> f64 {
        critical_value(1.0 - confidence, self.log.dof) * self.log.std_error
    }

    /// The interval of the ratio.
    pub fn interval(&self, confidence: f64) -> (f64, f64) {
        let half_width = self.half_width(confidence);
        (exp(self.log.value - half_width), exp(self.log.value + half_width))
    }

    /// The two-sided test that the true ratio is `ratio`.
    pub fn test(&self, ratio: f64) -> Test {
        self.log.minus(&Estimate::known(ln(ratio), 0.0)).test_zero()
    }
}

/// Summary of one arm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArmSummary {
    /// Moments of all its passes.
    pub moments: Moments,
    /// Cost of a pass.
    pub cost: f64,
    /// Kurtosis of a pass (3 for a normal). The variance of log V is about (kurtosis - 1) / n. NaN for
    /// variances, which have none.
    pub kurtosis: f64,
    /// The largest share of M2 (about the mean of all passes) that one block holds; of variances, of
    /// their sum.
    pub largest_block: f64,
    /// A lower and an upper bound of the largest share of M2 that one pass holds, or of the sum of
    /// variances that one of them is: see [`one_pass_share`].
    pub largest_pass: (f64, f64),
}

/// Two estimators at equal cost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Efficiency {
    /// V_A c_A / (V_B c_B): below 1 where A is the more efficient.
    pub work: LogRatio,
    /// Ratio of the variances, V_A / V_B.
    pub variance: LogRatio,
    /// Ratio of the costs per pass, c_A / c_B.
    pub cost: LogRatio,
    /// Without the variance of A: c_A / (V_B c_B).
    pub rest: LogRatio,
    /// Whether the variance of B alone is resolved at 99.9 %, as [`Efficiency::is_resolved`] asks of the
    /// ratio.
    pub b_is_resolved: bool,
    /// Variance and cost of arm A.
    pub a: ArmSummary,
    /// Variance and cost of arm B.
    pub b: ArmSummary,
    /// Whether the blocks were deleted in pairs.
    pub is_joint: bool,
    /// How far the logarithms moved when the passes doubled.
    pub moved: Moved,
}

/// How far logarithms are, over the first half of the blocks, from those over all of them: when the
/// passes doubled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moved {
    /// That of the ratio of variance times cost.
    pub work: f64,
    /// That of the ratio of the variances.
    pub variance: f64,
}

impl Efficiency {
    /// May `quoted`, which is `work` with or without the error that a control shows, be quoted at
    /// `confidence`? In neither arm may one pass hold more than [`LARGEST_SHARE`] of M2 (by the upper
    /// bound of `largest_pass`), and both of these moved by no more than half their intervals:
    ///
    /// - the ratio of the variances, with the interval of the jackknife. Whether a tail has settled is a
    ///   question to the scores alone; what the machine does has no part in the answer.
    /// - the ratio of variance times cost, with the interval of `quoted`. A machine whose favour changes
    ///   in the course of a run moves the ratio; the control measures by how much, and the interval that
    ///   is quoted says so.
    ///
    /// Each of the two fails by chance in 1 - `confidence` of all honest comparisons: R of half the data
    /// has twice the variance, its covariance with R of all is the latter's variance, and so their
    /// difference has the standard error of R itself. For the machine: if its favour in either half is
    /// independent, with the variance 2 v, that of the whole has v, and so has their difference.
    pub fn is_resolved(&self, quoted: &LogRatio, confidence: f64) -> bool {
        let is_shared = [self.a, self.b].iter().all(|arm| arm.largest_pass.1 <= LARGEST_SHARE);
        // A NaN (a first half of zero variance) resolves nothing.
        is_shared
            && self.moved.variance <= self.variance.half_width(confidence)
            && self.moved.work <= quoted.half_width(confidence)
    }
}

/// What controls show of the machine: 0 with the error r and its degrees of freedom, from the logarithms of
/// the cell's own control's ratio to itself and of those of all cells.
pub fn machine(own: f64, all: &[f64]) -> Estimate {
    let count = all.len() as f64;
    let mean = all.iter().map(|log| log * log).sum::<f64>() / count;
    Estimate { value: 0.0, std_error: mean.max(own * own).sqrt(), dof: count }
}

/// Confidence at which one arm is resolved.
const ONE_ARM: f64 = 0.999;

/// Bounds of the largest share s of sum (x_i - m)^2 that one pass of any block holds, m the mean of all.
///
/// In block k let Q2 = sum (x_i - m)^2 and Q4 = sum (x_i - m)^4 (its moments shifted by d = mean_k - m).
/// One of the terms of Q4 is the square of the largest of Q2, so that is at most sqrt(Q4); and Q4 <=
/// (largest term) Q2, so it is at least Q4 / Q2. With M2 = sum of all Q2:
///   max_k Q4 / (Q2 M2) <= s <= max_k sqrt(Q4) / M2.
/// Over one block the bounds are kurtosis / n and sqrt(kurtosis / n). With the sum of a block's
/// variances for Q2 and that of their squares for Q4, the same holds of the largest variance.
pub fn one_pass_share(blocks: &[JackknifeBlock], values: Values, mean: f64) -> (f64, f64) {
    let terms = |b: &JackknifeBlock| values.terms(&b.moments, mean);
    let m2: f64 = blocks.iter().map(|b| terms(b).0).sum();
    let bounds = blocks.iter().map(|b| {
        let (q2, q4) = terms(b);
        (if q2 > 0.0 { q4 / (q2 * m2) } else { 0.0 }, q4.sqrt() / m2)
    });
    let (low, high) = bounds.fold((0.0f64, 0.0f64), |s, b| (s.0.max(b.0), s.1.max(b.1)));
    (low, high.min(1.0))
}

/// Second and fourth powers of deviations from `mean`, summed: with x - mean = (x - mean_k) + d,
/// M2 + n d^2 and M4 + 4 d M3 + 6 d^2 M2 + n d^4.
fn about(moments: &Moments, mean: f64) -> (f64, f64) {
    let (n, d) = (moments.n as f64, moments.mean - mean);
    let d2 = d * d;
    let q4 = moments.m4 + 4.0 * d * moments.m3 + 6.0 * d2 * moments.m2 + n * d2 * d2;
    (moments.m2 + n * d2, q4.max(0.0))
}

/// Compares two arms.
///
/// # Errors
///
/// [`NoRatio`].
pub fn compare(
    a: &[JackknifeBlock],
    b: &[JackknifeBlock],
    values: Values,
) -> Result<Efficiency, NoRatio> {
    let (left, right) = (Jackknife::of(a, values)?, Jackknife::of(b, values)?);
    let work = left.work.over(&right.work);
    let variance = left.variance.over(&right.variance);
    let halves = [a, b].map(|blocks| Totals::of(&blocks[..blocks.len() / 2]));
    let [half_a, half_b] = halves.map(|half| half.log_variance(values));
    let [cost_a, cost_b] = halves.map(|half| half.log_cost());
    let own = LogRatio { log: right.variance.alone() };
    let own_moved = (half_b - own.log.value).abs();
    let b_arm = right.arm(b);
    Ok(Efficiency {
        work,
        variance,
        cost: left.cost.over(&right.cost),
        rest: left.cost.over(&right.work),
        b_is_resolved: b_arm.largest_pass.1 <= LARGEST_SHARE && own_moved <= own.half_width(ONE_ARM),
        a: left.arm(a),
        b: b_arm,
        is_joint: left.is_paired_with(&right),
        moved: Moved {
            work: ((half_a + cost_a) - (half_b + cost_b) - work.log.value).abs(),
            variance: (half_a - half_b - variance.log.value).abs(),
        },
    })
}

/// Moments and cost of some blocks.
#[derive(Clone, Copy, Debug, Default)]
struct Totals {
    moments: Moments,
    cost: f64,
}

impl Totals {
    fn of(blocks: &[JackknifeBlock]) -> Totals {
        blocks
            .iter()
            .fold(Totals::default(), |sum, b| sum.and(&Totals { moments: b.moments, cost: b.cost }))
    }

    fn and(&self, later: &Totals) -> Totals {
        Totals { moments: self.moments.merge(later.moments), cost: self.cost + later.cost }
    }

    fn log_variance(&self, values: Values) -> f64 {
        ln(values.variance(&self.moments))
    }

    fn log_cost(&self) -> f64 {
        ln(self.cost / self.moments.n as f64)
    }

    fn work(&self, values: Values) -> f64 {
        self.log_variance(values) + self.log_cost()
    }
}

/// A function of all blocks, and e_k of every block.
#[derive(Clone, Debug)]
struct Deviations {
    value: f64,
    each: Vec<f64>,
}

/// One arm's log variance, log cost and their sum.
struct Jackknife {
    values: Values,
    total: Totals,
    variance: Deviations,
    cost: Deviations,
    work: Deviations,
}

impl Jackknife {
    fn of(blocks: &[JackknifeBlock], values: Values) -> Result<Jackknife, NoRatio> {
        if blocks.len() < FEWEST_BLOCKS || blocks.iter().any(|b| b.moments.n == 0) {
            return Err(NoRatio::TooFewBlocks);
        }
        let is_good = |b: &JackknifeBlock| {
            b.moments.to_array().iter().all(|x| x.is_finite()) && b.cost.is_finite() && b.cost > 0.0
        };
        if !blocks.iter().all(is_good) {
            return Err(NoRatio::NotFinite);
        }
        let without = without_each(blocks);
        let total = Totals::of(blocks);
        let varies = |t: &Totals| match values {
            Values::Scores => t.moments.m2 > 0.0,
            Values::Variances => t.moments.mean > 0.0,
        };
        if !without.iter().chain([&total]).all(varies) {
            return Err(NoRatio::ZeroVariance);
        }
        let n = total.moments.n as f64;
        let deviations = |f: &dyn Fn(&Totals) -> f64| {
            let (value, count) = (f(&total), blocks.len() as f64);
            let h: Vec<f64> = blocks.iter().map(|b| n / b.moments.n as f64).collect();
            let pseudo: Vec<f64> =
                h.iter().zip(&without).map(|(h, t)| h * value - (h - 1.0) * f(t)).collect();
            let centre: f64 = pseudo.iter().zip(&h).map(|(p, h)| p / h).sum();
            let each = pseudo.iter().zip(&h).map(|(p, h)| (p - centre) / (count * (h - 1.0)).sqrt());
            Deviations { value, each: each.collect() }
        };
        let variance = deviations(&|t| t.log_variance(values));
        let cost = deviations(&Totals::log_cost);
        Ok(Jackknife { values, total, variance, cost, work: deviations(&|t| t.work(values)) })
    }

    fn arm(&self, blocks: &[JackknifeBlock]) -> ArmSummary {
        let (moments, values) = (self.total.moments, self.values);
        let all = values.terms(&moments, moments.mean).0;
        let share = |b: &JackknifeBlock| values.terms(&b.moments, moments.mean).0 / all;
        ArmSummary {
            moments,
            cost: self.total.cost / moments.n as f64,
            kurtosis: match values {
                Values::Scores => moments.kurtosis(),
                Values::Variances => f64::NAN,
            },
            largest_block: blocks.iter().map(share).fold(0.0, f64::max),
            largest_pass: one_pass_share(blocks, values, moments.mean),
        }
    }

    fn is_paired_with(&self, other: &Jackknife) -> bool {
        self.work.each.len() == other.work.each.len()
    }
}

impl Deviations {
    /// By itself.
    fn alone(&self) -> Estimate {
        let std_error = self.each.iter().map(|e| e * e).sum::<f64>().sqrt();
        Estimate { value: self.value, std_error, dof: self.each.len() as f64 - 1.0 }
    }

    /// Minus another, block by block where both have as many.
    fn over(&self, other: &Deviations) -> LogRatio {
        if self.each.len() != other.each.len() {
            return LogRatio { log: self.alone().minus(&other.alone()) };
        }
        let each = self.each.iter().zip(&other.each).map(|(a, b)| a - b).collect();
        LogRatio { log: Deviations { value: self.value - other.value, each }.alone() }
    }
}

/// The delete-one jackknife's standard error of a positive estimate's logarithm: from the estimates
/// that leave one block out each, se^2 = (n - 1) / n sum (log - mean log)^2. Infinite for fewer than
/// two. For estimates that are no sums over [`JackknifeBlock`]s.
pub fn jackknife_log_error(without_one: &[f64]) -> f64 {
    if without_one.len() < 2 {
        return f64::INFINITY;
    }
    let n = without_one.len() as f64;
    let logs: Vec<f64> = without_one.iter().map(|x| ln(*x)).collect();
    let mean = logs.iter().sum::<f64>() / n;
    ((n - 1.0) / n * logs.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>()).sqrt()
}

/// All blocks except one, for each: merged prefixes with merged suffixes, because taking a block out
/// again by subtraction would cancel.
fn without_each(blocks: &[JackknifeBlock]) -> Vec<Totals> {
    let mut after = vec![Totals::default()];
    for block in blocks.iter().rev() {
        let later = after[after.len() - 1];
        after.push(Totals::of(std::slice::from_ref(block)).and(&later));
    }
    let mut before = Totals::default();
    let mut without = Vec::with_capacity(blocks.len());
    for (k, block) in blocks.iter().enumerate() {
        without.push(before.and(&after[blocks.len() - 1 - k]));
        before = before.and(&Totals::of(std::slice::from_ref(block)));
    }
    without
}

#[cfg(test)]
#[path = "efficiency_tests.rs"]
mod tests;
