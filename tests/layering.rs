//! Rules of the sources that neither the compiler nor clippy can check: which module uses which (the
//! picture in `src/lib.rs`), which module is the door of which crate, that one name denotes one type,
//! and how long a file may be. Functions that differ between machines are in `clippy.toml`.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// The modules from the bottom to the top. Each may use those that stand before it.
const ORDER: &str = "error input math sampling optics geometry scene estimators samplers reference stats results \
                     experiment run verify report cli main lib";

/// The modules that may use less than that, besides `error` and `input`: evidence knows neither simulation nor
/// the bridge.
const LESS: [(&str, &str); 9] = [
    ("geometry", "math sampling"),
    ("samplers", "math sampling optics geometry scene"),
    ("reference", "math optics"),
    ("stats", "math"),
    ("results", "math stats"),
    ("verify", "math stats results"),
    ("report", "math stats results verify"),
    ("main", "cli experiment"),
    ("lib", ""),
];

/// The modules that may name a crate. Options are deserialised, and described, where they are used.
const DOORS: &[(&str, &str)] = &[
    ("annotate_snippets", "error"),
    ("glam", "math"),
    ("libm", "math"),
    ("rand_pcg", "sampling"),
    ("obvhs", "geometry"),
    ("tobj", "geometry"),
    ("ply_rs_bw", "geometry"),
    ("statrs", "stats"),
    ("blake3", "results"),
    ("exr", "results"),
    ("image", "results"),
    ("png", "results"),
    ("pulp", "math"),
    ("csv", "results experiment"),
    ("schemars", "sampling optics geometry samplers estimators results experiment"),
    ("strsim", "experiment"),
    ("toml", "optics samplers estimators experiment"),
    ("indicatif", "run"),
    ("rustix", "run"),
    ("signal_hook", "run"),
    ("pdf_writer", "report"),
    ("roxmltree", "report"),
    ("clap", "cli"),
    ("console", "cli"),
    ("clap_complete", "cli"),
    ("serde", "sampling optics geometry samplers estimators stats results verify report experiment run"),
    ("serde_json", "samplers estimators stats results verify report experiment run cli"),
];

/// Crates that unit tests may name anywhere.
const TEST_CRATES: &str = "serde_json toml";

/// Is a word one of a list?
fn has(list: &str, word: &str) -> bool {
    list.split_whitespace().any(|one| one == word)
}

/// What a module may use, besides itself, `error` and `input`; `None` of a name that is no module.
fn layers_below(module: &str) -> Option<Vec<&'static str>> {
    let before: Vec<&str> = ORDER.split_whitespace().take_while(|name| *name != module).collect();
    let less = LESS.iter().find(|(name, _)| *name == module);
    let below = less.map_or(before, |(_, list)| list.split_whitespace().collect());
    has(ORDER, module).then_some(below)
}

/// Type names that may denote several types: clap's arguments of each subcommand, and nodes of trees.
const SHARED_NAMES: [&str; 2] = ["Args", "Node"];

/// Words that mean one thing, and where nothing may bear them: a cell is a point of a sweep, which
/// geometry, estimators and chi-square (bins) know nothing of; stored moments are of observables, and
/// gates are those of continuous integration.
const WORDS: [(&str, &[&str]); 3] = [
    (
        "cell",
        &[
            "src/geometry/",
            "src/optics/",
            "src/sampling/",
            "src/samplers/",
            "src/scene/",
            "src/estimators/",
            "src/stats/",
            "src/run/chi_square/",
        ],
    ),
    ("gate", &["src/"]),
    ("gates", &["src/"]),
];

/// Files that may be longer than [`LONGEST`], and how long.
const LONG: [(&str, usize); 1] = [("src/experiment/schema.rs", 800)];
const LONGEST: usize = 700;

/// A source file below `src`.
struct Source {
    /// Path from the package's folder.
    path: String,
    text: String,
    /// Modules from the crate's root to this file's.
    module: Vec<String>,
    /// Is all of it test code?
    is_test: bool,
}

impl Source {
    fn new(path: &str, text: &str) -> Source {
        let names = path.trim_start_matches("src/").trim_end_matches(".rs").split('/');
        let module: Vec<String> =
            names.filter(|name| !["mod", "lib", "main"].contains(name)).map(str::to_string).collect();
        let is_test = module.iter().any(|name| {
            name.ends_with("tests") || ["testing", "throughput", "sample"].contains(&name.as_str())
        });
        Source { path: path.into(), text: text.into(), module, is_test }
    }

