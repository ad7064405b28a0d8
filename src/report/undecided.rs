//! Verdicts that are neither green nor failed, by cause, and the passes that would decide them.

use crate::verify::verdict::{Outcome, Verdict};

/// As many verdicts of one cause are told in one line and not row by row.
pub(crate) const MANY: usize = 4;

/// More than what is estimated to be enough: both the error and the tail are estimates themselves.
const MARGIN: f64 = 1.2;

/// Undecided verdicts of one experiment for one cause.
#[derive(Debug)]
pub(crate) struct Undecided<'a> {
    /// In the order of the verification.
    pub verdicts: Vec<&'a Verdict>,
    /// Why they are undecided.
    pub cause: String,
}

/// The undecided verdicts, by experiment, outcome and cause; each group where its first verdict is.
pub(crate) fn undecided(verdicts: &[Verdict]) -> Vec<Undecided<'_>> {
    let mut groups: Vec<Undecided> = Vec::new();
    for v in verdicts {
        let cause = match &v.outcome {
            Outcome::Pass | Outcome::Fail => continue,
            Outcome::Underpowered => "the test is too weak for what it has to find".to_string(),
            Outcome::Invalid(why) => why.reason.map_or_else(|| why.said.clone(), |r| r.words().into()),
        };
        let is_same = |group: &&mut Undecided| {
            let first = group.verdicts[0];
            group.cause == cause
                && (&first.experiment, first.outcome.to_string())
                    == (&v.experiment, v.outcome.to_string())
        };
        match groups.iter_mut().find(is_same) {
            Some(group) => group.verdicts.push(v),
            None => groups.push(Undecided { verdicts: vec![v], cause }),
        }
    }
    groups
}

impl Undecided<'_> {
    /// Whether its verdicts are told in one line.
    pub(crate) fn is_many(&self) -> bool {
        self.verdicts.len() >= MANY
    }

    /// How many verdicts of which claims, and why: `97 verdicts of rejection are invalid (quadrature,
    /// red): heavy tail`.
    pub(crate) fn sentence(&self) -> String {
        let first = self.verdicts[0];
        let mut claims: Vec<&str> = Vec::new();
        for v in &self.verdicts {
            if !claims.contains(&v.claim.as_str()) {
                claims.push(&v.claim);
            }
        }
        let more = if claims.len() > MANY {
            format!("; and {} more", claims.len() - MANY)
        } else {
            String::new()
        };
        claims.truncate(MANY);
        let (count, plural) = match self.verdicts.len() {
            1 => (1, " is"),
            n => (n, "s are"),
        };
        format!(
            "{count} verdict{plural} {} in {} ({}{more}): {}",
            first.outcome,
            first.experiment,
            claims.join("; "),
            self.cause
        )
    }

    /// Passes, or draws, over those that were made that would probably decide all of its verdicts; none
    /// where for one of them no number is known to.
    pub(crate) fn factor(&self) -> Option<f64> {
        let factors = self.verdicts.iter().map(|v| v.passes_factor);
        let largest = factors.reduce(|a, b| Some(a?.max(b?)))??;
        largest.is_finite().then_some(MARGIN * largest)
    }
}

/// A number rounded up to two digits.
pub(crate) fn two_digits_up(x: f64) -> u64 {
    let mut unit = 1.0;
    while x / unit > 100.0 {
        unit *= 10.0;
    }
    ((x / unit).ceil() * unit) as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::record::InvalidReason;
    use crate::verify::verdict::Objection;

    fn verdict(claim: &str, outcome: Outcome, passes_factor: Option<f64>) -> Verdict {
        let experiment = "sample".to_string();
        Verdict { experiment, claim: claim.into(), outcome, passes_factor, ..Verdict::default() }
    }

    #[test]
    fn undecided_verdicts_have_a_line_for_each_cause() {
        let invalid = |reason, said: &str| {
            Outcome::Invalid(Objection { reason, said: said.into(), ..Objection::from("") })
        };
        let tail = |k: u32| invalid(Some(InvalidReason::HeavyTail), &format!("heavy tail: {k}"));
        let mut verdicts: Vec<Verdict> =
            (0..97).map(|k| verdict("a", tail(k), Some(f64::from(k)))).collect();
        verdicts.push(verdict("b", tail(0), Some(2.0)));
        verdicts.push(verdict("b", Outcome::Pass, None));
        verdicts.push(verdict("b", Outcome::Fail, None));
        verdicts.push(verdict("b", Outcome::Underpowered, Some(3.0)));
        verdicts.push(verdict("b", invalid(None, "mis counted 1 of `lost_ray`"), None));
        let groups = undecided(&verdicts);
        let sentences: Vec<String> = groups.iter().map(Undecided::sentence).collect();
        assert_eq!(
            sentences,
            [
                "98 verdicts are invalid in sample (a; b): heavy tail",
                "1 verdict is underpowered in sample (b): the test is too weak for what it has to find",
                "1 verdict is invalid in sample (b): mis counted 1 of `lost_ray`",
            ]
        );
        let factors: Vec<Option<f64>> = groups.iter().map(Undecided::factor).collect();
        assert_eq!(factors, [Some(1.2 * 96.0), Some(1.2 * 3.0), None]);
        assert_eq!(groups.iter().map(Undecided::is_many).collect::<Vec<_>>(), [true, false, false]);
        // One of them that no number of passes decides: then none decides all.
        verdicts[3].passes_factor = None;
        assert_eq!(undecided(&verdicts)[0].factor(), None);
    }

    #[test]
    fn numbers_are_rounded_up() {
        assert_eq!([1.0, 99.5, 100.0, 101.0, 7486.3].map(two_digits_up), [1, 100, 100, 110, 7500]);
    }
}
