//! Ctrl-C and kill -9 in the middle of a run: what was played is kept, and the same command goes on to
//! the same bytes.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use super::work::{IMAGE, Work, replaced, same, states};

/// Two measurements of about a second each on one thread.
fn long() -> String {
    replaced(IMAGE, "passes = 100", "passes = 6000")
}

const RUN: &str = "run x.toml -q --threads 1 --block-passes 50";

/// The record of an uninterrupted run.
static WHOLE: LazyLock<BTreeMap<String, Vec<u8>>> = LazyLock::new(|| {
    let work = Work::with(&long());
    work.run("run x.toml -q").exits(0);
    work.record("results")
});

/// Passes that each state holds.
fn passes(work: &Work) -> Vec<u64> {
    let header = |bytes: Vec<u8>| -> serde_json::Value {
        let (length, rest) = bytes.split_first_chunk::<8>().expect("a length");
        serde_json::from_slice(&rest[..u64::from_le_bytes(*length) as usize]).expect("a header")
    };
    let states = work.files("results/x/state").into_values().map(header);
    let mut passes: Vec<u64> = states.map(|h| h["tally"]["passes"].as_u64().expect("a count")).collect();
    passes.sort_unstable();
    passes
}

/// Stops the program while its second measurement is under way.
fn stopped(work: &Work, signal: &str) -> super::work::Ran {
    let mut program = work.start(RUN);
    let root = work.path("results/x");
    program.wait_until("its first measurement is complete", || states(&root) == 1);
    std::thread::sleep(std::time::Duration::from_millis(150));
    program.signal(signal);
    program.end()
}

#[test]
fn ctrl_c_keeps_what_was_played() {
    for signal in ["INT", "TERM"] {
        let work = Work::with(&long());
        let ran = stopped(&work, signal);
        ran.exits(130).complains("interrupted: 1 of 2 measurements are complete");
        ran.complains("are kept in results/x").complains("the same command goes on");
        assert!(!work.path("results/x/record").exists(), "no record of half a run");
        let kept = passes(&work);
        assert!(kept.len() == 2 && kept[0] > 0 && kept[0] < 6000 && kept[1] == 6000, "{kept:?}");
        work.run(RUN).exits(0);
        same(&work.record("results"), &WHOLE, "after Ctrl-C");
        assert_eq!(passes(&work), [6000, 6000]);
    }
}

#[test]
fn kill_9_keeps_what_was_saved() {
    let work = Work::with(&long());
    let ran = stopped(&work, "KILL");
    ran.check(ran.code().is_none(), "it was killed");
    assert!(!work.path("results/x/record").exists(), "no record of half a run");
    assert_eq!(passes(&work), [6000], "the finished measurement is on disk");
    // On other threads and blocks, and stopped once more on the way.
    work.run("run x.toml -q --threads 2 --block-passes 7").exits(0);
    same(&work.record("results"), &WHOLE, "after kill -9");
}

/// A run that is stopped while it extends a record leaves the record as it was.
#[test]
fn an_earlier_record_outlives_an_interrupted_run() {
    let work = Work::with(&replaced(IMAGE, "passes = 100", "passes = 16"));
    work.run("run x.toml -q").exits(0);
    let earlier = work.record("results");
    work.write("x.toml", &long());
    let mut program = work.start(RUN);
    std::thread::sleep(std::time::Duration::from_millis(200));
    program.wait_until("it works", || true);
    program.signal("INT");
    program.end().exits(130);
    same(&work.record("results"), &earlier, "after Ctrl-C");
    work.run(RUN).exits(0);
    same(&work.record("results"), &WHOLE, "extended");
}
