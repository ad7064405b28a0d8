//! Work and time by batch, rivals side by side, and claims of efficiency that rest on them.

use std::collections::BTreeMap;

use scatterproof::results::counted_work::FACTORS;
use scatterproof::results::record::{Cell, EstimatorRun};
use scatterproof::results::store::{RecordFolder, Stored};
use scatterproof::verify::weights::{
    DRIFT_LIMIT, TimedRun, WEIGHTS, counted, counter, drift, fit, timed,
};
use serde_json::Value;

use super::work::{IMAGE, Work, probe, replaced, same};

/// A claim by CPU time, so that both estimators are run side by side and `mis` twice.
const BY_TIME: &str =
    "[[claim]]\nfaster = { candidate = \"analog\", baseline = \"mis\", cost = \"cpu\" }\n";

fn stored(work: &Work, out: &str) -> Stored {
    RecordFolder::new(work.path(&format!("{out}/x"))).read().expect("a record")
}

/// 300 passes: 75 batches of 4.
fn three_hundred(text: &str) -> String {
    replaced(text, "passes = 100", "passes = 300")
}

#[test]
fn work_and_time_by_batch_sum_to_their_totals() {
    let work = Work::with(&(three_hundred(&probe()) + BY_TIME));
    work.run("run x.toml -q --threads 2").exits(0);
    let stored = stored(&work, "results");
    let timing = stored.timing.as_ref().expect("a timing");
    let runs = &stored.record.cells[0].runs;
    let names: Vec<&str> = runs.iter().map(|run| run.estimator.as_str()).collect();
    assert_eq!(names, ["mis", "mis (control)", "analog"]);
    assert_eq!(runs[1].control_of.as_deref(), Some("mis"));
    for run in runs {
        for (name, total) in &run.cost {
            let batches = counter(&stored, run, name).expect("counts");
            assert_eq!(batches.len(), 75);
            assert_eq!(batches.iter().sum::<f64>(), *total as f64, "{name} of {}", run.estimator);
        }
        let label = &stored.record.cells[0].label;
        let batches = timing.batches_of(label, &run.estimator).expect("times");
        let total = timing.of(label, &run.estimator).expect("a cost").cpu_seconds;
        let sum: f64 = batches.cpu_seconds.iter().sum();
        assert!((sum / total - 1.0).abs() < 1e-9, "{sum} of {total} s");
        assert_eq!((batches.processes, batches.cpu_seconds.len()), (1, 75));
        // Each worker warms up with one turn, of a batch at most.
        let settled = batches.settled.iter().filter(|settled| **settled).count();
        assert!((73..=74).contains(&settled) && !batches.settled[0], "{:?}", batches.settled);
        // With a claim by CPU time the control arm is the control: nothing runs twice.
        assert_eq!(twice(&batches.twice), 0, "{:?}", batches.twice);
    }
}

/// Batches with passes that ran a second time.
fn twice(batches: &[[f64; 2]]) -> usize {
    batches.iter().filter(|[first, second]| *first > 0.0 && *second > 0.0).count()
}

/// No claim asks for it: the estimators of a cell are interleaved, and the tables' heads say so; of one
/// estimator there is nothing to interleave.
#[test]
fn a_plain_run_is_interleaved() {
    let work = Work::with(&three_hundred(&probe()));
    work.run("run x.toml -q --threads 2").exits(0);
    // Every eighth turn of the first estimator alone runs twice.
    let stored = stored(&work, "results");
    let cell = &stored.record.cells[0];
    for (index, run) in cell.runs.iter().enumerate() {
        let timing = stored.timing.as_ref().expect("a timing");
        let twice = twice(&timing.batches_of(&cell.label, &run.estimator).expect("times").twice);
        assert!(if index == 0 { (4..=16).contains(&twice) } else { twice == 0 }, "{index}: {twice}");
    }
    let rows = work.read("results/x/comparisons.csv");
    let column = |name| rows.lines().next().and_then(|head| head.split(',').position(|c| c == name));
    let [cost, ratio, interleaved] =
        ["cost", "efficiency_ratio", "interleaved"].map(|name| column(name).expect("a column"));
    let fields = rows.lines().skip(1).map(|row| row.split(',').collect::<Vec<_>>());
    let timed: Vec<Vec<&str>> =
        fields.filter(|row| row[cost] == "cpu" && !row[ratio].is_empty()).collect();
    assert!(!timed.is_empty() && timed.iter().all(|row| row[interleaved] == "true"), "{rows}");
    let table = work.read("results/x/report.md");
    assert!(table.contains("interleaved: the estimators of a cell by turns"), "{table}");
    // Equal time, so that the arms have different numbers of passes.
    let timed = Work::with(&replaced(&probe(), "passes = 100", "cpu_seconds = 0.2"));
    timed.run("run x.toml -q --threads 2").exits(0);
    assert!(
        timed.read("results/x/report.md").contains("interleaved: the estimators of a cell by turns")
    );
}

