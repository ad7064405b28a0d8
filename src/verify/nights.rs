//! Evidence that adds up over nights of fresh streams.
//!
//! A defect that is too small for the tests of one night recurs every night. For a valid p-value, P(p <= x) <= x
//! under the hypothesis, e = 1 / (2 sqrt(p)) is a valid e-value: its expectation is at most
//! integral of dp / (2 sqrt(p)) over (0, 1) = 1 (V. Vovk, R. Wang, "E-values: Calibration, combination,
//! and applications", Annals of Statistics 49(3), 2021, the calibrator kappa = 1/2). Nights are
//! independent, so the product over nights is a non-negative supermartingale of expectation at most 1,
//! and by Ville's inequality it ever reaches 1/level with probability at most `level`, however often one
//! looks. With m tests, each at level `LIFE_LEVEL` / m, any false alarm in the whole life of a program
//! has probability at most `LIFE_LEVEL`. The product starts again where what fixes the numbers changes.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::verdict::Verdict;
use crate::math::ln;
use crate::stats::evidence::calibrated;

/// The probability of any false alarm of the accumulated evidence, over all tests and nights.
pub(crate) const LIFE_LEVEL: f64 = 1e-3;

/// The state passed from night to night: a small JSON file.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Nights {
    /// Names of the fresh streams that were counted.
    pub tokens: Vec<String>,
    /// By experiment, claim and quantity.
    pub tests: BTreeMap<String, Accumulated>,
}

/// The evidence of the nights against one statement.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Accumulated {
    /// Fingerprint of what fixes the numbers: another one begins again.
    pub code: String,
    /// Nights counted.
    pub nights: u64,
    /// Natural logarithm of the product of e-values.
    pub log_e: f64,
    /// Largest value so far, which alarms compare with.
    pub peak: f64,
}

impl Nights {
    /// Adds a night of verdicts obtained on the streams `token`; `code` gives of an experiment what
    /// fixes its numbers. False where that night had been counted before: nothing is added then.
    pub(crate) fn add(
        &mut self,
        token: &str,
        verdicts: &[Verdict],
        code: impl Fn(&str) -> String,
    ) -> bool {
        if self.tokens.iter().any(|t| t == token) {
            return false;
        }
        self.tokens.push(token.into());
        for v in verdicts.iter().filter(|v| !v.control) {
            let Some(p) = v.p_value else { continue };
            let code = code(&v.experiment);
            let fresh = Accumulated { code: code.clone(), nights: 0, log_e: 0.0, peak: 0.0 };
            let evidence = self.tests.entry(name(v)).or_insert_with(|| fresh.clone());
            if evidence.code != code {
                *evidence = fresh;
            }
            evidence.nights += 1;
            // A p-value that underflows counts as the smallest number.
            evidence.log_e += calibrated(p.max(f64::MIN_POSITIVE));
            evidence.peak = evidence.peak.max(evidence.log_e);
        }
        true
    }

    /// As the state file holds it.
    pub(crate) fn to_json(&self) -> String {
        serde_json::to_string_pretty(self).unwrap_or_else(|e| panic!("a state without JSON: {e}"))
    }

    /// From the text of a state file, or why it is none.
    ///
    /// # Errors
    /// A text that is not such a state.
    pub(crate) fn from_json(text: &str) -> Result<Nights, String> {
        serde_json::from_str(text).map_err(|error| error.to_string())
    }

    /// The logarithm that raises an alarm.
    pub(crate) fn threshold(&self) -> f64 {
        ln(self.tests.len().max(1) as f64 / LIFE_LEVEL)
    }

    /// The tests whose evidence has reached the threshold, with it.
    pub(crate) fn alarms(&self) -> Vec<(&str, &Accumulated)> {
        let threshold = self.threshold();
        let over = self.tests.iter().filter(|(_, evidence)| evidence.peak >= threshold);
        over.map(|(name, evidence)| (name.as_str(), evidence)).collect()
    }
}

/// What names a test from night to night.
fn name(v: &Verdict) -> String {
    let parts = [&v.experiment, &v.claim, &v.cell, &v.band, &v.observable, &v.class, &v.estimators];
    format!("{} | {}", parts.map(String::as_str).join(" | "), v.test_name())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::sample::judged;
    use crate::verify::judge::judge_alone;

    fn night(p: f64) -> Vec<Verdict> {
        let mut verdicts = judge_alone(&judged(&[("c", 1.0)]));
        verdicts[0].p_value = Some(p);
        verdicts
    }

    fn after(ps: &[f64]) -> Nights {
        let mut nights = Nights::default();
        for (i, p) in ps.iter().enumerate() {
            assert!(nights.add(&format!("night {i}"), &night(*p), |_| "code".into()));
        }
        nights
    }

    #[test]
    fn small_defects_add_up_and_chance_does_not() {
        // e = 5 each night: 5^4 = 625 < 1000 = m / level <= 5^5.
        assert!(after(&[0.01; 4]).alarms().is_empty());
        let nights = after(&[0.01; 5]);
        assert_eq!(nights.alarms().len(), 1);
        assert!((nights.alarms()[0].1.log_e - 5.0 * 5f64.ln()).abs() < 1e-12);
        // p = 0.25 is worth 1, and larger ones count against.
        assert!(after(&[0.25; 100]).tests.values().all(|e| e.log_e.abs() < 1e-12));
        assert!(after(&[0.9]).tests.values().all(|e| e.log_e < 0.0));
    }

    #[test]
    fn a_night_counts_once_and_other_code_begins_again() {
        let mut nights = after(&[0.01; 5]);
        assert!(!nights.add("night 3", &night(1e-9), |_| "code".into()));
        assert!(nights.add("night 9", &night(0.01), |_| "other".into()));
        assert!(nights.alarms().is_empty());
        assert_eq!(nights.tests.values().next().map(|e| e.nights), Some(1));
    }

    #[test]
    fn controls_are_not_evidence() {
        let mut verdicts = night(1e-30);
        verdicts[0].control = true;
        let mut nights = Nights::default();
        nights.add("n", &verdicts, |_| String::new());
        assert!(nights.tests.is_empty());
    }
}
