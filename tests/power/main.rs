//! Power: defects planted one at a time, each of which the claims have to catch at the budget of CI.
//!
//! ```text
//! cargo test --release --test power                        every defect once, and the sham
//! cargo test --release --test power -- NAME                those whose name contains NAME
//! cargo test --release --test power -- matrix --seeds 20   the blindness matrix, results/published/
//! power defect NAME ARGS...                                scatterproof with that defect planted
//! ```
//!
//! The last is what the others start: this program is scatterproof's own command line over a registry
//! whose estimator `tracer` (or whose samplers) hold the defect; where the claims are green and an
//! identity of the surface is broken, it exits with 1 all the same. What judges is the same code, with
//! the same levels, as for any user. All defects get the same experiments (`*.toml` here), the same budgets,
//! and streams that their names name.

mod defects;
mod identities;
mod matrix;
mod plays;
mod surface;
mod tracer;

use std::env;
use std::ffi::OsString;
use std::process::ExitCode;

use defects::{Defect, planted};
use schemars::JsonSchema;
use scatterproof::experiment::estimators::{builtin, read};
use scatterproof::experiment::registry::{Registry, RegistryEntry};
use serde::{Deserialize, Serialize};
use tracer::Tracer;

/// Options of `tracer`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct TracerOptions {}

/// The library's registry, and the tracer with what is planted in this process.
fn registry() -> Registry {
    let mut registry = builtin();
    registry.entries.push(RegistryEntry {
        kind: "tracer",
        doc: "the second path tracer, and the defect that is planted in it",
        options_schema: || schemars::schema_for!(TracerOptions),
        build: |options, scene| {
            let TracerOptions {} = read(options)?;
            Ok(Box::new(Tracer::new(scene, planted())))
        },
    });
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
    let Some(defect) = defects::named(name) else {
        eprintln!("unknown defect `{name}`; one of: {}", defects::names().join(", "));
        return ExitCode::from(2);
    };
    defects::plant(defect);
    let rest = arguments.iter().skip(3).cloned();
    let code = scatterproof::cli::main_with(&registry(), std::iter::once("power".into()).chain(rest));
    let broken: Vec<_> = identities::all(defect).into_iter().filter(|(_, broken)| *broken).collect();
    broken.iter().for_each(|(name, _)| eprintln!("{name} is broken"));
    if code == ExitCode::SUCCESS && !broken.is_empty() { ExitCode::from(1) } else { code }
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
    let plays: Vec<_> = rows.iter().map(|row| (*row, 0)).collect();
    let mut survived = 0;
    plays::all(&plays, |row, _, outcome| {
        let found = matrix::judge(row, outcome);
        survived += usize::from(found.is_err());
        let (verdict, text) = match found {
            Ok(text) => ("ok", text),
            Err(text) => ("FAILED", text),
        };
        println!("{:24} {verdict:6} exit {} {text}", row.name, outcome.exit);
    });
    println!("{} defects (and the sham): {survived} not as they must be", rows.len());
    if survived == 0 { ExitCode::SUCCESS } else { ExitCode::from(101) }
}

/// Is this the sham?
fn is_sham(defect: Defect) -> bool {
    defect == Defect::None
}
