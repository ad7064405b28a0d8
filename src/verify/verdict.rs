//! Verdicts of verification.

use std::fmt;

use serde::{Serialize, Serializer};

use crate::results::csv_text;
use crate::results::record::{CostMeasure, InvalidReason};

/// The verdict on one comparison. Only a pass is green.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Outcome {
    /// The claim holds, as far as the test can see.
    Pass,
    /// The claim does not hold.
    Fail,
    /// No defect was found, and one as large as the claim wants to see could have been missed.
    Underpowered,
    /// The test would be void, for this reason.
    Invalid(Objection),
}

/// Why a test is void.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Objection {
    /// The reason, where it is one that a control may expect.
    pub reason: Option<InvalidReason>,
    /// The same as a sentence.
    pub said: String,
    /// Passes that would probably remove it over those that there are, where any number would.
    pub passes_factor: Option<f64>,
}

impl Objection {
    /// That a control may expect.
    pub(super) fn new(reason: InvalidReason, said: String) -> Objection {
        Objection { reason: Some(reason), said, passes_factor: None }
    }

    /// That this many times the passes would probably remove.
    pub(super) fn until(self, passes_factor: f64) -> Objection {
        Objection { passes_factor: Some(passes_factor), ..self }
    }
}

/// That no control may expect.
impl<S: Into<String>> From<S> for Objection {
    fn from(said: S) -> Objection {
        Objection { reason: None, said: said.into(), passes_factor: None }
    }
}

impl fmt::Display for Objection {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(&self.said)
    }
}

impl Default for Outcome {
    fn default() -> Outcome {
        Outcome::Invalid("not judged".into())
    }
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

impl Serialize for Outcome {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// The tests that verdicts rest on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum TestKind {
    /// Student's t of a mean against a value.
    T,
    /// Welch's t of two means.
    WelchT,
    /// Student's t of the differences of two runs on the same streams.
    PairedT,
    /// Equality to rounding, where there is no sampling error.
    Identity,
    /// A value without sampling error against one with a stated error.
    StatedError,
    /// Many cells of a claim at once.
    SumOfSquares,
    /// Variance times cost.
    Efficiency(CostMeasure),
    /// Passes that were run again.
    Replay,
    /// The checksum of a record's numbers.
    Checksum,
    /// Draws in few large bins.
    Chi2Coarse,
    /// Draws in many small bins.
    Chi2Fine,
    /// Pairs of consecutive draws.
    Serial,
    /// The mean of this function of a draw.
    Contrast(String),
    /// Probability of this discrete outcome.
    Delta(String),
    /// Draws that return nothing.
    Null,
    /// The density that a draw states against the density function.
    OwnDensity,
    /// All masses against 1.
    TotalMass,
    /// Draws where the density is 0, or outside the chart.
    Outside,
    /// Means of images, a seed being one observation.
    TOfSeeds,
    /// Means of images from the spread of independent pixels.
    TOfPixels,
    /// The squared bias of all pixels.
    SquaredBias,
    /// The same bits in two records.
    Identical,
    /// Two means of unknown correlation.
    SumOfErrors,
}

impl TestKind {
    /// Whether a claim on a sampler makes it.
    pub(crate) fn is_of_sampler(&self) -> bool {
        use TestKind::{
            Chi2Coarse, Chi2Fine, Contrast, Delta, Null, Outside, OwnDensity, Serial, TotalMass,
        };
        matches!(
            self,
            Chi2Coarse
                | Chi2Fine
                | Serial
                | Contrast(_)
                | Delta(_)
                | Null
                | OwnDensity
                | TotalMass
                | Outside
        )
    }
}

impl fmt::Display for TestKind {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            TestKind::T => "t",
            TestKind::WelchT => "welch t",
            TestKind::PairedT => "paired t",
            TestKind::Identity => "identity",
            TestKind::StatedError => "stated error",
            TestKind::SumOfSquares => "sum of z^2",
            TestKind::Efficiency(CostMeasure::Counters) => "efficiency by counters",
            TestKind::Efficiency(CostMeasure::Cpu) => "efficiency by CPU time",
            TestKind::Replay => "replay",
            TestKind::Checksum => "checksum",
            TestKind::Chi2Coarse => "chi2 coarse",
            TestKind::Chi2Fine => "chi2 fine",
            TestKind::Serial => "serial",
            TestKind::Contrast(name) => return write!(f, "contrast {name}"),
            TestKind::Delta(name) => return write!(f, "delta {name}"),
            TestKind::Null => "null",
            TestKind::OwnDensity => "identity D5",
            TestKind::TotalMass => "identity D7",
            TestKind::Outside => "outside",
            TestKind::TOfSeeds => "t of seeds",
            TestKind::TOfPixels => "t of pixels",
            TestKind::SquaredBias => "squared bias",
            TestKind::Identical => "identical",
            TestKind::SumOfErrors => "sum of errors",
        })
    }
}

