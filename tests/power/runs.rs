//! Runs of defects: child processes, as many at once as there are cores, and their verdicts.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;
use std::time::Instant;

use scatterproof::results::exr_file::write_exr;
use scatterproof::results::image::Picture;
use scatterproof::results::npy::Array;
use scatterproof::results::record::Band;

use super::defects::{Family, Planted};

/// Output of `verify` on one defect with one seed.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Exit code; -1 where a signal ended it.
    pub exit: i32,
    /// Tests, and what each saw: the worst of its verdicts.
    pub tests: BTreeMap<String, Seen>,
    /// Its printed output.
    pub said: String,
    /// Wall time, seconds.
    pub seconds: f64,
}

/// Result of a test.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Seen {
    /// The test passed: it saw no defect.
    Green,
    /// Underpowered: no evidence of a defect either.
    Underpowered,
    /// A failure, or that the record is worth nothing.
    Defect,
}

impl Outcome {
    /// The tests that saw a defect.
    pub fn caught(&self) -> BTreeSet<&str> {
        let caught = self.tests.iter().filter(|(_, seen)| **seen == Seen::Defect);
        caught.map(|(name, _)| name.as_str()).collect()
    }

    /// Whether `verify` reached a verdict.
    pub fn is_verdict(&self) -> bool {
        matches!(self.exit, 0 | 1 | 3) && !self.tests.is_empty()
    }

    /// Every test is green.
    pub fn is_green(&self) -> bool {
        !self.tests.is_empty() && self.tests.values().all(|seen| *seen == Seen::Green)
    }
}

/// The experiments of this folder, and the family of defects that each is to find.
const EXPERIMENTS: [(Family, &str, &str); 16] = [
    (Family::Tracer, "emission.toml", include_str!("emission.toml")),
    (Family::Tracer, "furnace.toml", include_str!("furnace.toml")),
    (Family::Tracer, "map.toml", include_str!("map.toml")),
    (Family::Tracer, "matched.toml", include_str!("matched.toml")),
    (Family::Tracer, "rough.toml", include_str!("rough.toml")),
    (Family::Tracer, "scale.toml", include_str!("scale.toml")),
    (Family::Tracer, "sky.toml", include_str!("sky.toml")),
    (Family::Tracer, "slab.toml", include_str!("slab.toml")),
    (Family::Subdivision, "alone.toml", include_str!("alone.toml")),
    (Family::Subdivision, "bumpy.toml", include_str!("bumpy.toml")),
    (Family::Subdivision, "subdivision.toml", include_str!("subdivision.toml")),
    (Family::Sampler, "samplers.toml", include_str!("samplers.toml")),
    (Family::Acceptance, "acceptance.toml", include_str!("acceptance.toml")),
    (Family::Acceptance, "thinning.toml", include_str!("thinning.toml")),
    (Family::Cloud, "cloud.toml", include_str!("cloud.toml")),
    (Family::Cloud, "faces.toml", include_str!("faces.toml")),
];

/// Names of the experiments on samplers.
const ON_SAMPLERS: [&str; 3] = ["samplers", "acceptance", "thinning"];

/// A sky of 8 x 4 texels, dim except one next to the zenith.
fn write_sky(path: &Path) {
    let bands = [Band { name: "R".into(), range_nm: None, display_rgb: [1.0; 3] }];
    let mut texels = vec![0.1; 64];
    texels[1] = 3.0;
    write_exr(path, &Picture::new(&bands, &Array::new(vec![2, 4, 8, 1], texels)), &[]).expect("a sky");
}

/// How many experiments of its family a defect is shown to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// All of them: what does each test see?
    Whole,
    /// One after the other until an expected test has failed beyond doubt: is the defect caught?
    UntilCaught,
}

/// The first look at all experiments of a family has fewer tests than this many times those of one: the experiments on
/// clouds have 18 and 9.
fn family_size(family: Family) -> f64 {
    if family == Family::Cloud { 10.0 } else { 1000.0 }
}

/// The family-wise level below which a first look decides by itself (`verify`).
const AT_ONCE: f64 = 5e-7;

/// Runs every pair (defect, number of the seed) and reports each as it ends.
pub fn all(runs: &[(Planted, u64)], extent: Extent, mut tell: impl FnMut(&Planted, u64, &Outcome)) {
    let folder = tempfile::tempdir().expect("a folder");
    for (_, name, text) in EXPERIMENTS {
        fs::write(folder.path().join(name), text).expect("an experiment");
    }
    write_sky(&folder.path().join("sky.exr"));
    let next = AtomicUsize::new(0);
    let workers = std::thread::available_parallelism().map_or(1, usize::from);
    let (send, receive) = mpsc::channel();
    let send = Mutex::new(send);
    std::thread::scope(|scope| {
        for _ in 0..workers {
            let send = send.lock().expect("a sender").clone();
            let (next, folder) = (&next, folder.path());
            scope.spawn(move || {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    let Some((row, seed)) = runs.get(index) else { return };
                    let outcome = run(row, *seed, extent, folder, index);
                    send.send((index, outcome)).expect("a receiver");
                }
            });
        }
        drop(send);
        for (index, outcome) in receive {
            let (row, seed) = &runs[index];
            tell(row, *seed, &outcome);
        }
    });
}