#[test]
fn interleaving_changes_no_byte() {
    for text in [IMAGE.to_string(), probe()] {
        let text = three_hundred(&text);
        // Without a rival there is nothing to interleave.
        let (head, second) = text.split_at(text.rfind("[[estimator]]").expect("a second estimator"));
        let first = Work::with(head);
        first.run("run x.toml -q").exits(0);
        let first_alone = first.record("results");
        let (head, _) = head.split_at(head.rfind("[[estimator]]").expect("a first estimator"));
        let other = Work::with(&format!("{head}{second}"));
        other.run("run x.toml -q").exits(0);
        let alone = [first_alone, other.record("results")];
        let work = Work::with(&(text.clone() + BY_TIME));
        work.run("run x.toml -q --threads 1").exits(0);
        let first = work.record("results");
        // The control of `mis` is run between the two.
        for (run, timed) in [(0, 0), (1, 2)] {
            for kind in ["observables", "costs", "spread", "pixels"] {
                let path = |run: usize| format!("cells/000/{run:03}.{kind}.npy");
                // A probe has no pixels, and then neither record holds any.
                let same = first.get(&path(timed)) == alone[run].get(&path(0));
                assert!(same, "{kind} of run {run} differ from those without a rival");
            }
        }
        assert!(alone[0].contains_key("cells/000/000.observables.npy"));
        assert!(first["cells/000/000.observables.npy"] != first["cells/000/001.observables.npy"]);
        for options in ["--threads 2", "--threads 7", "--threads 2 --block-passes 5"] {
            work.run(&format!("run x.toml -q --out other {options}")).exits(0);
            same(&first, &work.record("other"), options);
            std::fs::remove_dir_all(work.path("other")).expect("removed");
        }
    }
}

#[test]
fn rivals_that_were_interrupted_go_on_to_the_same_bytes() {
    let text = replaced(IMAGE, "passes = 100", "passes = 3000") + BY_TIME;
    let work = Work::with(&text);
    work.run("run x.toml -q --out whole").exits(0);
    let whole = work.record("whole");
    // How far it gets is the machine's affair.
    for after in [200, 400, 800, 1600] {
        let _ = std::fs::remove_dir_all(work.path("results"));
        let program = work.start("run x.toml -q --threads 2");
        std::thread::sleep(std::time::Duration::from_millis(after));
        program.signal("INT");
        if program.end().code() != Some(130) {
            continue;
        }
        let states = work.files("results/x/state").len();
        work.run("run x.toml -q --threads 1").exits(0);
        same(&work.record("results"), &whole, "after Ctrl-C");
        if states == 3 {
            let timing: Value = serde_json::from_str(&work.read("results/x/timing.json")).expect("JSON");
            let batches = &timing["batches"]["base"];
            let processes: Vec<u64> = ["mis", "mis (control)", "analog"]
                .iter()
                .map(|name| batches[*name]["processes"].as_u64().expect("a number"))
                .collect();
            assert_eq!(processes, [2, 2, 2], "{timing}");
            return;
        }
    }
    panic!("it was never interrupted in the middle");
}

/// Times that every run is measured, of which the fastest counts: what else the machine does only adds, for seconds or for
/// minutes, and to some estimators more than to others.
const ROUNDS: usize = 5;

