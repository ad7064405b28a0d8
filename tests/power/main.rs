//! Power: defects planted one at a time, each of which the claims have to catch at the budget of CI.
//!
//! ```text
//! cargo test --release --test power                        every defect once, and the sham
//! cargo test --release --test power -- NAME                those whose name contains NAME
//! cargo test --release --test power -- matrix --seeds 20   the blindness matrix, results/published/
//!                              matrix --only TEXT --out DIR   the rows whose names contain TEXT
//! power defect NAME ARGS...                                scatterproof with that defect planted
//! ```
//!
//! The last is what the others start: this program is scatterproof's own command line over a registry
//! whose estimators of the test (or whose samplers) hold the defect; where the claims are green and an
//! identity of the surface is broken, it exits with 1 all the same. What judges is the same code, with
//! the same levels, as for any user. All defects get the same experiments (`*.toml` here), the same
//! budgets, and streams that their names name.

// The planted programs are no part of what ships: their arithmetic may be std's.
#![allow(clippy::disallowed_methods)]

mod acceptance;
mod alone;
mod cloud;
mod connection;
mod defects;
mod identities;
mod lobes;
mod matrix;
mod runs;
mod samplers;
mod subdivision;
mod surface;
mod tracer;
mod verifier;

use std::env;
use std::ffi::OsString;
use std::fs;
use std::path::Path;
use std::process::ExitCode;

use acceptance::{Acceptance, AcceptanceOptions};
use alone::{TwoBounce, TwoBounceOptions};
use cloud::{Cloud, CloudOptions};
use defects::{Defect, Family, Planted, planted};
use runs::Extent;
use scatterproof::estimators::{EstimatorKind, Serves, read_options};
use scatterproof::experiment::registry::Registry;
use scatterproof::samplers::SamplerKind;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use subdivision::{FluxOptions, Photons, Subdivision};
use tracer::Tracer;

/// Options of an estimator that has none.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct NoOptions {}

/// The library's registry, and the test's own estimators with what is planted in this process.
fn registry() -> Registry {
    let mut registry = Registry::builtin();
    registry.samplers.extend(samplers::entries());
    registry.samplers.push(SamplerKind {
        kind: "planted_acceptance",
        doc: "points accepted by distance, and the planted defect",
        options_schema: || schemars::schema_for!(AcceptanceOptions),
        build: |options| Ok(Box::new(Acceptance::new(&read_options(options)?, planted()))),
    });
    registry.estimators.extend([
        EstimatorKind {
            kind: "tracer",
            doc: "the second path tracer, and the defect that is planted in it",
            serves: Serves::ALL,
            options_schema: || schemars::schema_for!(NoOptions),
            build: |options, scene| {
                let NoOptions {} = read_options(options)?;
                Ok(Box::new(Tracer::new(scene, planted())))
            },
        },
        EstimatorKind {
            kind: "last_two",
            doc: "two bounces from one medium vertex by one technique, and the planted defect",
            serves: Serves::ALL,
            options_schema: || schemars::schema_for!(TwoBounceOptions),
            build: |options, scene| {
                Ok(Box::new(TwoBounce { scene, options: read_options(options)?, defect: planted() }))
            },
        },
        EstimatorKind {
            kind: "subdivision",
            doc: "paths with subdivision next-event estimation, and the planted defect",
            serves: Serves::ALL,
            options_schema: || schemars::schema_for!(FluxOptions),
            build: |options, scene| {
                Ok(Box::new(Subdivision { scene, options: read_options(options)?, defect: planted() }))
            },
        },
        EstimatorKind {
            kind: "photons",
            doc: "an analog light tracer into the bins of a flux, without defects",
            serves: Serves::ALL,
            options_schema: || schemars::schema_for!(FluxOptions),
            build: |options, scene| Ok(Box::new(Photons { scene, options: read_options(options)? })),
        },
        EstimatorKind {
            kind: "planted_cloud",
            doc: "the second point-cloud method, and the planted defect",
            serves: Serves::ALL,
            options_schema: || schemars::schema_for!(CloudOptions),
            build: |options, scene| Ok(Box::new(Cloud::new(scene, read_options(options)?, planted()))),
        },
    ]);
    registry
}

