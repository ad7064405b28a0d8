//! One experiment, one record, byte for byte: on any threads, in any blocks, in any folder, in pieces.

use std::collections::BTreeMap;

use serde_json::Value;

use super::work::{IMAGE, Work, edit, probe, replaced, same};

type Files = BTreeMap<String, Vec<u8>>;

fn record(work: &Work, out: &str, options: &str) -> Files {
    work.run(&format!("run x.toml -q --out {out} {options}")).exits(0);
    work.record(out)
}

/// The record of a text in a folder of its own.
fn fresh(text: &str) -> Files {
    record(&Work::with(text), "results", "")
}

/// The arrays of a record.
fn arrays(files: &Files) -> Files {
    files
        .iter()
        .filter(|(name, _)| name.ends_with(".npy"))
        .map(|(n, b)| (n.clone(), b.clone()))
        .collect()
}

fn json(files: &Files) -> Value {
    serde_json::from_slice(&files["record.json"]).expect("JSON")
}

/// Bytes of the observables, keyed by hash of the cell's content and estimator.
fn observables(files: &Files) -> BTreeMap<(String, String), Vec<u8>> {
    let text = |value: &Value| value.as_str().expect("a text").to_string();
    let mut observables = BTreeMap::new();
    for cell in json(files)["cells"].as_array().expect("cells") {
        for run in cell["runs"].as_array().expect("runs") {
            let key = (text(&cell["content_hash"]), text(&run["estimator"]));
            let before = observables.insert(key, files[&text(&run["moments"])].clone());
            assert!(before.is_none(), "two cells are the same");
        }
    }
    observables
}

#[test]
fn threads_blocks_and_folders_change_no_byte() {
    for text in [IMAGE.to_string(), probe()] {
        let work = Work::with(&text);
        let first = record(&work, "first", "");
        for threads in [1, 2, 7] {
            let other = record(&work, &format!("t{threads}"), &format!("--threads {threads}"));
            same(&first, &other, &format!("{threads} threads"));
        }
        for passes in [1, 3, 16, 1000] {
            let options = format!("--threads 2 --block-passes {passes}");
            let other = record(&work, &format!("b{passes}"), &options);
            same(&first, &other, &format!("blocks of {passes} passes"));
        }
        same(&first, &fresh(&text), "another folder");
        same(&first, &record(&work, "first", ""), "run again");
    }
}

#[test]
fn a_pilots_budget_is_the_same_on_any_threads() {
    let text = replaced(&probe(), "passes = 100", "relative_error = { at_most = 0.05 }");
    let work = Work::with(&text);
    let first = record(&work, "first", "--threads 1");
    let passes = json(&first)["cells"][0]["runs"][0]["passes"].as_u64().expect("passes");
    assert!(passes >= 128, "{passes}");
    same(&first, &record(&work, "second", "--threads 7 --block-passes 5"), "7 threads");
}

#[test]
fn more_passes_keep_those_that_were_run() {
    for text in [IMAGE.to_string(), probe()] {
        let passes = |n: u64| replaced(&text, "passes = 100", &format!("passes = {n}"));
        let work = Work::with(&passes(50));
        let mut before = record(&work, "results", "");
        // 300 passes are kept in wider batches than 100.
        for n in [100, 300, 50, 2] {
            work.write("x.toml", &passes(n));
            let grown = record(&work, "results", "--threads 2 --block-passes 7");
            same(&grown, &fresh(&passes(n)), &format!("{n} passes, in pieces and at once"));
            assert_ne!(arrays(&before), arrays(&grown));
            before = grown;
        }
    }
}

fn swept(values: &str) -> String {
    let sweep = format!("[[sweep]]\nkey = \"object.shape.sphere.radius_mm\"\nvalues = {values}\n");
    probe().replace("passes = 100", "passes = 20") + &sweep
}

#[test]
fn the_order_of_a_sweep_changes_no_number() {
    let forward = observables(&fresh(&swept("[1.0, 1.5, 2.0]")));
    assert_eq!(forward.len(), 6);
    assert_eq!(forward, observables(&fresh(&swept("[2.0, 1.0, 1.5]"))));
    for (key, bytes) in observables(&fresh(&swept("[1.5]"))) {
        assert_eq!(forward.get(&key), Some(&bytes), "a cell by itself");
    }
    let mut numbers: Vec<&Vec<u8>> = forward.values().collect();
    numbers.sort();
    numbers.dedup();
    assert_eq!(numbers.len(), 6, "cells and estimators have numbers of their own");
}

