//! Claims of efficiency: `faster` and `not_slower`.
//!
//! With V the variance of a pass and c its cost (of all bands together, whatever the pass scores), the
//! efficiency ratio of a candidate A relative to a baseline B is E = V_B c_B / (V_A c_A). Both
//! claims state that E exceeds a bound e: `faster` e = ratio, `not_slower` e = 1 / margin, because the
//! ratio of inverse efficiencies is 1 / E. ln E has a Student interval from a jackknife over blocks
//! (`stats::efficiency`).
//!
//! Of the observable `pixels`, V is the variance of a pixel in one pass, averaged over the pixels, as
//! the pairs of passes show it (`results::record::Image::spread`); the means that must agree are those
//! of the sensor's first observable. Where the pixels of a pass are independent, the variance of the
//! mean of the image is V over their number, and the ratio is that of `mean`. The ratio of `mean` has a wider
//! interval, because it uses the variance of n numbers instead of n times the pixels. Where pixels of an
//! estimator share paths, the two ratios differ.
//!
//! Before any number is quoted
//!   the two means agree: the test that an `agree` claim would make. An objection to it voids the claim;
//!   E is resolved: when the passes doubled, the ratio of the variances moved by no more than its 99.9 %
//!   interval, and E by no more than the one that is quoted, and no pass may hold more than 5 % of an
//!   arm's sum of squares; by CPU time, the blocks are parts of a run that
//!   interleaved the arms of the cell, A B .. B A (`run::workers`), the interval includes the effect of the
//!   machine that the control shows (`stats::efficiency`), and for the baseline and its own control arm the
//!   99.9 % intervals of both E and the cost ratio contain 1, or the ratios are within 5 % of it. Parts that
//!   warmed a worker up or were run in pieces are left out whole; this selection does not depend on the
//!   scores.
//!
//! By counted work E may differ from the value by CPU time by the factor f of the two kinds of estimators
//! (`results::counted_work`), so that the claim must hold for every value within this factor: e f replaces
//! e where it must be exceeded, and e / f where it is rejected.
//!
//! Then the claim
//!   fails, where the p-value 2 min(p_mean, p_slow) is rejected in the family of all tests (Holm), with
//!   p_mean two-sided for equal means and p_slow one-sided for E >= e (Bonferroni over the two: both are
//!   true where the claim is). One look, because new streams would be timed under other conditions;
//!   passes, where it does not fail and the two-sided 99.9 % interval of E lies above e: a claim that
//!   E > e is false and passes with probability at most 1 in 2000, claim by claim; is underpowered
//!   otherwise. `detectable` is the smallest shortfall of E below e, relative to e, that would have
//!   failed with 99 % probability.

use super::evidence::{CONFIDENCE, EfficiencyTest, Evidence, SHOWN, kurtosis_words};
use super::family::Finding;
use super::means::{MeanTest, evidence_of_means};
use super::verdict::{TestKind, Verdict};
use super::weights;
use crate::math::{exp, ln};
use crate::results::counted_work;
use crate::results::record::{CostMeasure, EstimatorRun, Quantity};
use crate::results::store::Stored;
use crate::stats::efficiency::{Efficiency, JackknifeBlock, LogRatio, Values, compare, machine};
use crate::stats::hypothesis::{Estimate, Test};
use crate::stats::moments::Moments;
use crate::stats::tree::Merge;

/// The fewest parts of a run that a ratio of CPU times may rest on.
const LEAST_PARTS: usize = 16;

/// How far a control arm may be from its baseline. Up to here, the interval of a ratio contains what the
/// control shows.
const LARGEST_CONTROL: f64 = 1.05;

/// Two arms at equal cost.
pub(crate) struct Contest {
    /// Baseline over candidate: above 1 where the candidate is the better. Its intervals are those of
    /// the scores and costs alone.
    pub efficiency: Efficiency,
    /// The efficiency ratio with the error that the clock's control shows.
    pub ratio: LogRatio,
    /// That error; 0 by counters.
    pub machine: f64,
    /// Whether the arms were interleaved, and timed with a control; always true by counters.
    pub is_interleaved: bool,
    /// What the ratio is at least, with [`SHOWN`] confidence from below and above together, where only
    /// the tail of the baseline is not resolved.
    pub at_least: Option<f64>,
}

