//! Claims that a record is reproduced bit for bit.

use super::evidence::Evidence;
use super::family::Finding;
use super::trial::{Subject, Trial, blank};
use super::verdict::{TestKind, Verdict};
use crate::results::record::{ClaimKind, Replay};
use crate::results::store::Stored;

/// One trial for every measurement that was run again, and one for the checksum that a claim states.
pub(super) fn trials(stored: &Stored) -> Vec<Trial> {
    let record = &stored.record;
    let mut trials = Vec::new();
    for (index, claim) in record.statements.iter().enumerate() {
        let ClaimKind::Reproduces { numbers } = &claim.kind else { continue };
        let mut push = |verdict: Verdict, evidence| {
            let finding = Finding { one_look: true, ..Finding::new(verdict, evidence) };
            trials.push(Trial::new(record, index, Subject::Whole, finding));
        };
        for (cell, about) in record.cells.iter().enumerate() {
            for run in &about.runs {
                let is_own = |r: &&Replay| r.cell == cell && r.estimator == run.estimator;
                let found = record.replays.iter().find(is_own);
                let verdict = Verdict {
                    cell: about.label.clone(),
                    cell_title: about.title(),
                    estimators: run.estimator.clone(),
                    test: Some(TestKind::Replay),
                    value: found.map(|replay| replay.passes as f64),
                    ..blank(record, claim)
                };
                push(verdict, found.map_or_else(missing, compared));
            }
        }
        if let Some(numbers) = numbers {
            let found = stored.numbers();
            let differs =
                format!("the record's numbers have the checksum {found}, the claim wants {numbers}");
            let verdict = Verdict { test: Some(TestKind::Checksum), ..blank(record, claim) };
            push(verdict, bits((found != *numbers).then_some(differs)));
        }
    }
    trials
}

fn missing() -> Evidence {
    Evidence::Nothing("nothing was run again: the claim was added after the run".into())
}

/// The same bits, or why not.
fn bits(differs: Option<String>) -> Evidence {
    Evidence::Exact { holds: differs.is_none(), said: differs.unwrap_or("the same bits".into()) }
}

fn compared(replay: &Replay) -> Evidence {
    let differs = || format!("the first {} passes came out with other bits", replay.passes);
    bits((replay.recorded != replay.replayed).then(differs))
}