#[test]
fn what_names_the_streams_and_what_does_not() {
    let base = fresh(&probe());
    let numbers = |old: &str, new: &str| arrays(&fresh(&replaced(&probe(), old, new)));
    for (old, new) in [("seed = 7", "seed = 8"), ("name = \"mis\"", "name = \"path\"")] {
        let other = numbers(old, new);
        let mis = &arrays(&base)["cells/000/000.observables.npy"];
        assert!(other.values().all(|bytes| bytes != mis), "{new} changes the numbers");
    }
    let claim = "seed = 7\ndescription = \"something\"\ndisplay.exposure_stops = 2\n\
                 claim = [{ agree = { estimators = [\"mis\", \"analog\"], detect = 0.5 } }]";
    assert_eq!(numbers("seed = 7", claim), arrays(&base), "claims and words are no part of the numbers");
    let reversed = {
        let (head, tail) = IMAGE.split_once("[[estimator]]").expect("estimators");
        let entries: Vec<&str> = tail.split("[[estimator]]").collect();
        format!("{head}[[estimator]]{}[[estimator]]{}", entries[1], entries[0])
    };
    let (forward, backward) = (observables(&fresh(IMAGE)), observables(&fresh(&reversed)));
    assert_eq!(forward, backward, "the order of the estimators");
}

/// The same boundary in two forms: cells that differ in their words alone.
fn boundaries(more: &str) -> String {
    edit("passes = 100", "passes = 20")
        + more
        + "[[sweep]]\nname = \"form\"\nkeys = [\"object.boundary\"]\n\
           rows = [{ label = \"grey\", values = [{ smooth = { eta = 1.3 } }] },\n\
                   { label = \"bands\", values = [{ smooth = { eta = [1.3, 1.3, 1.3] } }] }]\n\
           [[claim]]\nagree = { estimators = [\"mis\"], across = \"form\", detect = 0.5 }\n"
}

#[test]
fn paired_cells_share_their_streams() {
    for (more, is_paired) in [("", false), ("[pair]\nover = [\"object.boundary\"]\n", true)] {
        let files = fresh(&boundaries(more));
        for run in [0, 1] {
            for kind in ["observables", "pixels"] {
                let [grey, bands] =
                    [0, 1].map(|cell| &files[&format!("cells/{cell:03}/{run:03}.{kind}.npy")]);
                assert_eq!(grey == bands, is_paired, "{run} {kind}");
            }
        }
        assert_ne!(json(&files)["cells"][0]["content_hash"], json(&files)["cells"][1]["content_hash"]);
        let comparisons = json(&files)["comparisons"].to_string();
        assert!(comparisons.contains(&format!("\"paired\":{is_paired}")), "{comparisons}");
    }
    // Paired over something else, they do not.
    let files = fresh(&boundaries("[pair]\nover = [\"object.shape\"]\n"));
    assert_ne!(files["cells/000/000.observables.npy"], files["cells/001/000.observables.npy"]);
}

/// The furnace of `init`, whose claim holds, in 64 passes of one estimator and without its claim.
fn furnace() -> (Work, String, String) {
    let work = Work::new();
    work.run("init x.toml").exits(0);
    let text = work.read("x.toml").replace("\"first-sphere\"", "\"x\"");
    let (head, tail) = text.split_once("[[claim]]").expect("a claim");
    let (_, settings) = tail.split_once("# Named").expect("settings");
    (work, text.clone(), format!("{head}# {settings}"))
}

/// The claim is judged green where it was made before the passes, and not where it came after.
#[track_caller]
fn is_post_hoc(work: &Work, options: &str) {
    let ran = work.run(&format!("verify x.toml -q {options}"));
    ran.exits(3).says("post hoc").says("0 of 9 verdicts are green");
}

#[test]
fn claims_made_after_the_run_are_not_green() {
    let (work, claimed, bare) = furnace();
    work.write("x.toml", &claimed);
    work.run("verify x.toml -q --out claimed").exits(0).says("9 of 9 verdicts are green");

    work.write("x.toml", &bare);
    let before = record(&work, "results", "");
    work.write("x.toml", &claimed);
    is_post_hoc(&work, "");
    same(&arrays(&before), &arrays(&work.record("results")), "a claim changes no number");
    assert_eq!(json(&work.record("results"))["post_hoc"].to_string(), "[0]");
    // Nothing makes it valid except another seed: neither a second look, nor more or fewer passes.
    is_post_hoc(&work, "");
    for passes in [100, 64, 32, 300, 100] {
        is_post_hoc(&work, &format!("--set budget.passes={passes}"));
    }
    work.run("verify results/x").exits(3).says("post hoc");
    work.run("verify x.toml -q --set seed=5 --replace").exits(0).says("9 of 9 verdicts are green");

    // A claim that was there stays evidence beside one that came later.
    work.write(
        "x.toml",
        &(claimed.clone() + "[[claim]]\nequals = { value = 1.0, source = \"x\", detect = 0.1 }\n"),
    );
    let ran = work.run("verify x.toml -q --out claimed");
    ran.exits(3).says("post hoc").says("9 of 18 verdicts are green");
    work.write("x.toml", &claimed.replace("detect = 0.05", "detect = 0.06"));
    is_post_hoc(&work, "--out claimed");
}

