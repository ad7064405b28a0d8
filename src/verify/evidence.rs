//! The evidence of one test by itself, before p-values are adjusted for those of other tests.

use super::levels::POWER;
use super::verdict::{Objection, Outcome, Verdict};
use crate::math::ln;
use crate::stats::efficiency::LogRatio;
use crate::stats::goodness::{Goodness, Proportion};
use crate::stats::hypothesis::{Estimate, Test};
use crate::stats::signs;

/// Confidence of the intervals of efficiencies that decide.
pub(super) const CONFIDENCE: f64 = 0.999;

/// Confidence of the intervals of efficiencies that are shown.
pub(super) const SHOWN: f64 = 0.95;

/// What the numbers of one test show.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Evidence {
    /// No evidence, for this reason.
    Nothing(Objection),
    /// An exact statement: it holds, or it does not.
    Exact { holds: bool, said: String },
    /// A difference with its error; its p-value is this many times that of Student's t.
    Difference { difference: Estimate, times: f64 },
    /// A statistic with the p-value of `signs::one_sided_bound`, from `terms` terms, and the true effect
    /// that moves it by 1; `detectable` is the root of such an effect.
    Bounded { t: f64, terms: f64, unit: f64 },
    /// An efficiency against a bound.
    Efficiency(Box<EfficiencyTest>),
    /// A test of many comparisons at once.
    Sum(Test),
    /// Counts against probabilities.
    Counts { fit: CountsFit, test: Test, said: String },
}

impl Evidence {
    /// A difference whose p-value is that of Student's t.
    pub(super) fn of_difference(difference: Estimate) -> Evidence {
        Evidence::Difference { difference, times: 1.0 }
    }

    /// Two sides without sampling error, as `verdict` has them: the same, or not.
    pub(super) fn of_sides(holds: bool, verdict: &Verdict) -> Evidence {
        let said = match holds {
            true => "the same".into(),
            false => format!("no sampling error, {}", verdict.deviation()),
        };
        Evidence::Exact { holds, said }
    }

    /// The test; none where there is nothing to test, or the statement is exact.
    pub(super) fn test(&self) -> Option<Test> {
        match self {
            Evidence::Nothing(_) | Evidence::Exact { .. } => None,
            Evidence::Difference { difference, times } => Some(test_of(difference, *times)),
            Evidence::Bounded { t, .. } => {
                let p_value = signs::one_sided_bound(*t);
                Some(Test { statistic: *t, dof: f64::NAN, p_value })
            }
            Evidence::Efficiency(shown) => Some(shown.test),
            Evidence::Sum(test) | Evidence::Counts { test, .. } => Some(*test),
        }
    }

    /// The p-value of the test.
    pub(super) fn p_value(&self) -> Option<f64> {
        self.test().map(|test| test.p_value).filter(|p| !p.is_nan())
    }

    /// The smallest defect that is rejected at `level` with probability [`POWER`]: of a difference
    /// relative to `relative_to`, or absolute where that is 0.
    pub(super) fn detectable(&self, level: f64, relative_to: f64) -> Option<f64> {
        let scale = if relative_to == 0.0 { 1.0 } else { relative_to.abs() };
        match self {
            Evidence::Nothing(_) | Evidence::Exact { .. } | Evidence::Sum(_) => None,
            Evidence::Difference { difference, times } => {
                Some(difference.detectable(level / times, POWER) / scale)
            }
            Evidence::Bounded { terms, unit, .. } => {
                Some((unit * signs::detectable(level, POWER, *terms)).sqrt() / scale)
            }
            Evidence::Efficiency(shown) => Some(shown.detectable(level)),
            Evidence::Counts { fit, .. } => Some(fit.detectable(level)),
        }
        .filter(|detectable| !detectable.is_nan())
    }
}

/// The test that a difference is chance.
fn test_of(difference: &Estimate, times: f64) -> Test {
    let Estimate { value, std_error, dof } = *difference;
    let statistic = value / std_error;
    let p_value = if statistic.is_finite() {
        // Not `min`, which would make a p-value of what is not a number.
        let p_value = times * difference.test_zero().p_value;
        if p_value > 1.0 { 1.0 } else { p_value }
    } else if std_error == 0.0 && !value.is_nan() {
        if value == 0.0 { 1.0 } else { 0.0 }
    } else {
        f64::NAN
    };
    Test { statistic, dof, p_value }
}

/// Counts against probabilities, with the smallest defect that they would have found.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum CountsFit {
    /// Chi-square over many bins.
    Bins(Goodness),
    /// Exact binomial test of one outcome.
    Share(Proportion),
}