impl Contest {
    /// Whether the ratio may be quoted.
    pub(super) fn is_resolved(&self) -> bool {
        self.efficiency.is_resolved(&self.ratio, CONFIDENCE)
    }
}

/// Compares two quantities of a record.
///
/// # Errors
/// As a sentence: something is missing, or the ratio does not exist.
pub(crate) fn contest(
    stored: &Stored,
    candidate: &Quantity,
    baseline: &Quantity,
    measure: CostMeasure,
) -> Result<Contest, String> {
    let a = CostedBatches::of(stored, candidate, measure)?;
    let b = CostedBatches::of(stored, baseline, measure)?;
    let control = match measure {
        CostMeasure::Counters => None,
        CostMeasure::Cpu => control_log(stored, candidate.cell),
    };
    let parts = control.map(|_| parts(&a, &b)).filter(|(a, _)| a.len() >= LEAST_PARTS);
    let control = control.filter(|_| parts.is_some());
    let (a, b) = parts.unwrap_or_else(|| (a.blocks(), b.blocks()));
    let values = match baseline.observable.is_pixels() {
        true => Values::Variances,
        false => Values::Scores,
    };
    let efficiency = compare(&b, &a, values).map_err(|why| why.to_string())?;
    let machine = machine_of(stored, control);
    let at_least = efficiency.at_least(&b, values, &machine, 0.5 * (1.0 + SHOWN));
    Ok(Contest {
        ratio: efficiency.work.with_control(&machine),
        machine: machine.std_error,
        is_interleaved: measure == CostMeasure::Counters || control.is_some(),
        at_least,
        efficiency,
    })
}

/// The time of the control over that of its first run, where the CPU times of two quantities are of
/// interleaved passes.
pub(super) fn control_ratio(stored: &Stored, candidate: &Quantity, baseline: &Quantity) -> Option<f64> {
    let costed = |quantity| CostedBatches::of(stored, quantity, CostMeasure::Cpu).ok();
    let (a, _) = parts(&costed(candidate)?, &costed(baseline)?);
    control_log(stored, candidate.cell).filter(|_| a.len() >= LEAST_PARTS).map(exp)
}

/// What the controls of a record's cells show of the machine, where a cell has one of its own.
fn machine_of(stored: &Stored, own: Option<f64>) -> Estimate {
    let all = || (0..stored.record.cells.len()).filter_map(|cell| control_log(stored, cell));
    own.map_or(Estimate::known(0.0, 0.0), |own| machine(own, &all().collect::<Vec<_>>()))
}

/// The time of the control over that of its baseline, as a logarithm: of control arms, and of passes that were
/// run a second time. Where a cell has several, the one that shows most.
fn control_log(stored: &Stored, cell: usize) -> Option<f64> {
    let runs = &stored.record.cells.get(cell)?.runs;
    let batches = stored.timing.as_ref()?.batches.get(&stored.record.cells[cell].label)?;
    let twice = batches.values().flat_map(|arm| &arm.twice);
    let [first, second] = twice.fold([0.0; 2], |sum, times| [sum[0] + times[0], sum[1] + times[1]]);
    let of_arms = runs.iter().filter_map(|run| {
        let observable = run.observables.first()?;
        let arm = |estimator: &str| {
            let (estimator, observable) = (estimator.into(), observable.clone());
            let quantity = Quantity { cell, estimator, observable, band: 0 };
            CostedBatches::of(stored, &quantity, CostMeasure::Cpu).ok()
        };
        let (first, second) = parts(&arm(run.control_of.as_ref()?)?, &arm(&run.estimator)?);
        ratio_log(per_pass(&first), per_pass(&second))
    });
    of_arms.chain(ratio_log(first, second)).max_by(|a, b| a.abs().total_cmp(&b.abs()))
}

