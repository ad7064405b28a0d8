//! The picture in `src/lib.rs`, held against the sources: who uses whom, which module is the door of
//! which crate, where transcendental functions come from, and how long a file may be.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use super::tokens::{Token, module_path, test_modules, tokens};

/// What a module may use, besides itself and `error`.
const LAYERS: [(&str, &[&str]); 18] = [
    ("error", &[]),
    // Simulation.
    ("math", &[]),
    ("sampling", &["math"]),
    ("optics", &["math", "sampling"]),
    ("geometry", &["math", "sampling"]),
    ("scene", &["math", "sampling", "optics", "geometry"]),
    ("estimators", &["math", "sampling", "optics", "geometry", "scene"]),
    ("samplers", &["math", "sampling", "optics", "geometry", "scene"]),
    ("reference", &["math", "optics"]),
    // Evidence.
    ("stats", &["math"]),
    ("results", &["math", "stats"]),
    ("verify", &["math", "stats", "results"]),
    ("report", &["math", "stats", "results", "verify"]),
    // The bridge.
    ("experiment", &EXPERIMENT),
    ("run", &RUN),
    // The command line.
    ("cli", &CLI),
    ("main", &["cli", "experiment"]),
    ("lib", &[]),
];
const EXPERIMENT: [&str; 10] = [
    "math",
    "sampling",
    "optics",
    "geometry",
    "scene",
    "samplers",
    "estimators",
    "reference",
    "stats",
    "results",
];
const RUN: [&str; 11] = [
    "math",
    "sampling",
    "optics",
    "geometry",
    "scene",
    "samplers",
    "estimators",
    "reference",
    "stats",
    "results",
    "experiment",
];
const CLI: [&str; 14] = [
    "math",
    "sampling",
    "optics",
    "geometry",
    "scene",
    "samplers",
    "estimators",
    "reference",
    "stats",
    "results",
    "verify",
    "report",
    "experiment",
    "run",
];

/// The modules that may name a crate.
const DOORS: [(&str, &[&str]); 21] = [
    ("annotate_snippets", &["error"]),
    ("glam", &["math"]),
    ("libm", &["math"]),
    ("rand_pcg", &["sampling"]),
    ("obvhs", &["geometry"]),
    ("tobj", &["geometry"]),
    ("statrs", &["stats"]),
    ("blake3", &["results"]),
    ("exr", &["results"]),
    ("png", &["results"]),
    ("csv", &["results", "experiment"]),
    ("schemars", &DERIVES),
    ("strsim", &["experiment"]),
    ("toml", &["experiment"]),
    ("indicatif", &["run"]),
    ("rustix", &["run"]),
    ("signal_hook", &["run"]),
    ("clap", &["cli"]),
    ("clap_complete", &["cli"]),
    ("serde", &SERDE),
    ("serde_json", &JSON),
];
/// Options are deserialised, and described, where they are used.
const DERIVES: [&str; 6] = ["sampling", "optics", "geometry", "samplers", "estimators", "experiment"];
const SERDE: [&str; 11] = [
    "sampling",
    "optics",
    "geometry",
    "samplers",
    "estimators",
    "stats",
    "results",
    "verify",
    "report",
    "experiment",
    "run",
];
const JSON: [&str; 8] =
    ["samplers", "estimators", "stats", "results", "verify", "report", "experiment", "run"];

/// Crates that test code may name anywhere.
const TEST_CRATES: [&str; 2] = ["serde_json", "toml"];

/// Functions of std (and of glam, which calls std's) whose last digits depend on the machine.
const NOT_PORTABLE: [&str; 39] = [
    "sin",
    "cos",
    "tan",
    "sin_cos",
    "asin",
    "acos",
    "atan",
    "atan2",
    "sinh",
    "cosh",
    "tanh",
    "asinh",
    "acosh",
    "atanh",
    "exp",
    "exp2",
    "exp_m1",
    "ln",
    "ln_1p",
    "log",
    "log2",
    "log10",
    "powf",
    "powi",
    "cbrt",
    "hypot",
    "gamma",
    "ln_gamma",
    "erf",
    "erfc",
    "angle_between",
    "angle_to",
    "from_angle",
    "to_angle",
    "rotate_towards",
    "rotate_axis",
    "rotate_x",
    "rotate_y",
    "rotate_z",
];

/// Files that may be longer than [`LONGEST`], and how long.
const LONG: [(&str, usize); 1] = [("src/experiment/schema.rs", 800)];
const LONGEST: usize = 700;