/// Counted work over CPU time: cell, name and kind of every run.
fn counted_over_time(experiment: &str) -> Vec<([String; 3], f64)> {
    let work = Work::new();
    let file = format!("{}/experiments/compare/{experiment}.toml", env!("CARGO_MANIFEST_DIR"));
    work.run(&format!("run {file} -q --threads 1 --set name=x")).exits(0);
    let stored = stored(&work, "results");
    let of_run = |cell: &str, run: &EstimatorRun| {
        let counted: f64 = counted(&stored, run).expect("counts").iter().sum();
        let time = stored.timing.as_ref().expect("a timing").of(cell, &run.estimator);
        let name = [cell.to_string(), run.estimator.clone(), run.kind.clone()];
        (name, counted / time.expect("a time").cpu_seconds)
    };
    let of_cell =
        |cell: &Cell| -> Vec<_> { cell.runs.iter().map(|run| of_run(&cell.label, run)).collect() };
    stored.record.cells.iter().flat_map(of_cell).collect()
}

/// Prints by kind how far counted work is from CPU time, both relative to path tracing in the same cell,
/// and fails where it is farther than stated.
#[test]
#[ignore = "measures CPU time: for the night"]
fn cpu_time_follows_the_counters() {
    const EXPERIMENTS: [&str; 2] = ["counted-transport", "counted-models"];
    let round = |_| EXPERIMENTS.into_iter().flat_map(counted_over_time).collect();
    let rounds: Vec<Vec<_>> = (0..ROUNDS).map(round).collect();
    let fastest = |k: usize| rounds.iter().map(|round| round[k].1).fold(0.0, f64::max);
    let mut found: BTreeMap<&str, f64> = BTreeMap::new();
    let mut path = 0;
    for (k, ([cell, estimator, kind], _)) in rounds[0].iter().enumerate() {
        if estimator == "path" {
            path = k; // the first of its cell
            continue;
        }
        let ratio = fastest(k) / fastest(path);
        let of_rounds = rounds.iter().map(|round| round[k].1 / round[path].1);
        let [least, largest] =
            [of_rounds.clone().fold(f64::INFINITY, f64::min), of_rounds.fold(0.0, f64::max)];
        let most = found.entry(kind).or_insert(1.0);
        *most = most.max(ratio).max(1.0 / ratio);
        println!("{cell:32} {estimator:14} {ratio:.3}, by rounds {least:.3} to {largest:.3}");
    }
    for (kind, stated) in FACTORS {
        println!("{kind:>16}: {:.2} times, stated {stated}", found[kind]);
    }
    // What a busy machine adds.
    let off = FACTORS.iter().find(|(kind, stated)| found[*kind] > 1.15 * stated);
    assert!(off.is_none(), "counted work of {off:?} is {:.2} times off", found[off.expect("one").0]);
}

/// Prints the weights that CPU time of path tracing on this machine asks for, and fails where those of
/// the program are off.
#[test]
#[ignore = "measures CPU time: for the night"]
fn weights_are_those_of_path_tracing() {
    let experiments = concat!(env!("CARGO_MANIFEST_DIR"), "/experiments/compare/nine-cells.toml");
    let round = || {
        let of = |albedo| {
            let work = Work::new();
            let set = format!("--set name=x --set object.medium.coefficients.albedo={albedo}");
            work.run(&format!("run {experiments} -q --threads 1 {set}")).exits(0);
            timed(&stored(&work, "results"))
        };
        ["0.99", "0.8", "0.3"].into_iter().flat_map(of).collect::<Vec<_>>()
    };
    let rounds: Vec<Vec<TimedRun>> = (0..ROUNDS).map(|_| round()).collect();
    let fastest = |k: usize| {
        let nanoseconds = rounds.iter().map(|round| round[k].nanoseconds).fold(f64::INFINITY, f64::min);
        TimedRun { nanoseconds, ..rounds[0][k] }
    };
    let runs: Vec<TimedRun> = (0..rounds[0].len()).map(fastest).collect();
    for round in &rounds {
        println!("one round: drift {:.1} %", 100.0 * drift(round).expect("27 runs"));
    }
    for ((name, weight), fitted) in WEIGHTS.iter().zip(fit(&runs)) {
        println!("{name:>16} {weight:6} ns, fitted {fitted:7.1} ns");
    }
    for run in &runs {
        let predicted: f64 = fit(&runs).iter().zip(run.counts).map(|(w, n)| w * n).sum();
        println!("{:?} {:.3} of the time", run.counts, predicted / run.nanoseconds);
    }
    let drift = drift(&runs).expect("27 runs");
    println!("drift {:.1} %", 100.0 * drift);
    assert!(drift < DRIFT_LIMIT, "the weights are off by {:.1} %", 100.0 * drift);
}