/// One run: in child processes `verify` on the experiments of the defect's family, and its identities.
///
/// Holm's adjusted p-value of a test is at most its p-value times the number of tests: where one
/// experiment alone gives less than `AT_ONCE / family_size`, the whole family would give less than `AT_ONCE`,
/// and the other experiments cannot change the verdict.
fn run(row: &Planted, number: u64, extent: Extent, folder: &Path, index: usize) -> Outcome {
    let out = folder.join(format!("run-{index}"));
    let mine = |family| row.family == Family::Sham || row.family == family;
    let files: Vec<&str> =
        EXPERIMENTS.iter().filter(|(family, ..)| mine(*family)).map(|(_, name, _)| *name).collect();
    let begun = Instant::now();
    let expected_in = |file: &str| {
        let experiment = file.trim_end_matches("toml");
        extent == Extent::UntilCaught && row.expected.iter().any(|test| test.starts_with(experiment))
    };
    let parts = files.iter().copied().filter(|file| expected_in(file));
    let first = |file| verify(row, number, folder, &out, &[file], &["--first-look"]);
    let caught = parts.map(first).find(|(_, table)| {
        let rows = csv_rows(table);
        rows.iter().any(|found| {
            row.expected.contains(&&*test_of(found)) && fails_beyond_doubt(found, row.family)
        })
    });
    let (output, table) = caught.unwrap_or_else(|| verify(row, number, folder, &out, &files, &[]));
    let seconds = begun.elapsed().as_secs_f64();
    let mut tests = seen_in(&table);
    let seen = |broken| if broken { Seen::Defect } else { Seen::Green };
    tests.extend(super::identities(row).into_iter().map(|(name, broken)| (name, seen(broken))));
    let said = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
    let _ = fs::remove_dir_all(&out); // thousands of records would fill the disc
    Outcome { exit: output.status.code().unwrap_or(-1), tests, said: said.into_owned(), seconds }
}

/// What a child process printed that had the defect and verified these files, and its table of verdicts.
fn verify(
    row: &Planted,
    number: u64,
    folder: &Path,
    out: &Path,
    files: &[&str],
    flags: &[&str],
) -> (Output, String) {
    let verdicts = out.with_extension("csv");
    let mut command = Command::new(std::env::current_exe().expect("this program"));
    command.args(["defect", row.name]);
    if !files.is_empty() {
        command
            .args(["verify", "--quiet", "--no-report", "--threads", "1"])
            .args(flags)
            .arg("--out")
            .arg(out);
        command.arg("--csv").arg(&verdicts).arg("--fresh-seed").arg(format!("{}/{number}", row.name));
        command.args(files.iter().map(|file| folder.join(file)));
    }
    let output = command.stdin(Stdio::null()).output().expect("this program starts");
    (output, fs::read_to_string(&verdicts).unwrap_or_default())
}

/// Whether a verdict would be the same as one of the whole family.
fn fails_beyond_doubt(row: &Row, family: Family) -> bool {
    let is_certain = match row["adjusted_p"].as_str() {
        "" => row["p_value"].is_empty(), // an identity, which takes part in no adjustment
        p => p.parse::<f64>().is_ok_and(|p| family_size(family) * p < AT_ONCE),
    };
    row["outcome"] == "fail" && is_certain
}

type Row = BTreeMap<String, String>;

fn csv_rows(table: &str) -> Vec<Row> {
    let rows = csv::Reader::from_reader(table.as_bytes()).into_deserialize();
    rows.map(|row| row.expect("a row of verdicts")).collect()
}

/// A test is named `experiment.claim`; one claim on samplers is many tests, which are named
/// `experiment.test`.
fn test_of(row: &Row) -> String {
    let of = if ON_SAMPLERS.contains(&row["experiment"].as_str()) { "test" } else { "claim" };
    format!("{}.{}", row["experiment"], row[of])
}

/// Test -> the worst of its verdicts, from the table that `verify --csv` writes.
fn seen_in(table: &str) -> BTreeMap<String, Seen> {
    let mut tests = BTreeMap::new();
    for row in csv_rows(table) {
        let seen = match row["outcome"].as_str() {
            "pass" => Seen::Green,
            "underpowered" => Seen::Underpowered,
            _ => Seen::Defect,
        };
        let worst = tests.entry(test_of(&row)).or_insert(seen);
        *worst = seen.max(*worst);
    }
    tests
}
