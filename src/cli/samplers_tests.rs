//! Experiments on samplers, from the file to verdicts: correct samplers pass, and each planted defect is
//! found by the test that is meant to find it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::experiment::schema::{SamplerClaim, SamplerEntry};
use crate::experiment::{Experiment, Registry, Sources};
use crate::results::store::{RecordFolder, Stored};
use crate::run::interrupt::Interrupt;
use crate::run::{Options, Remeasured, retest, run};
use crate::samplers::SamplerKind;
use crate::samplers::phase::HenyeyGreensteinSampler;
use crate::samplers::{Contrast, Coordinate, Discrete, Draw, Null, Piece, Sampler};
use crate::sampling::stream::Stream;
use crate::verify::judge::{Case, Judgement, Looks, Measured, judge, judge_alone};
use crate::verify::verdict::{Outcome, Verdict};
use serde_json::{Value, json};

/// A Henyey-Greenstein sampler whose density is off by the factor 1 + r (mu - g), which keeps its
/// integral; with `flip`, both draw and density belong to -g.
struct Phase {
    inner: HenyeyGreensteinSampler,
    cosine: Contrast,
    g: f64,
    error: f64,
    flip: bool,
}

impl Phase {
    fn factor(&self, at: [f64; 2]) -> f64 {
        if self.error == 0.0 { 1.0 } else { 1.0 + self.error * ((self.cosine.of)(0, at) - self.g) }
    }
}

impl Sampler for Phase {
    fn draw(&self, stream: &mut Stream) -> Draw {
        match self.inner.draw(stream) {
            Draw::Point { piece, at, density } => {
                Draw::Point { piece, at, density: density * self.factor(at) }
            }
            other => other,
        }
    }

    fn pieces(&self) -> Vec<Piece> {
        self.inner.pieces()
    }

    fn density(&self, piece: usize, at: [f64; 2]) -> f64 {
        self.inner.density(piece, at) * self.factor(at)
    }

    fn contrasts(&self) -> Vec<Contrast> {
        let mut contrasts = self.inner.contrasts();
        if self.flip {
            contrasts[0].expected = contrasts[0].expected.map(|g| -g);
        }
        contrasts
    }
}

/// A line with density 0.7 * 2x, outcomes `a` (0.15) and `b` (0.05), and nothing (0.1); and its defects.
struct Mixture {
    defect: String,
    last: Mutex<Option<f64>>,
    draws: AtomicU64,
}

impl Mixture {
    fn has(&self, defect: &str) -> bool {
        self.defect == defect
    }

    fn draw_line(&self, u: f64) -> Draw {
        let x = u.sqrt();
        let mut density = self.density(0, [x, 0.5]);
        if self.has("own density") {
            density *= 1.0 + 3e-9;
        }
        Draw::Point { piece: 0, at: [x, 0.5], density }
    }
}

impl Sampler for Mixture {
    fn draw(&self, stream: &mut Stream) -> Draw {
        let mut u = stream.draw();
        if self.has("reused") {
            // Every second draw is the last one, half a turn on: its own distribution is right.
            let mut last = self.last.lock().expect("one thread");
            u = match last.take() {
                Some(last) => (last + 0.5).fract(),
                None => *last.insert(u),
            };
        }
        if self.has("outside") && self.draws.fetch_add(1, Ordering::Relaxed) == 777 {
            return Draw::Point { piece: 0, at: [1.0 + 1e-9, 0.5], density: 1.4 };
        }
        if self.has("no number") && self.draws.fetch_add(1, Ordering::Relaxed) == 777 {
            return Draw::Point { piece: 0, at: [f64::NAN, 0.5], density: f64::NAN };
        }
        match u {
            u if u < 0.15 => Draw::Delta { index: 0, exact: !self.has("inexact") },
            u if u < 0.2 => Draw::Delta { index: 1, exact: true },
            u if u < 0.3 && self.has("nulls tried again") => self.draw(stream),
            u if u < 0.3 => Draw::Null,
            u => self.draw_line((u - 0.3) / 0.7),
        }
    }

    fn pieces(&self) -> Vec<Piece> {
        vec![Piece::line("line", Coordinate::over(0.0, 1.0))]
    }

