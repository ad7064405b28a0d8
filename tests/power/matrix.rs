//! The blindness matrix: defects against tests, with the number of seeds in which each test was not green.

use std::process::ExitCode;

use super::defects::Planted;
use super::is_sham;
use super::plays::Outcome;

/// Is an outcome as it must be? A defect is caught where `verify` says so by its exit code, and one of
/// the tests that are expected to see it has seen it; the sham has to be green.
pub fn judge(row: &Planted, outcome: &Outcome) -> Result<String, String> {
    let caught = outcome.caught();
    let list = caught.iter().copied().collect::<Vec<_>>().join(", ");
    if is_sham(row.defect) {
        return match outcome.exit {
            0 if caught.is_empty() && !outcome.tests.is_empty() => Ok("green".into()),
            _ => Err(format!("the sham is not green: {list}\n{}", outcome.said)),
        };
    }
    if !matches!(outcome.exit, 0 | 1 | 3) || outcome.tests.is_empty() {
        return Err(format!("no verdict:\n{}", outcome.said));
    }
    if !row.expected.iter().any(|test| caught.contains(test)) {
        return Err(format!("not caught by what should; caught by: {list}"));
    }
    Ok(format!("caught by {list}"))
}

pub fn main(_words: &[String]) -> ExitCode {
    ExitCode::FAILURE
}