impl Serialize for TestKind {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// One comparison's verdict; a row of `verdicts.csv`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub(crate) struct Verdict {
    /// Experiment name.
    pub experiment: String,
    /// Cell label; `a vs b` across two.
    pub cell: String,
    /// The cell by its place on the axes of the sweep, for people; `a vs b` across two.
    #[serde(skip)]
    pub cell_title: String,
    /// Band name; `a vs b` across two.
    pub band: String,
    /// Transport class.
    pub class: String,
    /// The estimator, or the sampler; `a vs b` for two.
    pub estimators: String,
    /// The claim's name, or its kind and place in the file.
    pub claim: String,
    /// The test; none where it was not reached.
    pub test: Option<TestKind>,
    /// Its statistic; for an identity the relative deviation.
    pub statistic: Option<f64>,
    /// Two-sided p-value.
    pub p_value: Option<f64>,
    /// Holm's adjusted p-value over the whole verification.
    pub adjusted_p: Option<f64>,
    /// The smallest true difference that would have been rejected with 99 % probability, relative to
    /// the expected value (for claims on `each` class, to the sum of all), or absolute where that is 0.
    pub detectable: Option<f64>,
    /// The outcome; what a control expects has been taken into account.
    pub outcome: Outcome,
    /// Observable name.
    pub observable: String,
    /// Measured value.
    pub value: Option<f64>,
    /// Its standard error, from the spread of the batches.
    pub std_error: Option<f64>,
    /// What it was compared with.
    pub expected: Option<f64>,
    /// The stated or measured standard error of that.
    pub expected_error: Option<f64>,
    /// Degrees of freedom of the test.
    pub dof: Option<f64>,
    /// Adjusted p-value of the second look, where there was one.
    pub second_p: Option<f64>,
    /// The reason for the outcome, as a sentence.
    pub note: String,
    /// Passes that would probably decide it over those that it rests on; none where it is decided, or
    /// where no number is known to.
    #[serde(skip)]
    pub passes_factor: Option<f64>,
    /// Whether it is a control, which expects something other than agreement.
    #[serde(skip)]
    pub control: bool,
}

/// The verdicts as CSV text.
pub(crate) fn to_csv(verdicts: &[Verdict]) -> String {
    csv_text::table(verdicts)
}

/// The verdicts as JSON: an array of objects with the columns as keys; a number that does not apply is
/// null.
pub(crate) fn to_json(verdicts: &[Verdict]) -> String {
    serde_json::to_string(verdicts).unwrap_or_else(|e| panic!("a verdict without JSON: {e}"))
}

/// 0 all green, 1 a claim failed, 3 none failed but some could not be judged.
pub(crate) fn exit_code(verdicts: &[Verdict]) -> u8 {
    let any = |outcome: fn(&Outcome) -> bool| verdicts.iter().any(|v| outcome(&v.outcome));
    if any(|o| *o == Outcome::Fail) {
        1
    } else if any(|o| *o != Outcome::Pass) {
        3
    } else {
        0
    }
}

/// A number, or nothing.
pub(super) fn known(x: f64) -> Option<f64> {
    (!x.is_nan()).then_some(x)
}

impl Verdict {
    /// Whether it counts as evidence for its claim.
    pub(crate) fn is_green(&self) -> bool {
        self.outcome == Outcome::Pass
    }

    /// What the test is called; empty for none.
    pub(crate) fn test_name(&self) -> String {
        self.test.as_ref().map_or_else(String::new, TestKind::to_string)
    }

    /// Sets what was measured and its standard error.
    pub(super) fn set_value(&mut self, value: f64, std_error: f64) {
        (self.value, self.std_error) = (known(value), known(std_error));
    }

    /// Sets what was expected and its standard error.
    pub(super) fn set_expected(&mut self, expected: f64, std_error: f64) {
        (self.expected, self.expected_error) = (known(expected), known(std_error));
    }

    /// How far the value lies from what is expected, as a phrase; nothing where there are no values.
    pub(super) fn deviation(&self) -> String {
        let (Some(value), Some(expected)) = (self.value, self.expected) else { return String::new() };
        let difference = value - expected;
        let relative = 100.0 * difference / expected.abs();
        if relative.is_finite() {
            format!("off by {relative:+.2} %")
        } else {
            format!("off by {difference:+.2e}")
        }
    }
}