impl CountsFit {
    /// The smallest relative error of the density, or of the probability, that is rejected at `level`.
    fn detectable(&self, level: f64) -> f64 {
        match self {
            CountsFit::Bins(found) => found.detectable(level, POWER).relative,
            CountsFit::Share(found) => {
                let (below, above) = found.detectable(level, POWER);
                (found.mass - below).max(above - found.mass) / found.mass
            }
        }
    }
}

/// Evidence on a claim of efficiency: see `verify::efficiency`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct EfficiencyTest {
    /// E, variance times cost of the baseline over that of the candidate.
    pub ratio: LogRatio,
    /// The part of its logarithm's standard error that the clock's controls show; 0 by counted work.
    pub machine: f64,
    /// The bound e that E must exceed.
    pub bound: f64,
    /// The factor by which E may be off because its cost is counted work; 1 by CPU time.
    pub factor: f64,
    /// Kurtosis of a pass: candidate, baseline.
    pub kurtosis: (f64, f64),
    /// The difference of the means, relative to the larger.
    pub difference: Estimate,
    /// Whether the means contradict the claim more than E does.
    pub blames_means: bool,
    /// Whether a control expects E to fall short.
    pub fails: bool,
    /// Student's t of ln E - ln e, with the p-value of the claim as a whole.
    pub test: Test,
}

impl EfficiencyTest {
    /// The outcome, where the p-value adjusted over the family is `adjusted_p` and a test fails below
    /// `level`; `own_level` is the level of this test alone. A control expects E to
    /// fail.
    pub(super) fn outcome(
        &self,
        adjusted_p: Option<f64>,
        level: f64,
        own_level: f64,
        detect: Option<f64>,
    ) -> Outcome {
        match adjusted_p {
            None => Outcome::Invalid("the test has no p-value".into()),
            Some(p) if p < level && self.fails && self.blames_means => {
                Outcome::Invalid(self.means_differ().into())
            }
            Some(p) if p < level => Outcome::Fail,
            // What is not a number is not above the bound, and nothing is known to be seen.
            _ if !self.is_shown() => Outcome::Underpowered,
            _ if detect.is_none_or(|d| self.unseen(own_level) <= d) => Outcome::Pass,
            _ => Outcome::Underpowered,
        }
    }

    /// Whether the whole interval lies above the bound.
    fn is_shown(&self) -> bool {
        self.ratio.interval(CONFIDENCE).0 > self.must_exceed()
    }

    /// What the interval of E must lie above.
    fn must_exceed(&self) -> f64 {
        self.bound * self.factor
    }

    fn means_differ(&self) -> String {
        format!("the means differ by {:+.2} %", 100.0 * self.difference.value)
    }

    /// The relative difference of the means that could have gone unseen.
    fn unseen(&self, own_level: f64) -> f64 {
        self.difference.detectable(own_level, POWER)
    }

    /// Passes over those that there are at which the interval would lie above the bound, and a
    /// difference of the means as large as `detect` would be seen; none where E itself is too small, or
    /// too small for what the clock's controls show, which no number of passes changes.
    pub(super) fn passes_factor(&self, own_level: f64, detect: Option<f64>) -> Option<f64> {
        let Estimate { std_error, .. } = self.ratio.log;
        let machine = self.machine * self.machine;
        // The half-width h of the interval is t times the standard error: (a / t)^2 = s^2 / f + r^2, with
        // the error s of the scores and costs, and r of the machine.
        let error = std_error * self.above_bound() / self.ratio.half_width(CONFIDENCE);
        let shown = (std_error * std_error - machine) / (error * error - machine);
        let seen = detect.map_or(0.0, |d| self.unseen(own_level) / d);
        (error > self.machine).then(|| shown.max(seen * seen))
    }

    /// ln E above that of what it must exceed.
    fn above_bound(&self) -> f64 {
        self.ratio.log.value - ln(self.must_exceed())
    }

    /// Whether E would be shown to exceed its bound but for what the clock's controls show.
    fn blames_machine(&self) -> bool {
        let share = self.machine / self.ratio.log.std_error;
        let alone = (1.0 - share * share).max(0.0).sqrt() * self.ratio.half_width(CONFIDENCE);
        !self.is_shown() && self.above_bound() > alone
    }

    /// The smallest shortfall of E below e, relative to e, that would have failed: 1 - exp(-d) with d
    /// that of ln E. The p-value is twice the one-sided one, so that its level is that of a two-sided
    /// test.
    fn detectable(&self, own_level: f64) -> f64 {
        let log = Estimate::known(-self.ratio.log.detectable(own_level, POWER), 0.0);
        1.0 - LogRatio { log }.ratio() / self.factor
    }