    fn density(&self, _piece: usize, [x, _]: [f64; 2]) -> f64 {
        let scale = match self.defect.as_str() {
            "not normalised" => 0.9,
            "unresolved" => 1.0 + 0.5 * (1e9 * x * x).sin(),
            "negative" => -1.0,
            "no density" => f64::NAN,
            _ => 1.0,
        };
        1.4 * x * scale
    }

    fn deltas(&self) -> Vec<Discrete> {
        // Ten standard deviations of `b` in 200000 draws; 7.7 are found with 99 % probability.
        let shift = if self.has("delta") { 0.005 } else { 0.0 };
        vec![
            Discrete { name: "a".into(), mass: 0.15 + shift },
            Discrete { name: "b".into(), mass: 0.05 - shift },
        ]
    }

    fn null(&self) -> Null {
        match self.defect.as_str() {
            "remainder" => Null::Remainder,
            "never" => Null::Never,
            _ => Null::Stated(0.1),
        }
    }

    fn contrasts(&self) -> Vec<Contrast> {
        // By quadrature: 0.7 * 2/3.
        vec![Contrast { name: "x", of: Box::new(|_, [x, _]| x), expected: None }]
    }
}

fn registry() -> Registry {
    let phase = SamplerKind {
        kind: "phase",
        doc: "",
        options_schema: || unreachable!("files are made here"),
        build: |options| {
            let number = |key: &str| options[key].as_f64().unwrap_or(0.0);
            let (g, flip) = (number("g"), options["flip"] == true);
            let g = if flip { -g } else { g };
            let inner = HenyeyGreensteinSampler::new(g);
            let cosine = inner.contrasts().remove(0);
            Ok(Box::new(Phase { inner, cosine, g, error: number("error"), flip }))
        },
    };
    let mixture = SamplerKind {
        kind: "mixture",
        build: |options| {
            let defect = options["defect"].as_str().unwrap_or_default().to_string();
            Ok(Box::new(Mixture { defect, last: Mutex::default(), draws: AtomicU64::default() }))
        },
        ..phase
    };
    Registry { samplers: vec![phase, mixture], ..Registry::default() }
}

fn experiment(name: &str, samples: u64, entries: &[(&str, &str, Value)]) -> Experiment {
    let entry = |(name, kind, options): &(&str, &str, Value)| SamplerEntry {
        name: name.to_string(),
        kind: BTreeMap::from([(kind.to_string(), options.clone())]),
    };
    let sampler: Vec<SamplerEntry> = entries.iter().map(entry).collect();
    let file =
        json!({ "name": name, "samples": samples, "sampler": sampler, "claim": [{ "sampler": {} }] });
    Experiment {
        path: PathBuf::new(),
        file: serde_json::from_value(file).expect("an experiment"),
        cells: Vec::new(),
        axes: Vec::new(),
        settings: Vec::new(),
        origins: Vec::new(),
        sources: Sources::none(),
    }
}

fn options(out: &Path, threads: usize) -> Options {
    Options { threads, quiet: true, ..Options::new(out) }
}

fn ran(experiment: &Experiment) -> Stored {
    let folder = tempfile::tempdir().expect("a folder");
    let run = run(experiment, &registry(), &options(folder.path(), 1), &Interrupt::default());
    run.unwrap_or_else(|error| panic!("{error}")).stored
}

/// The verdicts on one sampler.
fn verdicts(name: &str, samples: u64, kind: &str, options: Value) -> Vec<Verdict> {
    judge_alone(&ran(&experiment(name, samples, &[("it", kind, options)])))
}

/// The tests that did not pass, with their outcomes.
fn red(verdicts: &[Verdict]) -> Vec<String> {
    let red = verdicts.iter().filter(|v| !v.is_green());
    red.map(|v| format!("{}: {}", v.test_name(), v.outcome)).collect()
}

fn of_mixture(defect: &str) -> Vec<Verdict> {
    let name = format!("planted-{}", defect.replace(' ', "-"));
    verdicts(&name, 200_000, "mixture", json!({ "defect": defect }))
}

fn find<'a>(verdicts: &'a [Verdict], test: &str) -> &'a Verdict {
    verdicts.iter().find(|v| v.test_name() == test).unwrap_or_else(|| panic!("no {test}"))
}