/// A budget in seconds is turned into passes once: the same command resumes with that number instead of
/// timing itself again, and a complete run is not repeated.
#[test]
fn a_budget_in_seconds_is_fixed_once() {
    let work = Work::with(&replaced(&probe(), "budget.passes = 100", "budget.cpu_seconds = 0.05"));
    work.run("run x.toml -q").exits(0);
    let first = work.record("results");
    for _ in 0..3 {
        work.run("run x.toml -q").exits(0);
        assert_eq!(work.record("results"), first);
    }
}

/// A budget in seconds gives other passes each time; those of a record give its bits again.
#[test]
fn a_budget_in_seconds_comes_again_by_the_passes_of_its_record() {
    let work = Work::with(&edit("budget.passes = 100", "budget.cpu_seconds = 0.2"));
    let first = record(&work, "first", "");
    same(&first, &record(&work, "again", "--passes-of first"), "with the passes of the first");
    // The state of an earlier run in that folder is not used.
    work.run("run x.toml -q --out other --set budget.cpu_seconds=0.4").exits(0);
    same(
        &first,
        &record(&work, "other", "--passes-of first"),
        "in a folder with a state of another budget",
    );
    let compared = work.run("compare first/x again/x");
    compared
        .exits(0)
        .says("identical: all")
        .says("the records are byte-identical")
        .says("ratios are compatible");
    let other =
        work.run("run x.toml -q --out no --passes-of first --set object.boundary.rough.alpha=0.4");
    other.exits(3).complains("of another experiment than the file").complains("compare");
    work.run("run x.toml -q --out no --passes-of nowhere").exits(3).complains("no record here");
    let samplers = concat!(env!("CARGO_MANIFEST_DIR"), "/experiments/verify/samplers.toml");
    let refused = work.run(&format!("run {samplers} -q --passes-of first"));
    refused.exits(2).complains("no passes to take").complains("leave --passes-of out");
    work.run("run x.toml -q --out third --set object.boundary.rough.alpha=0.4").exits(0);
    work.run("compare first/x third/x").says("the records are not byte-identical");
}

/// The shares of the budget that match a run multiply, and its passes are the first of those of any larger budget.
#[test]
fn a_share_of_the_budget_is_its_first_passes() {
    let sweep = "[[sweep]]\nkey = \"object.medium.coefficients.albedo\"\nvalues = [0.9, 0.5]\n";
    let shares = "[[budget_share]]\nestimators = [\"analog\"]\nshare = 0.5\n\
                  [[budget_share]]\nwhere = { albedo = \"0.5\" }\nshare = 0.25\n\
                  [[budget_share]]\nwhere = { albedo = \"0.9\" }\nshare = 2\n";
    let text = probe() + sweep;
    let work = Work::with(&format!("{text}{shares}"));
    work.run("run x.toml -q --set budget.passes=64").exits(0);
    let shared = work.record("results");
    let record = json(&shared);
    let passes = |cell: usize, run: usize| record["cells"][cell]["runs"][run]["passes"].as_u64();
    let all = [passes(0, 0), passes(0, 1), passes(1, 0), passes(1, 1)];
    assert_eq!(all, [128, 64, 16, 8].map(Some));
    let quarter = Work::with(&text);
    quarter.run("run x.toml -q --set budget.passes=16").exits(0);
    let quarter = observables(&quarter.record("results"));
    let shared = observables(&shared);
    let same = quarter.iter().filter(|(run, bytes)| shared[*run] == **bytes).count();
    assert_eq!(same, 1, "one run of four has 16 passes in both");
}

/// With `only_claimed`, an estimator runs where a claim names it and nowhere else, on the same streams;
/// cells without a claim stay empty, and the report of such a record is made.
#[test]
fn only_what_claims_name_is_run() {
    let sweep = "[[sweep]]\nkey = \"object.medium.coefficients.albedo\"\nvalues = [0.9, 0.5]\n";
    let claim = "[[claim]]\nequals = { estimator = \"mis\", value = 0.1, source = \"a guess\", \
                 where = { albedo = \"0.5\" } }\n";
    let text = probe() + sweep + claim;
    let all = fresh(&text);
    let work = Work::with(&format!("only_claimed = true\n{text}"));
    work.run("run x.toml -q").exits(0);
    let claimed = work.record("results");
    let runs = |files: &Files| -> Vec<usize> {
        let record = json(files);
        let cells = record["cells"].as_array().expect("cells");
        cells.iter().map(|cell| cell["runs"].as_array().expect("runs").len()).collect()
    };
    assert_eq!((runs(&all), runs(&claimed)), (vec![2, 2], vec![0, 1]));
    for (run, bytes) in observables(&claimed) {
        assert!(observables(&all)[&run] == bytes, "{run:?} differs where all run");
    }
    work.run("report results/x").exits(0);
    let nothing = Work::with(&format!("only_claimed = true\n{}", probe()));
    nothing.run("check x.toml").exits(2).complains("no claim names an estimator");
}
