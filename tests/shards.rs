//! Shards of a run, and what merges them.

use std::collections::BTreeMap;
use std::fs;
use std::sync::LazyLock;
use std::thread::sleep;
use std::time::Duration;

use super::work::{IMAGE, Work, probe, replaced, same};

/// Two cells, and estimators with different numbers of passes.
const CELLS: &str = "[[sweep]]\nname = \"phase\"\nkey = \"object.medium.coefficients.g\"\nvalues = [0.2, 0.3]\n\
                     [[budget_share]]\nestimators = [\"analog\"]\nshare = 0.7\n";

fn measured(passes: u64) -> String {
    replaced(IMAGE, "passes = 100", &format!("passes = {passes}")) + CELLS
}

/// The record of one process.
static WHOLE: LazyLock<BTreeMap<String, Vec<u8>>> = LazyLock::new(|| whole(&measured(301)));

fn whole(text: &str) -> BTreeMap<String, Vec<u8>> {
    let work = Work::with(text);
    work.run("run x.toml -q").exits(0);
    work.record("results")
}

fn shard(work: &Work, index: u64, count: u64) {
    let command = format!("run x.toml -q --threads 1 --shard {index}/{count}");
    let folder = format!("results/x/shards/{index}-of-{count}");
    work.run(&command).exits(0).says(&format!("shard {index}/{count}: ")).says(&folder);
}

fn shards(work: &Work, count: u64) {
    (1..=count).for_each(|index| shard(work, index, count));
}

#[test]
fn any_number_in_any_order_gives_the_bytes_of_one_run() {
    for (count, stride) in [(1, 1), (2, 1), (3, 2), (8, 3), (64, 27)] {
        let work = Work::with(&measured(301));
        // A stride that is coprime to the number gives every shard once.
        (0..count).for_each(|i| shard(&work, 1 + i * stride % count, count));
        work.run("merge x.toml").exits(0).says("report: results/x/report.html");
        same(&work.record("results"), &WHOLE, &format!("{count} shards"));
        assert!(work.read("results/x/timing.json").contains("cpu_seconds"));
        // The same once more, and a whole run finds nothing left to do.
        work.run("merge x.toml --no-report").exits(0);
        work.run("run x.toml -q").exits(0);
        same(&work.record("results"), &WHOLE, "afterwards");
    }
}

/// Shards from folders of their own, as from other machines.
#[test]
fn shards_may_come_from_elsewhere() {
    let work = Work::with(&measured(301));
    work.run("run x.toml -q --shard 1/2 --out here").exits(0);
    work.run("run x.toml -q --shard 2/2 --out there").exits(0);
    work.run("merge x.toml here/x/shards/1-of-2 there/x/shards/2-of-2").exits(0);
    same(&work.record("results"), &WHOLE, "from two folders");
}

/// What was measured once is not measured again, and the bits are those of one run.
#[test]
fn a_larger_budget_adds_shards() {
    let work = Work::with(&measured(120));
    shards(&work, 3);
    work.run("merge x.toml").exits(0);
    same(&work.record("results"), &whole(&measured(120)), "the first budget");
    work.write("x.toml", &measured(301));
    let ran = work.run("run x.toml -q --shard 1/1");
    // 301 + 211 passes in each of two cells, of which 120 + 84 are there.
    ran.exits(0).says("shard 1/1: 616 passes of 4 measurements");
    work.run("merge x.toml").exits(0);
    same(&work.record("results"), &WHOLE, "more passes");
    // Of the same number as before, too: what was merged gives way.
    let work = Work::with(&measured(120));
    shards(&work, 2);
    work.write("x.toml", &measured(301));
    let ran = work.run("run x.toml -q --shard 2/2");
    ran.exits(3).complains("holds other passes").complains("`scatterproof merge` them first");
    work.run("merge x.toml --set budget.passes=120 --no-report").exits(0);
    shards(&work, 2);
    work.run("merge x.toml").exits(0);
    same(&work.record("results"), &WHOLE, "the same numbers again");
}

#[test]
fn a_killed_shard_resumes() {
    let text = measured(3000);
    let work = Work::with(&text);
    shard(&work, 1, 2);
    let program = work.start("run x.toml -q --threads 1 --block-passes 20 --shard 2/2");
    sleep(Duration::from_millis(200));
    program.signal("KILL");
    program.end();
    let ran = work.run("merge x.toml");
    ran.exits(3).complains("missing: shard 2/2 (not complete)").complains("run x.toml --shard 2/2");
    shard(&work, 2, 2);
    work.run("merge x.toml").exits(0);
    same(&work.record("results"), &whole(&text), "after kill -9");
}

/// A budget by the error reached fixes the same passes in every shard; one by the clock cannot.
#[test]
fn budgets() {
    let text = replaced(&probe(), "budget.passes = 100", "budget.relative_error = { at_most = 0.1 }");
    let work = Work::with(&text);
    shards(&work, 3);
    work.run("merge x.toml").exits(0);
    same(&work.record("results"), &whole(&text), "to an error");

    let seconds = replaced(&probe(), "budget.passes = 100", "budget.cpu_seconds = 0.1");
    let work = Work::with(&seconds);
    let ran = work.run("run x.toml -q --shard 1/2");
    ran.exits(2).complains("a budget in seconds").complains("--passes-of");
    work.run("run x.toml -q --out once").exits(0);
    for index in [1, 2] {
        work.run(&format!("run x.toml -q --shard {index}/2 --passes-of once")).exits(0);
    }
    work.run("merge x.toml --passes-of once").exits(0);
    same(&work.record("results"), &work.record("once"), "the passes of a record");
    work.run("run x.toml --shard 0/2").exits(2).complains("1 <= I <= N");
    work.run("run x.toml --shard 3/2").exits(2);
}

