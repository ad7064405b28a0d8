//! What verification says.

use std::fmt;

use crate::results::csv_text::{self, number};

/// What verification says of one comparison. Only a pass is green.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The claim holds, as far as the test can see.
    Pass,
    /// The claim does not hold.
    Fail,
    /// No defect was found, and one as large as the claim wants to see could have been missed.
    Underpowered,
    /// The test would mean nothing, for this reason.
    Invalid(String),
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Outcome::Pass => "pass",
            Outcome::Fail => "fail",
            Outcome::Underpowered => "underpowered",
            Outcome::Invalid(_) => "invalid",
        })
    }
}

/// One comparison's verdict. Numbers that do not apply are NaN.
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    /// Experiment name.
    pub experiment: String,
    /// Cell label; `a vs b` across two.
    pub cell: String,
    /// Band name; `a vs b` across two.
    pub band: String,
    /// Transport class.
    pub class: String,
    /// The estimator; `a vs b` for two.
    pub estimators: String,
    /// The claim's name, or its kind and place in the file.
    pub claim: String,
    /// The test: `t`, `welch t`, `paired t`, `identity`, `stated error`, `sum of z^2`; of `judge` also `t of
    /// seeds`, `t of pixels`, `squared bias`; of `compare` `identical`, `sum of errors`; empty for none.
    pub test: String,
    /// Its statistic; for an identity the relative deviation.
    pub statistic: f64,
    /// Two-sided p-value.
    pub p_value: f64,
    /// Holm's adjusted p-value over the whole verification.
    pub adjusted_p: f64,
    /// The smallest true difference that would have been rejected with 99 % probability, relative to
    /// the expected value (for claims on `each` class, to the sum of all), or absolute where that is 0.
    pub detectable: f64,
    /// The outcome; what a control expects has been taken into account.
    pub outcome: Outcome,
    /// Observable name.
    pub observable: String,
    /// What was measured.
    pub value: f64,
    /// Its standard error, from the spread of the batches.
    pub std_error: f64,
    /// What it was held against.
    pub expected: f64,
    /// The stated or measured standard error of that.
    pub expected_error: f64,
    /// Degrees of freedom of the test.
    pub dof: f64,
    /// Adjusted p-value of the second look, where there was one.
    pub second_p: f64,
    /// The reason for the outcome, as a sentence.
    pub note: String,
    /// It expects something else than agreement.
    pub control: bool,
}

/// Columns of `verdicts.csv`.
pub const COLUMNS: [&str; 20] = [
    "experiment",
    "cell",
    "band",
    "class",
    "estimators",
    "claim",
    "test",
    "statistic",
    "p_value",
    "adjusted_p",
    "detectable",
    "outcome",
    "observable",
    "value",
    "std_error",
    "expected",
    "expected_error",
    "dof",
    "second_p",
    "note",
];

/// The columns that hold numbers.
const NUMBERS: [&str; 10] = [
    "statistic",
    "p_value",
    "adjusted_p",
    "detectable",
    "value",
    "std_error",
    "expected",
    "expected_error",
    "dof",
    "second_p",
];

/// The verdicts as CSV text.
pub fn to_csv(verdicts: &[Verdict]) -> String {
    csv_text::to_text(&COLUMNS, verdicts.iter().map(Verdict::fields))
}

/// The verdicts as JSON: an array of objects with the columns as keys; a number that does not apply is
/// null.
pub fn to_json(verdicts: &[Verdict]) -> String {
    let value = |name: &str, field: String| match field.parse::<f64>() {
        Ok(number) if NUMBERS.contains(&name) && number.is_finite() => serde_json::json!(number),
        _ if NUMBERS.contains(&name) => serde_json::Value::Null,
        _ => serde_json::Value::String(field),
    };
    let object = |v: &Verdict| -> serde_json::Map<String, serde_json::Value> {
        let fields = COLUMNS.iter().zip(v.fields());
        fields.map(|(name, field)| (name.to_string(), value(name, field))).collect()
    };
    serde_json::json!(verdicts.iter().map(object).collect::<Vec<_>>()).to_string()
}

/// 0 all green, 1 a claim failed, 3 none failed but some could not be judged.
pub fn exit_code(verdicts: &[Verdict]) -> u8 {
    let any = |outcome: fn(&Outcome) -> bool| verdicts.iter().any(|v| outcome(&v.outcome));
    if any(|o| *o == Outcome::Fail) {
        1
    } else if any(|o| *o != Outcome::Pass) {
        3
    } else {
        0
    }
}

impl Verdict {
    /// Does it count as evidence for its claim?
    pub fn is_green(&self) -> bool {
        self.outcome == Outcome::Pass
    }

    fn fields(&self) -> Vec<String> {
        vec![
            self.experiment.clone(),
            self.cell.clone(),
            self.band.clone(),
            self.class.clone(),
            self.estimators.clone(),
            self.claim.clone(),
            self.test.clone(),
            number(self.statistic),
            number(self.p_value),
            number(self.adjusted_p),
            number(self.detectable),
            self.outcome.to_string(),
            self.observable.clone(),
            number(self.value),
            number(self.std_error),
            number(self.expected),
            number(self.expected_error),
            number(self.dof),
            number(self.second_p),
            self.note.clone(),
        ]
    }
}