/// Time of a pass. Arms may have different numbers of them.
fn per_pass(parts: &[JackknifeBlock]) -> f64 {
    let cost: f64 = parts.iter().map(|part| part.cost).sum();
    cost / parts.iter().map(|part| part.moments.n).sum::<u64>() as f64
}

/// The logarithm of a second time over a first, where both were measured.
fn ratio_log(first: f64, second: f64) -> Option<f64> {
    (first > 0.0 && second > 0.0).then(|| ln(second / first))
}

/// The quantity whose mean is reported for that of `quantity`: itself, or the sensor's first observable
/// for `pixels`.
pub(super) fn mean_of(stored: &Stored, quantity: &Quantity) -> Quantity {
    let first = stored.run(quantity).and_then(|run| run.observables.first());
    match first.filter(|_| quantity.observable.is_pixels()) {
        Some(first) => Quantity { observable: first.clone(), ..quantity.clone() },
        None => quantity.clone(),
    }
}

/// The batches of one arm.
struct CostedBatches {
    /// Moments of scores, or of the variances that pairs of passes show.
    batches: Vec<Moments>,
    costs: Vec<f64>,
    settled: Vec<bool>,
}

impl CostedBatches {
    fn of(stored: &Stored, quantity: &Quantity, measure: CostMeasure) -> Result<CostedBatches, String> {
        let name = &quantity.estimator;
        let missing = || format!("the record does not hold this quantity of {name}");
        let run = stored.run(quantity).ok_or_else(missing)?;
        let batches = stored.batches(&mean_of(stored, quantity)).ok_or_else(missing)?;
        let (costs, settled) = match measure {
            CostMeasure::Counters => {
                let costs = weights::counted(stored, run)?;
                let settled = vec![true; costs.len()];
                (costs, settled)
            }
            CostMeasure::Cpu => {
                let cell = stored.record.cells.get(quantity.cell).map_or("", |cell| &cell.label);
                let timing = stored.timing.as_ref();
                let timed = timing.and_then(|timing| timing.batches_of(cell, name));
                let timed = timed.ok_or_else(|| format!("no CPU time of {name} was kept"))?;
                // Every pass has its part of the set-up.
                let spent = timing.and_then(|timing| timing.of(cell, name));
                let set_up = spent.map_or(0.0, |spent| spent.set_up_seconds);
                let passes: u64 = batches.iter().map(|batch| batch.n).sum();
                let part = |batch: &Moments| set_up * batch.n as f64 / passes as f64;
                let costs = timed.cpu_seconds.iter().enumerate();
                let costs = costs.map(|(i, cost)| cost + batches.get(i).map_or(0.0, part)).collect();
                (costs, timed.settled.clone())
            }
        };
        if costs.len() != batches.len() || settled.len() != batches.len() {
            return Err(format!("costs of {name} are not of the record's {} batches", batches.len()));
        }
        if quantity.observable.is_pixels() {
            let pairs = stored.spread(run, quantity.band).ok_or_else(missing)?;
            return CostedBatches::of_pairs(&batches, &pairs, &costs, &settled).ok_or_else(|| {
                format!("the spread of {name} is not of the record's {} batches", batches.len())
            });
        }
        Ok(CostedBatches { batches, costs, settled })
    }

    /// Batches of pairs with what their passes cost. A batch of pairs is one of passes, or two where
    /// those are of one pass each. The cost of a pair is recorded as that of one pass, and of a batch's
    /// odd pass not at all.
    fn of_pairs(
        batches: &[Moments],
        pairs: &[Moments],
        costs: &[f64],
        settled: &[bool],
    ) -> Option<CostedBatches> {
        let width = if batches.first()?.n == 1 { 2 } else { 1 };
        let mut side = CostedBatches { batches: Vec::new(), costs: Vec::new(), settled: Vec::new() };
        for (index, &pair) in pairs.iter().enumerate() {
            let of = index * width..(index + 1) * width;
            let passes: u64 = batches.get(of.clone())?.iter().map(|batch| batch.n).sum();
            if passes / 2 != pair.n {
                return None;
            }
            side.batches.push(pair);
            side.costs.push(costs[of.clone()].iter().sum::<f64>() * pair.n as f64 / passes as f64);
            side.settled.push(settled[of].iter().all(|is_settled| *is_settled));
        }
        // What is in no pair is one last pass.
        let paired: u64 = pairs.iter().map(|pair| 2 * pair.n).sum();
        let passes: u64 = batches.iter().map(|batch| batch.n).sum();
        (passes - paired <= 1).then_some(side)
    }