/// Everything that a file breaks, as `path:line: rule`.
fn violations(path: &str, text: &str, is_test: bool) -> Vec<String> {
    let tokens: Vec<Token> =
        tokens(text).into_iter().map(|t| Token { is_test: t.is_test || is_test, ..t }).collect();
    let file = File { path, tokens: &tokens };
    let mut found = Vec::new();
    found.extend(file.edges());
    found.extend(file.doors());
    found.extend(file.numbers());
    if !text.starts_with("//! ") {
        found.push(format!("{path}:1: the first line does not say, after `//! `, what the file is"));
    }
    let longest = LONG.iter().find(|(long, _)| *long == path).map_or(LONGEST, |(_, lines)| *lines);
    let lines = text.lines().count();
    if lines > longest {
        found.push(format!("{path}:{lines}: longer than {longest} lines"));
    }
    found
}

struct File<'a> {
    path: &'a str,
    tokens: &'a [Token<'a>],
}

impl File<'_> {
    /// The top module.
    fn module(&self) -> String {
        let first = module_path(Path::new(self.path)).into_iter().next();
        first.unwrap_or_else(|| if self.path.ends_with("main.rs") { "main" } else { "lib" }.to_string())
    }

    fn text(&self, i: usize) -> &str {
        self.tokens.get(i).map_or("", |token| token.text)
    }

    fn at(&self, i: usize, rule: String) -> String {
        format!("{}:{}: {rule}", self.path, self.tokens[i].line)
    }

    fn edges(&self) -> Vec<String> {
        let module = self.module();
        let allowed = LAYERS.iter().find(|(name, _)| *name == module).map(|(_, allowed)| *allowed);
        let Some(allowed) = allowed else {
            return vec![format!("{}:1: `{module}` has no row in the table of layers", self.path)];
        };
        let forbidden = |used: &str| used != module && used != "error" && !allowed.contains(&used);
        let mut found = Vec::new();
        for i in 0..self.tokens.len() {
            let Some((root, is_certain)) = self.root(i) else { continue };
            for used in self.first_words(root) {
                let is_module = is_certain || LAYERS.iter().any(|(name, _)| *name == used);
                if is_module && forbidden(used) {
                    found.push(self.at(i, format!("`{module}` may not use `{used}`")));
                }
            }
        }
        found
    }

    /// Where a path that begins at token `i` goes on from the crate's root; and whether it surely does
    /// (a file under `#[path]` stands deeper than it looks).
    fn root(&self, i: usize) -> Option<(usize, bool)> {
        let begins = i == 0 || self.text(i - 1) != "::";
        match self.text(i) {
            "crate" if self.text(i + 1) == "as" => Some((i, true)),
            "crate" if self.text(i + 1) == "::" => Some((i + 2, true)),
            "scatterproof" if self.text(i + 1) == "::" => Some((i + 2, true)),
            "super" if begins || self.text(i - 2) == "self" => {
                let mut ups = 0;
                while self.text(i + 2 * ups) == "super" && self.text(i + 2 * ups + 1) == "::" {
                    ups += 1;
                }
                let depth = module_path(Path::new(self.path)).len() + self.tokens[i].depth;
                (ups >= depth && ups > 0).then_some((i + 2 * ups, false))
            }
            _ => None,
        }
    }

    /// The word at `i`, or the first words of a group that begins there.
    fn first_words(&self, i: usize) -> Vec<&str> {
        if self.text(i) != "{" {
            return vec![self.text(i)];
        }
        let (mut words, mut nesting, mut expected) = (Vec::new(), 0, false);
        for token in &self.tokens[i..] {
            match token.text {
                "{" => (nesting, expected) = (nesting + 1, nesting == 0),
                "}" if nesting == 1 => break,
                "}" => nesting -= 1,
                "," => expected = nesting == 1,
                word if expected => {
                    words.push(word);
                    expected = false;
                }
                _ => {}
            }
        }
        words
    }

    fn doors(&self) -> Vec<String> {
        let module = self.module();
        let mut found = Vec::new();
        for (i, token) in self.tokens.iter().enumerate() {
            let door = DOORS.iter().find(|(name, _)| *name == token.text);
            let Some((name, doors)) = door else { continue };
            let continues = i >= 2
                && self.text(i - 1) == "::"
                && (self.tokens[i - 2].is_word() && self.text(i - 2) != "use");
            let is_imported = i >= 1 && ["use", "crate"].contains(&self.text(i - 1));
            let is_named = (self.text(i + 1) == "::" && !continues) || is_imported;
            let is_free = token.is_test && TEST_CRATES.contains(name);
            if is_named && !is_free && !doors.contains(&module.as_str()) {
                found.push(self.at(i, format!("`{module}` names `{name}`, whose door is {doors:?}")));
            }
        }
        found
    }

    fn numbers(&self) -> Vec<String> {
        let is_math = self.module() == "math";
        let mut found = Vec::new();
        for (i, token) in self.tokens.iter().enumerate() {
            let is_method = i >= 1 && self.text(i - 1) == "." && self.text(i + 1) == "(";
            let of_float =
                i >= 2 && self.text(i - 1) == "::" && ["f64", "f32", ">"].contains(&self.text(i - 2));
            if (is_method || of_float)
                && !is_math
                && !token.is_test
                && NOT_PORTABLE.contains(&token.text)
            {
                let rule =
                    format!("`{}` differs between machines; `math` has portable ones", token.text);
                found.push(self.at(i, rule));
            }
            let rule = match token.text {
                "mul_add" => "`mul_add` fuses what other code rounds twice",
                "Vec3A" | "BVec3A" => "`Vec3A` rounds differently with and without SIMD",
                "unsafe" => "`unsafe` is not needed here",
                _ => continue,
            };
            found.push(self.at(i, rule.to_string()));
        }
        found
    }
}