#[test]
fn what_is_right_passes_every_test() {
    let mixture = of_mixture("");
    assert_eq!(red(&mixture), Vec::<String>::new());
    let tests: Vec<String> = mixture.iter().map(Verdict::test_name).collect();
    let all = [
        "chi2 coarse",
        "chi2 fine",
        "serial",
        "contrast x",
        "delta a",
        "delta b",
        "null",
        "identity D5",
        "identity D7",
        "outside",
    ];
    assert_eq!(tests, all);
    let contrast = find(&mixture, "contrast x");
    let (expected, error) = contrast.expected.zip(contrast.expected_error).expect("a contrast");
    assert!((expected - 1.4 / 3.0).abs() < 1e-12 && error < 1e-8);
    for g in [-0.99, -0.3, 0.0, 0.8, 0.99] {
        let found = verdicts(&format!("right-{g}"), 200_000, "phase", json!({ "g": g }));
        assert_eq!(red(&found), Vec::<String>::new(), "g {g}");
    }
    assert_eq!(red(&of_mixture("remainder")), Vec::<String>::new());
}

/// r sqrt(Var mu) is the density's relative error in the mean square: where that is what `chi2 coarse`
/// states that it detects, it is found, and a tenth of it is not.
#[test]
fn a_wrong_density_is_found_at_the_detectable_size() {
    let g = 0.5;
    let variance: f64 = (1.0 + 2.0 * g * g) / 3.0 - g * g;
    let right = verdicts("density", 1_000_000, "phase", json!({ "g": g, "error": 0.0 }));
    let size = find(&right, "chi2 coarse").detectable.expect("a size") / variance.sqrt();
    assert!((0.005..0.05).contains(&size), "{size}");
    let wrong = verdicts("density", 1_000_000, "phase", json!({ "g": g, "error": size }));
    assert!(red(&wrong).contains(&"chi2 coarse: fail".into()), "{:?}", red(&wrong));
    // The draws are right, and density, own density and normalisation agree: nothing else may see it.
    for test in ["contrast mean cosine", "identity D5", "identity D7", "outside"] {
        assert_eq!(find(&wrong, test).outcome, Outcome::Pass, "{test}");
    }
    let tenth = verdicts("density", 1_000_000, "phase", json!({ "g": g, "error": 0.1 * size }));
    assert_eq!(red(&tenth), Vec::<String>::new());
}

#[test]
fn a_flipped_axis_is_seen_by_the_contrast_alone() {
    let found = verdicts("flipped", 200_000, "phase", json!({ "g": 0.4, "flip": true }));
    assert_eq!(red(&found), ["contrast mean cosine: fail"]);
}

#[test]
fn each_defect_is_found_by_its_test() {
    for (defect, test, outcome) in [
        ("nulls tried again", "null", "fail"),
        ("delta", "delta b", "fail"),
        ("inexact", "delta a", "fail"),
        ("reused", "serial", "fail"),
        ("own density", "identity D5", "fail"),
        ("outside", "outside", "fail"),
        ("no number", "outside", "fail"),
        ("never", "null", "fail"),
        ("not normalised", "identity D7", "fail"),
        ("not normalised", "chi2 coarse", "invalid"),
        ("unresolved", "identity D7", "invalid"),
        ("unresolved", "chi2 coarse", "invalid"),
        ("unresolved", "contrast x", "invalid"),
        ("negative", "chi2 coarse", "invalid"),
        ("no density", "identity D7", "invalid"),
    ] {
        let found = of_mixture(defect);
        assert_eq!(find(&found, test).outcome.to_string(), outcome, "{defect}: {:?}", red(&found));
    }
    // Found there alone: the marginal distributions are right.
    assert_eq!(red(&of_mixture("reused")), ["serial: fail"]);
    assert_eq!(red(&of_mixture("inexact")), ["delta a: fail"]);
    assert_eq!(red(&of_mixture("own density")), ["identity D5: fail"]);
}