    fn blocks(&self) -> Vec<JackknifeBlock> {
        let blocks = self.batches.iter().zip(&self.costs);
        blocks.map(|(&moments, &cost)| JackknifeBlock { moments, cost }).collect()
    }

    /// The batches that began in each of `count` equal parts of the run; nothing for a part in which one
    /// was not timed with its rivals.
    fn parts(&self, count: usize) -> Vec<Option<JackknifeBlock>> {
        let all: u64 = self.batches.iter().map(|batch| batch.n).sum();
        let mut parts: Vec<(bool, Option<JackknifeBlock>)> = vec![(true, None); count];
        let mut start = 0;
        for (index, block) in self.blocks().into_iter().enumerate() {
            let (is_settled, part) = &mut parts[(start as u128 * count as u128 / all as u128) as usize];
            *is_settled &= self.settled[index];
            let join = |sum: JackknifeBlock| JackknifeBlock {
                moments: sum.moments.merge(block.moments),
                cost: sum.cost + block.cost,
            };
            *part = Some(part.map_or(block, join));
            start += block.moments.n;
        }
        parts.into_iter().map(|(is_settled, part)| part.filter(|_| is_settled)).collect()
    }
}

/// The parts of the run in which both arms were timed: two batches or more of each, which ran by turns.
/// Arms may have different numbers of passes.
fn parts(a: &CostedBatches, b: &CostedBatches) -> (Vec<JackknifeBlock>, Vec<JackknifeBlock>) {
    let count = (a.batches.len().min(b.batches.len()) / 2).max(1);
    a.parts(count).into_iter().zip(b.parts(count)).filter_map(|(a, b)| a.zip(b)).unzip()
}

/// A candidate against a baseline.
#[derive(Clone, Copy, Debug)]
pub(super) struct EfficiencyClaim<'a> {
    pub candidate: &'a Quantity,
    pub baseline: &'a Quantity,
    /// Bound that E must exceed.
    pub bound: f64,
    pub cost: CostMeasure,
}

/// What a claim of efficiency shows; a control that expects failure has `fails`.
pub(super) fn finding(
    stored: &Stored,
    mut verdict: Verdict,
    claim: &EfficiencyClaim,
    fails: bool,
) -> Finding {
    verdict.test = Some(TestKind::Efficiency(claim.cost));
    verdict.set_expected(claim.bound, 0.0);
    let evidence = match weigh(stored, claim, fails) {
        Ok(shown) => {
            let ratio = shown.ratio.ratio();
            verdict.set_value(ratio, ratio * shown.ratio.log.std_error);
            Evidence::Efficiency(Box::new(shown))
        }
        Err(reason) => Evidence::Nothing(reason.into()),
    };
    // Streams anew would be timed under other conditions.
    Finding { one_look: true, ..Finding::new(verdict, evidence) }
}