    /// Name of the source's top module.
    fn top(&self) -> &str {
        let root = if self.path.ends_with("main.rs") { "main" } else { "lib" };
        self.module.first().map_or(root, String::as_str)
    }

    /// The code before the unit tests, without comments and texts.
    fn shipped(&self) -> String {
        let text = if self.is_test {
            ""
        } else {
            self.text.split("#[cfg(test)]\nmod tests {").next().unwrap_or("")
        };
        text.lines().map(|line| code(line) + "\n").collect()
    }

    /// Every path, by line: `use` statements are expanded.
    fn paths(&self) -> Vec<(usize, String)> {
        let (mut paths, mut statement) = (Vec::new(), None);
        for (line, number) in self.text.lines().map(code).zip(1..) {
            let begins = line.trim_start().trim_start_matches("pub ").trim_start_matches("pub(crate) ");
            let begins = begins.trim_start_matches("pub(super) ");
            if statement.is_none() && (begins.starts_with("use ") || begins.starts_with("extern crate "))
            {
                statement = Some((number, String::new()));
            }
            let Some((first, text)) = &mut statement else {
                let is_path = |c: char| c.is_alphanumeric() || c == '_' || c == ':';
                let runs = line.split(|c| !is_path(c)).filter(|run| run.contains("::"));
                paths.extend(runs.map(|run| (number, run.trim_start_matches(':').to_string())));
                continue;
            };
            *text += &line;
            if let Some((used, _)) = text.split_once(';') {
                let used = used
                    .rsplit_once("use ")
                    .map_or_else(|| used.replace("extern crate ", ""), |u| u.1.into());
                paths.extend(expanded(&used).into_iter().map(|path| (*first, path)));
                statement = None;
            }
        }
        paths
    }

    /// Where a path leads, from the crate's root; `None` for what is of another crate or a name of this
    /// file.
    fn target(&self, path: &str) -> Option<Vec<String>> {
        let mut words: Vec<&str> = path.split("::").collect();
        let mut from = match words.remove(0) {
            "crate" | "scatterproof" => Vec::new(),
            "self" => self.module.clone(),
            "super" => self.module[..self.module.len().saturating_sub(1)].to_vec(),
            _ => return None,
        };
        while words.first() == Some(&"super") {
            from.pop();
            words.remove(0);
        }
        from.extend(words.into_iter().map(str::to_string));
        Some(from)
    }

    /// Everything that this file breaks, as `path:line: rule`.
    fn violations(&self) -> Vec<String> {
        let (path, top) = (&self.path, self.top());
        let Some(below) = layers_below(top) else {
            return vec![format!("{path}:1: `{top}` has no row in the table of layers")];
        };
        let mut found = Vec::new();
        for (line, used) in self.paths() {
            let root = used.split([':', ' ']).next().unwrap_or_default();
            let door = DOORS.iter().find(|(name, _)| *name == root);
            let is_test = line > self.shipped().lines().count();
            let is_open = |name: &str, doors: &str| has(doors, top) || is_test && has(TEST_CRATES, name);
            if let Some((name, doors)) = door.filter(|(name, doors)| !is_open(name, doors)) {
                found.push(format!("{path}:{line}: `{top}` names `{name}`, whose door is {doors:?}"));
            }
            let target = self.target(&used).and_then(|target| target.into_iter().next());
            let Some(target) = target else { continue };
            // Unit tests stand one module deeper than their file.
            let is_module = has(ORDER, &target) || root == "crate";
            // Closed forms are there for unit tests to compare with, and for nothing else.
            let is_oracle = is_test && target == "reference" && top == "estimators";
            let is_below = target == top
                || ["error", "input"].contains(&target.as_str())
                || below.contains(&target.as_str());
            if is_module && !is_oracle && !is_below {
                found.push(format!("{path}:{line}: `{top}` may not use `{target}`"));
            }
        }
        found.dedup();
        if !self.text.starts_with("//! ") {
            found.push(format!(
                "{path}:1: the first line does not state, after `//! `, what the file is"
            ));
        }
        let longest = LONG.iter().find(|(long, _)| long == path).map_or(LONGEST, |(_, lines)| *lines);
        let lines = self.text.lines().count();
        if lines > longest {
            found.push(format!("{path}:{lines}: longer than {longest} lines"));
        }
        found
    }

