//! The blindness matrix: defects against tests, with the number of seeds in which each test saw each.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::fs;
use std::path::Path;
use std::process::ExitCode;

use super::defects::{self, Planted, UNIT_TESTED};
use super::is_sham;
use super::runs::{self, Extent, Outcome};

/// Whether an outcome is the expected one. A defect is caught where the program does not exit with 0,
/// and one of the tests that are expected to see it has seen it; the sham has to be green.
pub fn judge(row: &Planted, outcome: &Outcome) -> Result<String, String> {
    let caught = outcome.caught();
    let list = caught.iter().copied().collect::<Vec<_>>().join(", ");
    if is_sham(row.defect) {
        return match outcome.exit {
            0 if outcome.is_green() => Ok("green".into()),
            _ => Err(format!("the sham is not green: {list}\n{}", outcome.said)),
        };
    }
    if !outcome.is_verdict() || outcome.exit == 0 {
        return Err(format!("no verdict:\n{}", outcome.said));
    }
    if !row.expected.iter().any(|test| caught.contains(test)) {
        return Err(format!("not caught by what should; caught by: {list}"));
    }
    Ok(format!("caught by {list}"))
}

/// One defect over all seeds.
#[derive(Default)]
struct Tally {
    runs: u64,
    /// Trials that were as they must be.
    good: u64,
    /// Times that each test saw it; 0 where it looked and saw nothing.
    seen: BTreeMap<String, u64>,
}

impl Tally {
    fn add(&mut self, row: &Planted, outcome: &Outcome) {
        self.runs += 1;
        self.good += u64::from(judge(row, outcome).is_ok());
        let caught = outcome.caught();
        for test in outcome.tests.keys() {
            *self.seen.entry(test.clone()).or_default() += u64::from(caught.contains(test.as_str()));
        }
    }

    /// The tests that saw it every time.
    fn killers(&self) -> Vec<&str> {
        let always = self.seen.iter().filter(|(_, times)| **times == self.runs);
        always.map(|(test, _)| test.as_str()).collect()
    }
}

/// `matrix [--seeds N] [--only TEXT] [--out DIR]`, of the rows whose names contain TEXT: exit code 1
/// where a defect survived a seed or the sham was not green.
pub fn main(words: &[String]) -> ExitCode {
    let value = |flag: &str| words.iter().position(|w| w == flag).and_then(|i| words.get(i + 1));
    let seeds: u64 = value("--seeds").map_or(20, |text| text.parse().expect("--seeds takes a number"));
    assert!(seeds > 0, "no seed, no evidence");
    let only = value("--only").map_or("", String::as_str);
    let published = concat!(env!("CARGO_MANIFEST_DIR"), "/results/published");
    let out = Path::new(value("--out").map_or(published, String::as_str));
    let rows: Vec<_> = defects::all().into_iter().filter(|row| row.name.contains(only)).collect();
    let is_published = only.is_empty() || value("--out").is_some();
    assert!(is_published, "a part of the matrix is not published: --out");
    let runs: Vec<(Planted, u64)> =
        (0..seeds).flat_map(|seed| rows.iter().map(move |row| (*row, seed))).collect();
    let mut tallies: BTreeMap<&str, Tally> = BTreeMap::new();
    let mut busy = 0.0;
    runs::all(&runs, Extent::Whole, |row, seed, outcome| {
        tallies.entry(row.name).or_default().add(row, outcome);
        busy += outcome.seconds;
        if let Err(why) = judge(row, outcome) {
            println!("{} seed {seed}: {why}", row.name);
        }
    });
    fs::create_dir_all(out).expect("the folder of published results");
    fs::write(out.join("blindness.csv"), csv(&rows, &tallies)).expect("blindness.csv");
    fs::write(out.join("blindness.md"), markdown(&rows, &tallies, seeds)).expect("blindness.md");
    let bad: Vec<_> = rows.iter().filter(|row| tallies[row.name].good < seeds).collect();
    println!("{} runs in {busy:.0} s of processes, into {}", runs.len(), out.display());
    bad.iter().for_each(|row| println!("red: {}", row.name));
    if bad.is_empty() { ExitCode::SUCCESS } else { ExitCode::from(1) }
}