    /// The reason for an outcome.
    pub(super) fn note(&self, found: &Outcome, own_level: f64) -> String {
        let (low, high) = self.ratio.interval(CONFIDENCE);
        let counted = match self.factor {
            1.0 => String::new(),
            factor => format!(", counted work may be off by {factor:.2} times"),
        };
        let numbers = format!(
            "{:.3} times the efficiency, 99.9 % interval {low:.3} to {high:.3}{counted}{}",
            self.ratio.ratio(),
            kurtosis_words(self.kurtosis, 1)
        );
        match found {
            Outcome::Invalid(objection) => objection.to_string(),
            Outcome::Fail if self.blames_means => self.means_differ(),
            Outcome::Underpowered if !self.is_shown() => {
                let machine = match self.blames_machine() {
                    true => format!(
                        "; the clock's controls are off by {:.1} %, and more passes do not change that: run it \
                         again on a machine without other work",
                        100.0 * self.machine
                    ),
                    false => String::new(),
                };
                format!("not shown to exceed {:.3}: {numbers}{machine}", self.bound)
            }
            Outcome::Underpowered => format!(
                "a difference of the means of {:.1} % could have gone unseen; {numbers}",
                100.0 * self.unseen(own_level)
            ),
            _ => format!("{numbers}; means agree within {:.1} %", 100.0 * self.unseen(own_level)),
        }
    }
}

/// Two kurtoses at the end of a sentence; nothing where there are none, as of pixels.
pub(super) fn kurtosis_words((a, b): (f64, f64), decimals: usize) -> String {
    if a.is_nan() { String::new() } else { format!("; kurtosis {a:.decimals$} and {b:.decimals$}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three times the efficiency to 1 %, and means equal to `error`.
    fn shown(low: f64, error: f64) -> EfficiencyTest {
        EfficiencyTest {
            ratio: LogRatio { log: Estimate { value: 1.1, std_error: low, dof: 60.0 } },
            machine: 0.0,
            bound: 1.0,
            factor: 1.0,
            kurtosis: (3.0, 3.0),
            difference: Estimate { value: 0.0, std_error: error, dof: 60.0 },
            blames_means: false,
            fails: false,
            test: Test { statistic: 100.0, dof: 60.0, p_value: 1.0 },
        }
    }

    /// 10 % above its bound, with the errors of scores and machine; half-widths are 3.46 times the error.
    fn above_by_a_tenth(scores: f64, machine: f64) -> EfficiencyTest {
        let log = Estimate { value: 0.1, std_error: scores.hypot(machine), dof: 60.0 };
        EfficiencyTest { ratio: LogRatio { log }, machine, ..shown(0.0, 1e-9) }
    }

    #[test]
    fn no_passes_change_what_the_clock_shows() {
        let factor = |scores, machine| above_by_a_tenth(scores, machine).passes_factor(1e-6, None);
        // An interval of +-20 % is to be one of +-10 %.
        let critical = above_by_a_tenth(0.1, 0.0).ratio.half_width(CONFIDENCE) / 0.1;
        let four = factor(0.2 / critical, 0.0).expect("a number");
        assert!((four - 4.0).abs() < 1e-9, "{four}");
        // With 6 % of the machine, 8 % are left to scores and costs.
        let more = factor(0.2 / critical, 0.06 / critical).expect("a number");
        assert!((more - 6.25).abs() < 1e-9, "{more}");
        assert_eq!(factor(0.01 / critical, 0.11 / critical), None);
        for (machine, is_blamed) in [(0.06, false), (0.11, true)] {
            let shown = above_by_a_tenth(0.01 / critical, machine / critical);
            let note = shown.note(&Outcome::Underpowered, 1e-6);
            assert_eq!(note.contains("the clock's controls"), is_blamed, "{note}");
        }
        let note = above_by_a_tenth(0.2 / critical, 0.11 / critical).note(&Outcome::Underpowered, 1e-6);
        assert!(!note.contains("the clock's controls"), "{note}");
    }

    #[test]
    fn what_is_not_a_number_shows_nothing() {
        let found = |shown: EfficiencyTest| shown.outcome(Some(1.0), 1e-6, 1e-6, Some(0.1));
        assert_eq!(found(shown(0.01, 1e-3)), Outcome::Pass);
        assert_eq!(found(shown(0.01, 0.1)), Outcome::Underpowered);
        assert_eq!(found(shown(0.01, f64::NAN)), Outcome::Underpowered);
        assert_eq!(found(shown(f64::NAN, 1e-3)), Outcome::Underpowered);
    }
}