#[test]
fn shards_that_are_not_what_is_needed_are_named() {
    let work = Work::with(&measured(301));
    work.run("merge x.toml").exits(3).complains("there is no shard yet");
    shards(&work, 4);
    let folder = |name: &str| work.path(&format!("results/x/shards/{name}"));
    let refused = |parts: &[&str]| {
        work.run("merge x.toml").exits(3).complains_of(parts);
        assert!(!work.path("results/x/record").exists(), "no record of a part of the run");
    };
    // Missing.
    fs::rename(folder("3-of-4"), work.path("away")).expect("a rename");
    refused(&["no shard holds `0.3 / mis`, 0 to", "missing: shard 3/4", "run x.toml --shard 3/4"]);
    fs::rename(work.path("away"), folder("3-of-4")).expect("a rename");
    // Doubled.
    work.shell("cp -r results/x/shards/2-of-4 results/x/shards/copy").exits(0);
    refused(&["shard 2/4 (results/x/shards/2-of-4) and shard 2/4 (results/x/shards/copy) both hold"]);
    fs::remove_dir_all(folder("copy")).expect("removed");
    // Truncated, flipped, gone: marker and state.
    let state =
        fs::read_dir(folder("2-of-4/state")).expect("states").flatten().next().expect("a state").path();
    for name in [folder("2-of-4/shard.json"), state] {
        let bytes = fs::read(&name).expect("bytes");
        fs::write(&name, &bytes[..bytes.len() - 9]).expect("cut");
        refused(&["2-of-4", "again"]);
        let mut flipped = bytes.clone();
        flipped[bytes.len() / 2] ^= 1;
        fs::write(&name, &flipped).expect("flipped");
        refused(&["2-of-4"]);
        fs::remove_file(&name).expect("removed");
        refused(&["2/4"]);
        fs::write(&name, &bytes).expect("written");
    }
    // Foreign: of another experiment, another program, another file.
    let marker = work.read("results/x/shards/2-of-4/shard.json");
    for (old, new, what) in [
        ("\"experiment\": \"x\"", "\"experiment\": \"y\"", "is of the experiment `y`"),
        ("numerical-", "numerical-1", "another version of the program"),
        ("\"build\": \"", "\"build\": \"0", "another build"),
        ("\"schema\": 1", "\"schema\": 2", "version 2 of shards"),
    ] {
        work.write("results/x/shards/2-of-4/shard.json", &replaced(&marker, old, new));
        refused(&["results/x/shards/2-of-4", what]);
    }
    work.write("results/x/shards/2-of-4/shard.json", &marker);
    work.write("x.toml", &replaced(&measured(301), "albedo = [0.9", "albedo = [0.91"));
    refused(&["shard 1/4 holds `0.2 / mis`, which the experiment does not have"]);
    // A shard that is run again heals; nothing else is run.
    work.write("x.toml", &measured(301));
    work.run("merge x.toml").exits(0);
    same(&work.record("results"), &WHOLE, "when all is well");
}

/// A claim made after a shard was run is made with passes in sight.
#[test]
fn claims_made_between_shards_are_post_hoc() {
    let text = replaced(
        &probe(),
        "directional = { toward = [1, 0, 1], irradiance = 1.0 }",
        "environment = { radiance = 1.0 }",
    );
    let claim = "[[claim]]\nagree = { estimators = [\"mis\", \"analog\"], detect = 0.9 }\n";
    let work = Work::with(&text);
    shard(&work, 1, 2);
    work.write("x.toml", &format!("{text}{claim}"));
    shard(&work, 2, 2);
    work.run("merge x.toml").exits(0);
    work.run("verify x.toml -q").exits(3).says("post hoc");
}

#[test]
fn samplers_are_shared_out_whole() {
    let sampler =
        |name: &str, g: f64| format!("{{ name = \"{name}\", henyey_greenstein = {{ g = {g} }} }}");
    let two = [sampler("a", 0.5), sampler("b", 0.7)].join(", ");
    let text = format!("name = \"x\"\nseed = 1\nsamples = 20000\nsampler = [{two}]\n");
    let work = Work::with(&text);
    shards(&work, 3);
    work.run("merge x.toml").exits(0);
    same(&work.record("results"), &whole(&text), "samplers");
}

/// A shard locks its own folder, and a merge that of the results.
#[test]
fn shards_of_one_number_do_not_meet() {
    let work = Work::with(&measured(3000));
    let first = work.start("run x.toml -q --threads 1 --shard 1/2");
    sleep(Duration::from_millis(150));
    let second = work.start("run x.toml -q --threads 1 --shard 1/2");
    let other = work.start("run x.toml -q --threads 1 --shard 2/2");
    second.end().exits(3).complains("results/x/shards/1-of-2: another process works in this folder");
    first.end().exits(0);
    other.end().exits(0);
}