    /// Types that it defines outside tests.
    fn types(&self) -> Vec<String> {
        let name_of = |line: &str| {
            let line = line.trim_start_matches("pub ").trim_start_matches("pub(crate) ");
            let line = line.trim_start_matches("pub(super) ").trim_start_matches("pub(in crate) ");
            let (kind, rest) = line.split_once(' ')?;
            let is_type = ["struct", "enum", "trait", "type", "union"].contains(&kind);
            is_type.then(|| {
                rest.split(|c: char| !c.is_alphanumeric()).next().unwrap_or_default().to_string()
            })
        };
        self.shipped().lines().filter_map(name_of).collect()
    }
}

/// A line without its comment, and without the text in quotes.
fn code(line: &str) -> String {
    let bare: Vec<&str> = line.split('"').step_by(2).collect();
    bare.join("\"\"").split("//").next().unwrap_or_default().to_string()
}

/// The paths of a `use`: `a::{b, c::{d, e}}` are `a::b`, `a::c::d` and `a::c::e`.
fn expanded(used: &str) -> Vec<String> {
    let used = used.trim().trim_start_matches("::");
    let Some((head, group)) = used.split_once('{') else {
        let path = used.split(" as ").next().unwrap_or_default();
        // The crate under another name would hide its uses.
        return vec![if path == "crate" { "crate::crate".into() } else { path.to_string() }];
    };
    let (mut parts, mut depth) = (vec![String::new()], 0);
    for c in group.chars() {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            _ => {}
        }
        if c == ',' && depth == 0 {
            parts.push(String::new());
        } else if depth >= 0 {
            parts.last_mut().expect("a part").push(c);
        }
    }
    let parts = parts.iter().filter(|part| !part.trim().is_empty());
    parts.flat_map(|part| expanded(part)).map(|path| format!("{head}{path}")).collect()
}

/// Every source file below `src`.
fn sources() -> Vec<Source> {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut folders = vec![package.join("src")];
    let mut sources = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).expect("a folder of sources") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                let name = path.strip_prefix(package).expect("inside").to_string_lossy();
                sources.push(Source::new(&name, &fs::read_to_string(&path).expect("a source")));
            }
        }
    }
    sources.sort_by(|a, b| a.path.cmp(&b.path));
    sources
}

#[test]
fn the_sources_keep_the_rules() {
    let sources = sources();
    assert!(sources.len() > 80, "only {} sources were found", sources.len());
    let found: Vec<String> = sources.iter().flat_map(Source::violations).collect();
    assert!(found.is_empty(), "{} violations:\n{}", found.len(), found.join("\n"));
}

#[test]
fn every_module_and_every_dependency_has_a_row() {
    let sources = sources();
    let modules: BTreeSet<&str> = sources.iter().map(Source::top).collect();
    assert_eq!(modules, ORDER.split_whitespace().collect());

    let manifest = include_str!("../Cargo.toml");
    let section = manifest.split("[dependencies]").nth(1).expect("dependencies");
    let lines = section.lines().skip(1).take_while(|line| !line.starts_with('['));
    let names = lines.filter_map(|line| line.split_once(" = ")).map(|(name, _)| name.replace('-', "_"));
    let doors: BTreeSet<String> = DOORS.iter().map(|(name, _)| name.to_string()).collect();
    assert_eq!(names.collect::<BTreeSet<String>>(), doors);
}

/// Files and folders of one folder that use each other, as `a/b -> a/c -> a/b`. A folder's `mod.rs` may
/// use what is in it and be used by it.
fn circles(sources: &[Source]) -> Vec<String> {
    let modules: BTreeSet<&[String]> = sources
        .iter()
        .flat_map(|source| (1..=source.module.len()).map(|length| &source.module[..length]))
        .collect();
    let mut uses: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for source in sources.iter().filter(|source| !source.is_test) {
        let shipped = Source { text: source.shipped(), ..Source::new(&source.path, "") };
        for target in shipped.paths().iter().filter_map(|(_, path)| shipped.target(path)) {
            let own = &source.module;
            let same = own.iter().zip(&target).take_while(|(a, b)| a == b).count();
            if same < own.len() && same < target.len() && modules.contains(&target[..=same]) {
                uses.entry(own[..=same].join("/")).or_default().insert(target[..=same].join("/"));
            }
        }
    }
    let none = BTreeSet::new();
    let mut found = Vec::new();
    for start in uses.keys() {
        // Breadth first: the shortest way back. Each cycle is identified by its first name.
        let mut ways = vec![vec![start]];
        let mut seen = BTreeSet::new();
        let mut at = 0;
        while let Some(way) = ways.get(at).cloned() {
            let last = way[way.len() - 1];
            for next in uses.get(last).unwrap_or(&none) {
                if next == start {
                    found.push(format!(
                        "{} -> {start}",
                        way.iter().map(|s| s.as_str()).collect::<Vec<_>>().join(" -> ")
                    ));
                    ways.clear();
                    break;
                }
                if next > start && seen.insert(next) {
                    ways.push([&way[..], &[next]].concat());
                }
            }
            at += 1;
        }
    }
    found
}