/// Every source by its path from the package's folder.
fn sources() -> Vec<(String, String)> {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut folders = vec![package.join("src")];
    let mut files = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).expect("a folder of sources") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                let name = path.strip_prefix(package).expect("inside").to_string_lossy().into_owned();
                files.push((name, fs::read_to_string(&path).expect("a source")));
            }
        }
    }
    files.sort();
    files
}

#[test]
fn the_sources_keep_the_rules() {
    let sources = sources();
    assert!(sources.len() > 80, "only {} sources were found", sources.len());
    let tests: BTreeSet<PathBuf> =
        sources.iter().flat_map(|(path, text)| test_modules(Path::new(path), text)).collect();
    let is_test = |path: &str| {
        let path = Path::new(path);
        tests.iter().any(|test| path == test || path.starts_with(test.with_extension("")))
    };
    let found: Vec<String> =
        sources.iter().flat_map(|(path, text)| violations(path, text, is_test(path))).collect();
    assert!(found.is_empty(), "{} violations:\n{}", found.len(), found.join("\n"));
}

#[test]
fn every_module_and_every_dependency_has_a_row() {
    let modules: BTreeSet<String> =
        sources().iter().map(|(path, text)| File { path, tokens: &tokens(text) }.module()).collect();
    let rows: BTreeSet<String> = LAYERS.iter().map(|(name, _)| name.to_string()).collect();
    assert_eq!(modules, rows);

    let manifest = include_str!("../Cargo.toml");
    let section = manifest.split("[dependencies]").nth(1).expect("dependencies");
    let lines = section.lines().skip(1).take_while(|line| !line.starts_with('['));
    let names = lines.filter_map(|line| line.split_once(" = ")).map(|(name, _)| name.replace('-', "_"));
    let doors: BTreeSet<String> = DOORS.iter().map(|(name, _)| name.to_string()).collect();
    assert_eq!(names.collect::<BTreeSet<String>>(), doors);
}

/// What a planted text breaks, after a good first line.
fn planted(path: &str, text: &str) -> String {
    violations(path, &format!("//! A file.\n{text}"), false).join("\n")
}

#[test]
fn planted_edges_are_found() {
    for (path, text, used) in [
        ("src/math/frame.rs", "use crate::sampling::warp;", "sampling"),
        ("src/estimators/path.rs", "use crate::{geometry::Ray, run::job::{a, Job}};", "run"),
        ("src/estimators/path.rs", "fn f() { crate::reference::value() }", "reference"),
        ("src/reference/slab.rs", "use crate::estimators::Estimator;", "estimators"),
        ("src/scene/mod.rs", "use crate::results;", "results"),
        ("src/stats/mod.rs", "use super::optics::phase;", "optics"),
        ("src/stats/tree.rs", "use super::super::optics::phase;", "optics"),
        ("src/stats/tree.rs", "mod m { use super::super::super::{math, optics}; }", "optics"),
        ("src/verify/judge.rs", "use crate::experiment::Experiment;", "experiment"),
        ("src/experiment/load.rs", "use crate::verify;", "verify"),
        ("src/run/mod.rs", "use crate::report;", "report"),
        ("src/run/mod.rs", "use crate::cli;", "cli"),
        ("src/error.rs", "use crate::math;", "math"),
        ("src/main.rs", "fn main() { scatterproof::run::run() }", "run"),
        ("src/stats/mod.rs", "use crate as everything;", "crate"),
        ("src/stats/mod.rs", "use crate::*;", "*"),
        ("src/stats/mod.rs", "use crate::{self as everything};", "self"),
        ("src/stats/mod.rs", "#[cfg(test)] mod tests { use crate::optics; }", "optics"),
    ] {
        let found = planted(path, text);
        assert!(
            found.contains(&format!("{path}:2:")) && found.contains(&format!("`{used}`")),
            "{text}: {found}"
        );
        assert_eq!(found.lines().count(), 1, "{text}: {found}");
    }
    assert!(planted("src/extra/mod.rs", "").contains("`extra` has no row"));
    for (path, text) in [
        (
            "src/estimators/path.rs",
            "use crate::{error::Result, math::{DVec3, run}, scene, estimators::x};",
        ),
        (
            "src/stats/tree.rs",
            "use super::moments::Moments; mod t { use super::super::moments; use super::*; }",
        ),
        ("src/run/mod.rs", "pub(crate) use crate::{scene, results}; // crate::cli"),
        ("src/run/mod.rs", "const X: &str = \"crate::cli\";"),
        ("src/main.rs", "fn main() { scatterproof::cli::main() }"),
    ] {
        assert_eq!(planted(path, text), "", "{text}");
    }
}

