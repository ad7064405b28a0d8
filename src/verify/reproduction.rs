//! Claims that a record comes out again, bit for bit.

use super::trial::{Claim, Evidence, Item, Trial, blank};
use super::verdict::Verdict;
use crate::results::record::Replay;
use crate::results::store::Stored;

/// One trial for every measurement that was played again, and one for the checksum that a claim states.
pub(super) fn trials(stored: &Stored) -> Vec<Trial> {
    let record = &stored.record;
    let claims = record.claims.as_array().map_or(&[][..], Vec::as_slice).iter().enumerate();
    let mut trials = Vec::new();
    for (index, entry) in claims.filter(|(_, entry)| !entry["reproduces"].is_null()) {
        let claim = Claim::of(record, index);
        let trial = |verdict: Verdict, evidence| Trial {
            item: Item::Table,
            claim: claim.clone(),
            claim_index: index,
            evidence,
            detect: None,
            one_look: true,
            reference: None,
            verdict,
        };
        let mut wanted = record
            .cells
            .iter()
            .enumerate()
            .flat_map(|(cell, c)| c.runs.iter().map(move |run| (cell, run)));
        trials.extend(wanted.by_ref().map(|(cell, run)| {
            let found = record.replays.iter().find(|r| r.cell == cell && r.estimator == run.estimator);
            let verdict = Verdict {
                cell: record.cells[cell].label.clone(),
                estimators: run.estimator.clone(),
                test: "replay".into(),
                value: found.map_or(f64::NAN, |r| r.passes as f64),
                ..blank(record, &claim)
            };
            trial(verdict, found.map_or_else(missing, compared))
        }));
        if let Some(numbers) = entry["reproduces"]["numbers"].as_str() {
            let verdict = Verdict { test: "checksum".into(), ..blank(record, &claim) };
            let found = stored.numbers();
            let differs =
                format!("the record's numbers have the checksum {found}, the claim wants {numbers}");
            let evidence = bits((found != numbers).then_some(differs));
            trials.push(trial(verdict, evidence));
        }
    }
    trials
}

fn missing() -> Evidence {
    Evidence::None("nothing was played again: the claim came after the run".into())
}

/// The same bits, or why not.
fn bits(differs: Option<String>) -> Evidence {
    Evidence::Exact { holds: differs.is_none(), said: differs.unwrap_or("the same bits".into()) }
}

fn compared(replay: &Replay) -> Evidence {
    let differs = || format!("the first {} passes came out with other bits", replay.passes);
    bits((replay.recorded != replay.replayed).then(differs))
}