fn main() -> ExitCode {
    let arguments: Vec<OsString> = env::args_os().collect();
    let words: Vec<String> = arguments.iter().map(|a| a.to_string_lossy().into_owned()).collect();
    match words.get(1).map(String::as_str) {
        Some("defect") => scatterproof_with(words.get(2).map_or("", String::as_str), &arguments),
        Some("matrix") => matrix::main(&words[2..]),
        _ => tests(&words[1..]),
    }
}

/// The command line with a defect.
fn scatterproof_with(name: &str, arguments: &[OsString]) -> ExitCode {
    let Some(row) = defects::named(name) else {
        eprintln!("unknown defect `{name}`; one of: {}", defects::names().join(", "));
        return ExitCode::from(2);
    };
    defects::plant(row.defect);
    let mut code = ExitCode::SUCCESS;
    if arguments.len() > 3 {
        let rest = arguments.iter().skip(3).cloned();
        code = scatterproof::cli::main_with(&registry(), std::iter::once("power".into()).chain(rest));
    }
    let broken: Vec<_> = identities(&row).into_iter().filter(|(_, broken)| *broken).collect();
    broken.iter().for_each(|(name, _)| eprintln!("{name} is broken"));
    if code == ExitCode::SUCCESS && !broken.is_empty() { ExitCode::from(1) } else { code }
}

/// Identities of a row's code, without random streams, and whether each is broken.
fn identities(row: &Planted) -> Vec<(String, bool)> {
    let mut asked = Vec::new();
    if matches!(row.family, Family::Tracer | Family::Sham) {
        asked.extend(identities::all(row.defect));
    }
    if matches!(row.family, Family::Subdivision | Family::Sham) {
        asked.extend(connection::identities(row.defect));
    }
    if matches!(row.family, Family::Verifier | Family::Sham) {
        asked.extend(verifier::all(row.defect));
    }
    asked
}

/// As `cargo test` calls it: words that begin with a dash are for test programs of another kind, and of
/// the others each is a filter.
fn tests(words: &[String]) -> ExitCode {
    let has = |flag: &str| words.iter().any(|word| word == flag);
    let filters: Vec<&String> = words.iter().filter(|word| !word.starts_with('-')).collect();
    let chosen = |name: &str| filters.is_empty() || filters.iter().any(|f| name.contains(f.as_str()));
    let rows: Vec<_> = defects::all().into_iter().filter(|row| chosen(row.name)).collect();
    if has("--list") {
        rows.iter().for_each(|row| println!("{}: test", row.name));
        return ExitCode::SUCCESS;
    }
    // Nothing here is ignored, so there is nothing to do for `--ignored`.
    if rows.is_empty() || has("--ignored") {
        return ExitCode::SUCCESS;
    }
    let mut runs: Vec<_> = rows.iter().map(|row| (*row, 0)).collect();
    // The longest first, so that no core waits for the last one.
    runs.sort_by_key(|(row, _)| row.family != Family::Cloud);
    let mut survived = 0;
    runs::all(&runs, Extent::UntilCaught, |row, _, outcome| {
        let found = matrix::judge(row, outcome);
        survived += usize::from(found.is_err());
        let (verdict, text) = match found {
            Ok(text) => ("ok", text),
            Err(text) => ("FAILED", text),
        };
        println!("{:24} {verdict:6} {:5.1} s, exit {} {text}", row.name, outcome.seconds, outcome.exit);
    });
    let missing = unit_tests_missing();
    missing.iter().for_each(|test| println!("no unit test `{test}`"));
    let wrong = matrix::published_wrongly();
    wrong
        .iter()
        .for_each(|what| println!("results/published/blindness.csv: {what}; make the matrix again"));
    println!("{} rows: {survived} not as they must be", rows.len());
    if survived == 0 && missing.is_empty() && wrong.is_empty() {
        ExitCode::SUCCESS
    } else {
        ExitCode::from(101)
    }
}

/// Of the unit tests that the matrix names those that the sources do not hold.
fn unit_tests_missing() -> Vec<&'static str> {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut folders = vec![package.join("src"), package.join("tests")];
    let mut sources = String::new();
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).expect("a folder of sources") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                sources += &fs::read_to_string(&path).expect("a source");
            }
        }
    }
    let named = defects::UNIT_TESTED.iter().map(|(_, test)| *test);
    let function = |test: &str| format!("fn {}()", test.rsplit("::").next().unwrap_or_default());
    named.filter(|test| !sources.contains(&function(test))).collect()
}

/// Is this the sham?
fn is_sham(defect: Defect) -> bool {
    defect == Defect::None
}