#[test]
fn no_files_of_a_folder_use_each_other() {
    let found = circles(&sources());
    assert!(found.is_empty(), "{} circles:\n{}", found.len(), found.join("\n"));
}

/// Names that denote several types, with their places.
fn shared(sources: &[Source]) -> Vec<String> {
    let mut places: BTreeMap<String, Vec<&str>> = BTreeMap::new();
    for source in sources {
        for name in source.types() {
            places.entry(name).or_default().push(&source.path);
        }
    }
    places.retain(|name, places| places.len() > 1 && !SHARED_NAMES.contains(&name.as_str()));
    places.iter().map(|(name, places)| format!("{name}: {}", places.join(", "))).collect()
}

#[test]
fn a_type_name_denotes_one_type() {
    let found = shared(&sources());
    assert!(found.is_empty(), "{} names:\n{}", found.len(), found.join("\n"));
}

/// Types, fields, functions and modules that bear a word of the table where it would mean something
/// else.
fn misused(source: &Source) -> Vec<String> {
    let mut found = Vec::new();
    for (line, number) in source.shipped().lines().zip(1..) {
        let name =
            line.split(|c: char| !c.is_alphanumeric() && c != '_').filter(|word| !word.is_empty());
        let names: Vec<&str> = name.collect();
        let is_field = line.contains(": ") && !line.contains('(') && !line.contains("let ");
        for (at, name) in names.iter().enumerate() {
            let is_defined = at > 0 && ["struct", "enum", "type", "fn", "mod"].contains(&names[at - 1]);
            let is_first = at == 0 || names[at - 1] == "pub";
            let is_named = is_defined || (is_field && is_first);
            if !is_named {
                continue;
            }
            let spaced: String = name
                .chars()
                .map(|c| if c.is_uppercase() { format!("_{c}") } else { c.to_string() })
                .collect();
            let spaced = spaced.to_lowercase();
            for (word, places) in WORDS {
                let is_here = places.iter().any(|place| source.path.starts_with(place));
                if is_here && spaced.split('_').any(|part| part == word) {
                    found.push(format!(
                        "{}:{number}: `{name}`: the word `{word}` means something else",
                        source.path
                    ));
                }
            }
        }
    }
    found
}

#[test]
fn words_mean_what_the_table_states() {
    let found: Vec<String> = sources().iter().flat_map(misused).collect();
    assert!(found.is_empty(), "{} names:\n{}", found.len(), found.join("\n"));

    let table = include_str!("../src/lib.rs");
    for word in [
        "cell",
        "observable",
        "pass",
        "block",
        "batch",
        "technique",
        "estimator",
        "record",
        "claim",
        "verdict",
    ] {
        let rows = table.matches(&format!("//! | {word} | ")).count();
        assert_eq!(rows, 1, "`{word}` has one row in the table of words");
    }
}

/// Rules that a planted text breaks, after a valid first line.
fn planted(path: &str, text: &str) -> String {
    Source::new(path, &format!("//! A file.\n{text}")).violations().join("\n")
}