/// What is wrong with the published matrix: rows that it lacks or has too many, and defects that a seed missed.
pub fn published_wrongly() -> Vec<String> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/results/published/blindness.csv");
    let text = fs::read_to_string(path).expect("the published matrix");
    let mut wrong = Vec::new();
    let mut published = BTreeSet::new();
    for line in text.lines().skip(1) {
        let mut fields = line.split(',');
        let mut next = || fields.next().expect("name, seeds, caught");
        let (name, seeds, caught) = (next(), next(), next());
        published.insert(name);
        match defects::named(name) {
            None => wrong.push(format!("`{name}` is published, and no defect any more")),
            Some(row) if caught != if is_sham(row.defect) { "0" } else { seeds } => {
                wrong.push(format!("`{name}` is published as seen with {caught} of {seeds} seeds"));
            }
            Some(_) => {}
        }
    }
    let missing = defects::names().into_iter().filter(|name| !published.contains(name));
    wrong.extend(missing.map(|name| format!("`{name}` is not published")));
    wrong
}

/// Every test that looked at any defect.
fn columns(tallies: &BTreeMap<&str, Tally>) -> BTreeSet<String> {
    tallies.values().flat_map(|tally| tally.seen.keys().cloned()).collect()
}

/// One row a defect, one column a test: seeds in which it saw the defect, empty where it did not look.
fn csv(rows: &[Planted], tallies: &BTreeMap<&str, Tally>) -> String {
    let columns = columns(tallies);
    let mut text = String::from("defect,seeds,caught");
    columns.iter().for_each(|test| write!(text, ",{test}").expect("a string"));
    for row in rows {
        let tally = &tallies[row.name];
        write!(text, "\n{},{},{}", row.name, tally.runs, caught(row, tally)).expect("a string");
        for test in &columns {
            let times = tally.seen.get(test).map(u64::to_string).unwrap_or_default();
            write!(text, ",{times}").expect("a string");
        }
    }
    text + "\n"
}

/// Seeds in which a defect was caught; of the sham those in which anything was not green.
fn caught(row: &Planted, tally: &Tally) -> u64 {
    if is_sham(row.defect) { tally.runs - tally.good } else { tally.good }
}

/// The same for people.
fn markdown(rows: &[Planted], tallies: &BTreeMap<&str, Tally>, seeds: u64) -> String {
    let number = if seeds == 1 { "one seed".to_string() } else { format!("{seeds} seeds") };
    let mut text = format!(
        "# The blindness matrix\n\n\
         Made by `cargo test --release --test power -- matrix --seeds {seeds}`; do not edit.\n\n\
         Each defect was planted in a test-only program and run with {number} (named by its \
         name) at the budget of continuous integration, the same for all. A test is a claim of an \
         experiment in `tests/power/`, or an identity that holds to rounding. *Always* lists the tests \
         that saw the defect with every seed, *sometimes* the others that saw it, each with its number \
         of seeds. A defect that one test alone always sees is marked `!`: no other test confirms that \
         test. Tests that were expected to see a defect and missed a seed are listed as blind. The whole \
         matrix is `blindness.csv`. Of techniques that the program does not have nothing is planted; each \
         brings its own rows.\n\n\
         | defect | what is wrong | caught | always | sometimes | blind |\n|---|---|---|---|---|---|\n"
    );
    for row in rows {
        let tally = &tallies[row.name];
        let killers = tally.killers();
        let sometimes: Vec<String> = tally
            .seen
            .iter()
            .filter(|(_, times)| **times > 0 && **times < tally.runs)
            .map(|(test, times)| format!("{test} {times}"))
            .collect();
        let blind: Vec<&str> =
            row.expected.iter().copied().filter(|test| !killers.contains(test)).collect();
        let mark = match killers.len() {
            1 => " !",
            0 if !is_sham(row.defect) => " **none**",
            _ => "",
        };
        let (name, what, count) = (row.name, row.what, caught(row, tally));
        let [always, sometimes, blind] = [killers.join(", "), sometimes.join(", "), blind.join(", ")];
        writeln!(
            text,
            "| {name}{mark} | {what} | {count}/{} | {always} | {sometimes} | {blind} |",
            tally.runs
        )
        .expect("a string");
    }
    text += "\n## Defects that unit tests hold\n\n\
             These are where no claim looks (the verifier itself, merging, streams); the unit test \
             named holds the code to the opposite.\n\n| defect | unit test |\n|---|---|\n";
    for (what, test) in UNIT_TESTED {
        writeln!(text, "| {what} | `{test}` |").expect("a string");
    }
    text
}