#[test]
fn a_control_passes_where_it_differs_and_detect_may_ask_too_much() {
    let mut wrong =
        experiment("control", 200_000, &[("it", "phase", json!({ "g": 0.4, "error": 0.5 }))]);
    wrong.file.claim[0].expect = Some(crate::experiment::schema::Expect::Differs);
    assert_eq!(find(&judge_alone(&ran(&wrong)), "chi2 coarse").outcome, Outcome::Pass);
    let mut fine = experiment("fine", 10_000, &[("it", "phase", json!({ "g": 0.4 }))]);
    fine.file.claim[0].sampler = Some(SamplerClaim { detect: Some(1e-3), ..SamplerClaim::default() });
    assert_eq!(red(&judge_alone(&ran(&fine))), ["chi2 coarse: underpowered"]);
}

/// 200 samplers that differ in name: p-values below 1/2 and below 1/50 are binomial in number, within
/// 4.5 standard deviations (7e-6).
#[test]
fn p_values_are_uniform() {
    let names: Vec<String> = (0..200).map(|i| format!("sampler {i}")).collect();
    let entries: Vec<(&str, &str, Value)> =
        names.iter().map(|name| (name.as_str(), "mixture", json!({}))).collect();
    let found = judge_alone(&ran(&experiment("uniform", 4_000, &entries)));
    for test in ["chi2 coarse", "serial", "contrast x", "null"] {
        let p: Vec<f64> =
            found.iter().filter(|v| v.test_name() == test).filter_map(|v| v.p_value).collect();
        assert_eq!(p.len(), 200, "{test}");
        for level in [0.5, 0.02] {
            let below = p.iter().filter(|p| **p < level).count() as f64;
            let (mean, variance) = (200.0 * level, 200.0 * level * (1.0 - level));
            // Counts are discrete, and an exact two-sided test errs to the safe side.
            let low = if test == "null" { f64::INFINITY } else { 4.5 * variance.sqrt() };
            assert!(
                below - mean < 4.5 * variance.sqrt() && mean - below < low,
                "{test} {level}: {below}"
            );
        }
    }
}

fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut files = BTreeMap::new();
    for entry in std::fs::read_dir(folder).expect("a folder").map(|e| e.expect("an entry").path()) {
        if entry.is_dir() {
            files.extend(self::files(&entry));
        } else {
            files.insert(entry.clone(), std::fs::read(&entry).expect("a file"));
        }
    }
    files
}

/// Records without the folder that holds them.
fn record(out: &Path, name: &str) -> Vec<(PathBuf, Vec<u8>)> {
    let root = out.join(name).join("record");
    let strip = |(path, bytes): (PathBuf, Vec<u8>)| {
        (path.strip_prefix(&root).expect("inside").to_path_buf(), bytes)
    };
    files(&root).into_iter().map(strip).collect()
}

#[test]
fn records_do_not_depend_on_threads_or_on_what_was_kept() {
    let entries = [("hg", "phase", json!({ "g": 0.7 })), ("mix", "mixture", json!({}))];
    let made = experiment("threads", 100_001, &entries);
    let mut records = Vec::new();
    for threads in [1, 2, 7] {
        let folder = tempfile::tempdir().expect("a folder");
        let go = || {
            run(&made, &registry(), &options(folder.path(), threads), &Interrupt::default())
                .unwrap_or_else(|error| panic!("{error}"));
        };
        go();
        records.push(record(folder.path(), "threads"));
        // A state that was damaged is drawn again; one that was not is taken.
        let states = files(&folder.path().join("threads").join("state"));
        let (path, bytes) = states.first_key_value().expect("a state");
        std::fs::write(path, &bytes[..bytes.len() / 2]).expect("written");
        std::fs::remove_dir_all(folder.path().join("threads").join("record")).expect("removed");
        go();
        records.push(record(folder.path(), "threads"));
    }
    assert!(records.iter().all(|record| *record == records[0]));
    assert!(records[0].iter().any(|(path, _)| path.ends_with("samplers/001.fine.npy")));
}