#[test]
fn planted_edges_are_found() {
    for (path, text, used) in [
        ("src/math/frame.rs", "use crate::sampling::warp;", "sampling"),
        ("src/estimators/path.rs", "use crate::{geometry::Ray, run::job::{a, Job}};", "run"),
        (
            "src/estimators/path.rs",
            "pub(crate) use crate::{\n    geometry::Ray,\n    run::job,\n};",
            "run",
        ),
        ("src/estimators/path.rs", "fn f() { crate::reference::value() }", "reference"),
        ("src/scene/mod.rs", "use crate::results;", "results"),
        ("src/stats/mod.rs", "use super::optics::phase;", "optics"),
        ("src/stats/tree.rs", "use super::super::optics::phase;", "optics"),
        ("src/verify/judge.rs", "use crate::experiment::Experiment;", "experiment"),
        ("src/run/mod.rs", "use crate::report;", "report"),
        ("src/error.rs", "use crate::math;", "math"),
        ("src/main.rs", "fn main() { scatterproof::run::run() }", "run"),
        ("src/stats/mod.rs", "use crate as everything;", "crate"),
        ("src/stats/mod.rs", "use crate::*;", "*"),
        ("src/stats/mod.rs", "use crate::{self as everything};", "self"),
        ("src/stats/mod.rs", "#[cfg(test)] mod tests {\n use crate::optics; }", "optics"),
    ] {
        let found = planted(path, text);
        assert!(found.contains(&format!("`{used}`")), "{text}: {found}");
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
        ("src/geometry/mod.rs", "mod m { fn f() -> rand_pcg::Pcg64 {} }", "rand_pcg"),
    ] {
        let found = planted(path, text);
        assert!(found.contains(&format!("names `{name}`")), "{text}: {found}");
    }
    for (path, text) in [
        ("src/math/mod.rs", "pub use glam::DVec3;"),
        ("src/report/mod.rs", "let png = figure.png; use super::png::write; \"csv::Reader\""),
        ("src/cli/schema.rs", "mod m { fn f() { serde_json::from_str() } }"),
    ] {
        assert_eq!(planted(path, text), "", "{text}");
    }
}

#[test]
fn planted_circles_and_names_are_found() {
    let a = Source::new("src/stats/a.rs", "use super::{b::B, Moments};\npub struct A;\n");
    let mod_rs = Source::new(
        "src/stats/mod.rs",
        "mod a; mod b; mod c;\nuse a::A;\nuse self::c::C;\npub struct Moments;\n",
    );
    let deeper = Source::new("src/stats/b/deep.rs", "fn f() { crate::stats::c::f() }\n");
    let c = |text: &str| Source::new("src/stats/c.rs", text);
    let told = |c: Source| {
        circles(&[
            Source::new(&a.path, &a.text),
            Source::new("src/stats/b/mod.rs", ""),
            Source::new(&deeper.path, &deeper.text),
            c,
            Source::new(&mod_rs.path, &mod_rs.text),
        ])
    };
    assert_eq!(told(c("use super::a;\n")), ["stats/a -> stats/b -> stats/c -> stats/a"]);
    assert_eq!(
        told(c("use super::Moments;\n#[cfg(test)]\nmod tests {\n    use super::super::a;\n}\n")),
        [""; 0]
    );

    let found = shared(&[
        a,
        c("enum Args {}\nenum Own {}\n"),
        Source::new("src/run/x.rs", "pub(crate) struct A<T>(T);\nstruct Args;\n"),
    ]);
    assert_eq!(found, ["A: src/stats/a.rs, src/run/x.rs"]);

    for text in
        ["pub struct CellCount;", "    gates: usize,", "fn gate_of(x: f64) {}", "    pub cell: usize,"]
    {
        assert_eq!(misused(&c(text)).len(), 1, "{text}");
    }
    for text in [
        "pub struct Cancellation;",
        "    let gates: usize = 1;",
        "// fn gate() {}",
        "use std::cell::Cell;",
    ] {
        assert_eq!(misused(&c(text)), [""; 0], "{text}");
    }
}

#[test]
fn planted_lengths_and_first_lines_are_found() {
    let of = |path: &str, text: &str| Source::new(path, text).violations();
    let long = "//! A file.\n".to_string() + &"// x\n".repeat(LONGEST);
    assert!(of("src/run/mod.rs", &long)[0].contains("longer than 700 lines"));
    assert!(of("src/experiment/schema.rs", &long).is_empty());
    let longer = long + &"// x\n".repeat(100);
    assert!(of("src/experiment/schema.rs", &longer)[0].contains("longer than 800 lines"));
    for text in ["", "// A file.\n", "\n//! A file.\n", "use crate::error;\n", "//!\n"] {
        assert!(of("src/run/mod.rs", text)[0].contains("first line"), "{text:?}");
    }
}