#[test]
fn planted_crates_are_found() {
    for (path, text, name) in [
        ("src/scene/mod.rs", "use glam::DVec3;", "glam"),
        ("src/optics/fresnel.rs", "fn f(x: f64) -> f64 { libm::exp(x) }", "libm"),
        ("src/scene/mod.rs", "use serde::Serialize;", "serde"),
        ("src/scene/mod.rs", "use ::serde::Serialize;", "serde"),
        ("src/stats/mod.rs", "use blake3;", "blake3"),
        ("src/stats/mod.rs", "extern crate png;", "png"),
        ("src/cli/run.rs", "use toml::Value;", "toml"),
        ("src/experiment/mod.rs", "#[derive(clap::Args)] struct A;", "clap"),
        ("src/geometry/mod.rs", "#[cfg(test)] mod tests { use rand_pcg::Pcg64; }", "rand_pcg"),
    ] {
        let found = planted(path, text);
        assert!(found.contains(&format!("names `{name}`")), "{text}: {found}");
    }
    for (path, text) in [
        ("src/math/mod.rs", "pub use glam::DVec3;"),
        ("src/report/mod.rs", "let png = figure.png; use super::png::write; \"csv::Reader\""),
        ("src/cli/schema.rs", "#[cfg(test)] mod tests { fn f() { serde_json::from_str() } }"),
    ] {
        assert_eq!(planted(path, text), "", "{text}");
    }
}

#[test]
fn planted_arithmetic_is_found() {
    for text in [
        "fn f(x: f64) -> f64 { x.sin() }",
        "fn f(x: f64) -> f64 { (2.0 * x)\n.powi(2) }",
        "fn f(x: f64) -> f64 { 2.0f64.powf(x) }",
        "fn f(x: f64) -> f64 { f64::ln(x) }",
        "fn f(x: f64) -> f64 { <f64>::hypot(x, x) }",
        "fn f(x: &[f64]) { x.iter().copied().map(f64::exp) }",
        "fn f(a: DVec3, b: DVec3) -> f64 { a.angle_between(b) }",
        "fn f(x: f64) -> f64 { x.mul_add(2.0, 1.0) }",
        "use crate::math::Vec3A;",
        "fn f() { unsafe { g() } }",
        "#[cfg(test)] mod tests { fn f() { unsafe { g() } } }",
        "#[cfg(test)] mod tests {} fn f(x: f64) -> f64 { x.cos() }",
    ] {
        assert!(!planted("src/optics/phase.rs", text).is_empty(), "not found: {text}");
        let path = "src/stats/moments.rs";
        assert!(planted(path, text).contains(path), "not found: {text}");
    }
    for text in [
        "use crate::math::{sin, exp}; fn f(x: f64) -> f64 { sin(x) * x.sqrt() * crate::math::exp(x) }",
        "#[cfg(test)] mod tests { fn f(x: f64) -> f64 { x.powi(2) + x.sin() } }",
        "// x.sin()\n/// `x.exp()`\nfn f() -> f64 { x.sin }",
        "fn unsafe_code() {}",
    ] {
        assert_eq!(planted("src/optics/phase.rs", text), "", "{text}");
    }
    assert_eq!(planted("src/math/turns.rs", "fn f(x: f64) -> f64 { x.sin() }"), "");
}

#[test]
fn planted_lengths_and_first_lines_are_found() {
    let long = "//! A file.\n".to_string() + &"// x\n".repeat(LONGEST);
    assert!(violations("src/run/mod.rs", &long, false)[0].contains("longer than 700 lines"));
    assert!(violations("src/experiment/schema.rs", &long, false).is_empty());
    let longer = long + &"// x\n".repeat(100);
    assert!(violations("src/experiment/schema.rs", &longer, false)[0].contains("longer than 800 lines"));
    for text in ["", "// A file.\n", "\n//! A file.\n", "use crate::error;\n", "//!\n"] {
        assert!(violations("src/run/mod.rs", text, false)[0].contains("first line"), "{text:?}");
    }
}