#[test]
fn an_interrupted_run_goes_on() {
    let folder = tempfile::tempdir().expect("a folder");
    let made = experiment("stopped", 50_000, &[("hg", "phase", json!({ "g": 0.7 }))]);
    let interrupt = Interrupt::default();
    interrupt.raise();
    let stopped = run(&made, &registry(), &options(folder.path(), 2), &interrupt);
    assert_eq!(stopped.err().map(|error| error.exit_code()), Some(130));
    assert!(!RecordFolder::new(folder.path().join("stopped")).exists());
    run(&made, &registry(), &options(folder.path(), 2), &Interrupt::default()).expect("a record");
}

/// A sampler once more, four times as often.
fn second_look<'a>(main: &'a Stored, name: &str) -> Remeasured<'a> {
    let (quantities, samplers) = (Vec::new(), vec![name.to_string()]);
    Remeasured { main: &main.record, quantities, samplers, factor: 4 }
}

#[test]
fn a_second_look_has_streams_of_its_own_and_more_draws() {
    let folder = tempfile::tempdir().expect("a folder");
    let entries = [("hg", "phase", json!({ "g": 0.7 })), ("mix", "mixture", json!({}))];
    let made = experiment("twice", 20_000, &entries);
    let (options, interrupt) = (options(folder.path(), 2), Interrupt::default());
    let main = run(&made, &registry(), &options, &interrupt).expect("a record").stored;
    let again = retest(&made, &registry(), &options, &interrupt, &second_look(&main, "mix"));
    let again = again.expect("a record");
    let [run] = &again.record.samplers[..] else { panic!("one sampler") };
    assert_eq!(
        (run.sampler.as_str(), run.samples, again.record.stage.as_str()),
        ("mix", 80_000, "retest")
    );
    assert_ne!(run.deltas[0].observed, 4 * main.record.samplers[1].deltas[0].observed);
    assert_eq!(red(&judge_alone(&again)), Vec::<String>::new());
}

#[test]
fn the_second_look_decides_what_the_first_cannot() {
    let look = |error: f64| {
        let made = experiment("looks", 20_000, &[("hg", "phase", json!({ "g": 0.7, "error": error }))]);
        let folder = tempfile::tempdir().expect("a folder");
        let (options, interrupt) = (options(folder.path(), 2), Interrupt::default());
        let main = run(&made, &registry(), &options, &interrupt).expect("a record").stored;
        let again = retest(&made, &registry(), &options, &interrupt, &second_look(&main, "hg"));
        (main, again.expect("a record"))
    };
    let (_, sound) = look(0.0);
    let judged = |main: &Stored, retest: Option<&Stored>| judge(&[Case { main, retest }], Looks::Two);
    // Growing defects: one of them has its first look between the two levels.
    let errors = (1..40).map(|i| 0.01 * f64::from(i));
    let found = errors.map(look).find(|(main, _)| !judged(main, None).wanted.is_empty());
    let (main, again) = found.expect("a defect between the levels");
    let waiting = judged(&main, None);
    assert_eq!(waiting.wanted[0].subject, Measured::Sampler("hg".into()));
    let row = |judgement: &Judgement, test: &str| find(&judgement.verdicts, test).clone();
    let test = waiting
        .verdicts
        .iter()
        .find(|v| v.note.contains("needs a second look"))
        .expect("one")
        .test_name();
    assert_eq!(row(&waiting, &test).outcome, Outcome::Fail);
    let confirmed = judged(&main, Some(&again));
    assert!(row(&confirmed, &test).note.ends_with("at both looks"), "{:?}", row(&confirmed, &test));
    let cleared = judged(&main, Some(&sound));
    assert!(row(&cleared, &test).is_green() && cleared.wanted.is_empty(), "{:?}", row(&cleared, &test));
}

#[test]
fn a_claim_that_comes_after_the_draws_is_no_evidence() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut made = experiment("late", 5_000, &[("hg", "phase", json!({ "g": 0.7 }))]);
    let go = |made: &Experiment| {
        let run = run(made, &registry(), &options(folder.path(), 1), &Interrupt::default());
        judge_alone(&run.expect("a record").stored)
    };
    assert_eq!(red(&go(&made)), Vec::<String>::new());
    made.file.claim[0].sampler = Some(SamplerClaim { detect: Some(0.5), ..SamplerClaim::default() });
    assert!(go(&made).iter().all(|v| matches!(v.outcome, Outcome::Invalid(_))));
}