fn weigh(stored: &Stored, claim: &EfficiencyClaim, fails: bool) -> Result<EfficiencyTest, String> {
    let EfficiencyClaim { candidate, baseline, bound, cost } = *claim;
    let means = evidence_of_means(stored, &mean_of(stored, candidate), &mean_of(stored, baseline));
    let MeanTest { evidence, value, expected, .. } = means;
    let difference = match &evidence {
        Evidence::Difference { difference, .. } => difference,
        Evidence::Nothing(reason) => return Err(format!("no mean test: {reason}")),
        Evidence::Exact { holds: true, .. } => {
            return Err("zero variance: there is nothing to compare".into());
        }
        _ => return Err("the means differ, without sampling error".into()),
    };
    let contest = contest(stored, candidate, baseline, cost)?;
    if cost == CostMeasure::Cpu {
        if !contest.is_interleaved {
            return Err("the arms were not interleaved: play them in one run, from its start".into());
        }
        control_objection(stored, baseline).map_or(Ok(()), Err)?;
    }
    let efficiency = &contest.efficiency;
    let kurtosis = (efficiency.b.kurtosis, efficiency.a.kurtosis);
    if !contest.is_resolved() {
        let interval = |ratio: &LogRatio| ratio.half_width(CONFIDENCE);
        return Err(format!(
            "not resolved: when the passes doubled, ln of the ratio moved by {:.2}, interval +-{:.2}, and ln of \
             the ratio of the variances by {:.2}, interval +-{:.2}; one pass may hold {:.1} % of a variance{}",
            efficiency.moved.work,
            interval(&contest.ratio),
            efficiency.moved.variance,
            interval(&efficiency.variance),
            100.0 * efficiency.a.largest_pass.1.max(efficiency.b.largest_pass.1),
            kurtosis_words(kurtosis, 3)
        ));
    }
    let ratio = contest.ratio;
    let kind = |quantity: &Quantity| stored.run(quantity).map_or("", |run| run.kind.as_str());
    let factor = match cost {
        CostMeasure::Cpu => 1.0,
        CostMeasure::Counters => counted_work::factor(kind(candidate), kind(baseline))?,
    };
    let two_sided = ratio.test(bound / factor);
    let half = 0.5 * two_sided.p_value;
    let slow = if two_sided.statistic < 0.0 { half } else { 1.0 - half };
    let of_means = difference.test_zero().p_value;
    let p_value = (2.0 * of_means.min(slow)).min(1.0);
    let size = |mean: Option<Estimate>| mean.map_or(0.0, |mean| mean.value.abs());
    let scale = size(value).max(size(expected));
    let relative = |x: f64| if scale > 0.0 { x / scale } else { x };
    Ok(EfficiencyTest {
        ratio,
        machine: contest.machine,
        bound,
        factor,
        kurtosis,
        difference: Estimate {
            value: relative(difference.value),
            std_error: relative(difference.std_error),
            dof: difference.dof,
        },
        blames_means: of_means < slow,
        fails,
        test: Test { p_value, ..two_sided },
    })
}

/// What the baseline against itself shows of the machine.
fn control_objection(stored: &Stored, baseline: &Quantity) -> Option<String> {
    let runs = &stored.record.cells.get(baseline.cell)?.runs;
    let is_control = |run: &&EstimatorRun| run.control_of.as_deref() == Some(&*baseline.estimator);
    let Some(control) = runs.iter().find(is_control) else {
        return Some(format!("no control: {} was not run twice", baseline.estimator));
    };
    let control = Quantity { estimator: control.estimator.clone(), ..baseline.clone() };
    let contest = match contest(stored, &control, baseline, CostMeasure::Cpu) {
        Ok(contest) if contest.is_interleaved => contest,
        Ok(_) => return Some("no control: it was not interleaved".into()),
        Err(reason) => return Some(format!("no control: {reason}")),
    };
    let is_off =
        |ratio: &LogRatio| ratio.log.value.abs() > ratio.half_width(CONFIDENCE).max(ln(LARGEST_CONTROL));
    let (cost, work) = (contest.efficiency.cost, contest.efficiency.work);
    (is_off(&cost) || is_off(&work)).then(|| {
        format!(
            "machine too noisy: {} against itself has {:.3} times the cost and {:.3} times the efficiency, \
             more than {LARGEST_CONTROL} and outside of a 99.9 % interval",
            baseline.estimator,
            cost.ratio(),
            work.ratio()
        )
    })
}

#[cfg(test)]
#[path = "efficiency_tests.rs"]
mod tests;
