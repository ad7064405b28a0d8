//! Ctrl-C and kill -9 in the middle of a run: what was run is kept, and the same command resumes and
//! gives the same bytes.

use std::collections::BTreeMap;
use std::sync::LazyLock;
use std::thread::sleep;
use std::time::Duration;

use super::work::{IMAGE, Ran, Work, probe, replaced, same};

const PASSES: u64 = 3000;

/// Two cells: the estimators of one run by turns and end together, cells follow each other.
const CELLS: &str = "[[sweep]]\nname = \"phase\"\nkeys = [\"object.medium.coefficients.g\"]\n\
                     rows = [{ label = \"a\", values = [0.2] }, { label = \"b\", values = [0.3] }]\n";

/// Two measurements of about half a second each on one thread, or of `passes` passes.
fn measured(passes: u64) -> String {
    let text = replaced(IMAGE, "passes = 100", &format!("passes = {passes}"));
    let second = "[[estimator]]\nname = \"analog\"\npath = { roulette = { analog = {} } }\n";
    replaced(&text, second, CELLS)
}

fn long() -> String {
    measured(PASSES)
}

const RUN: &str = "run x.toml -q --threads 1 --block-passes 20";

/// The record of an uninterrupted run.
static WHOLE: LazyLock<BTreeMap<String, Vec<u8>>> = LazyLock::new(|| {
    let work = Work::with(&long());
    work.run("run x.toml -q").exits(0);
    work.record("results")
});

/// Passes that each state holds, ascending.
fn passes(work: &Work) -> Vec<u64> {
    let header = |bytes: Vec<u8>| -> serde_json::Value {
        let (length, rest) = bytes.split_first_chunk::<8>().expect("a length");
        serde_json::from_slice(&rest[..u64::from_le_bytes(*length) as usize]).expect("a header")
    };
    let mut states = work.files("results/x/state");
    states.retain(|name, _| name.ends_with(".state"));
    let level = |node: &serde_json::Value| node[0].as_u64().expect("a level");
    let count = |bytes: Vec<u8>| -> u64 {
        let header = header(bytes);
        let nodes = header["content"]["moments"].as_array().expect("nodes");
        nodes.iter().map(|node| 1 << level(node)).sum()
    };
    let mut passes: Vec<u64> = states.into_values().map(count).collect();
    passes.sort_unstable();
    passes
}

/// Stops the program a while after its first measurement is complete, with the second under way.
fn stopped(work: &Work, signal: &str, after: u64) -> Ran {
    let mut program = work.start(RUN);
    program.wait_until("its first measurement was complete", || passes(work).contains(&PASSES));
    sleep(Duration::from_millis(after));
    program.signal(signal);
    program.end()
}

#[test]
fn ctrl_c_keeps_what_was_run() {
    for signal in ["INT", "TERM"] {
        // How far the second measurement gets is the machine's affair: later where it has not begun.
        let mut found = Vec::new();
        for after in [50, 100, 200, 400] {
            let work = Work::with(&long());
            let ran = stopped(&work, signal, after);
            ran.exits(130).complains("interrupted: 1 of 2 measurements are complete");
            ran.complains("are kept in results/x").complains("the same command resumes");
            assert!(!work.path("results/x/record").exists(), "no record of half a run");
            found = passes(&work);
            if found.len() == 2 && found[0] > 0 {
                assert!(found[0] < PASSES && found[1] == PASSES, "{found:?}");
                work.run(RUN).exits(0);
                same(&work.record("results"), &WHOLE, "after Ctrl-C");
                assert_eq!(passes(&work), [PASSES, PASSES]);
                break;
            }
        }
        assert!(found.len() == 2 && found[0] > 0, "{signal}: nothing was kept of what was under way");
    }
}

#[test]
fn kill_9_keeps_what_was_saved() {
    let work = Work::with(&long());
    let ran = stopped(&work, "KILL", 50);
    ran.check(ran.code().is_none(), "it was killed");
    assert!(!work.path("results/x/record").exists(), "no record of half a run");
    assert_eq!(passes(&work).last(), Some(&PASSES), "the finished measurement is on disk");
    // Goes on with other threads and blocks.
    work.run("run x.toml -q --threads 2 --block-passes 7").exits(0);
    same(&work.record("results"), &WHOLE, "after kill -9");
}

/// A run that is stopped while it extends a record leaves the record as it was.
#[test]
fn an_earlier_record_outlives_an_interrupted_run() {
    let work = Work::with(&measured(16));
    work.run("run x.toml -q").exits(0);
    let earlier = work.record("results");
    work.write("x.toml", &long());
    stopped(&work, "INT", 50).exits(130);
    same(&work.record("results"), &earlier, "after Ctrl-C");
    work.run("report results/x").exits(0);
    work.run(RUN).exits(0);
    same(&work.record("results"), &WHOLE, "extended");
}

/// The kept passes of an interrupted run were seen: a claim made since then is post hoc.
#[test]
fn claims_made_after_an_interruption_are_post_hoc() {
    // Uniform light, so that no rare path carries much.
    let sun = "directional = { toward = [1, 0, 1], irradiance = 1.0 }";
    let text = replaced(&probe(), sun, "environment = { radiance = 1.0 }");
    let text = replaced(&text, "passes = 100", &format!("passes = {PASSES}")) + CELLS;
    let work = Work::with(&text);
    stopped(&work, "INT", 50).exits(130);
    let claim = "[[claim]]\nagree = { estimators = [\"mis\", \"analog\"], detect = 0.5 }\n";
    work.write("x.toml", &(text + claim));
    work.run("verify x.toml -q").exits(3).says("post hoc").says("0 of 6 verdicts are green");
    work.run("verify x.toml -q --out fresh").exits(0).says("6 of 6 verdicts are green");
}
