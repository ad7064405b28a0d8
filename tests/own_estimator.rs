//! The crate of one's own in `examples/own-estimator`: built as a stranger would build it, and what its page shows.

use std::path::{Path, PathBuf};
use std::process::Command;

use super::docs::{blocks, package, text};
use super::work::Work;

const PAGE: &str = "docs/own-estimator.md";
const CRATE: &str = "examples/own-estimator";

/// Builds the program with or without the planted defect, into a folder.
///
/// The integration tests are named beside it because they are built already, and because they fix the features of
/// all dependencies: alone, the program would have half the tree compiled again.
fn build(into: &Path, features: &[&str]) -> PathBuf {
    let test = std::env::current_exe().expect("the test's own path");
    let profile = test.ancestors().nth(2).expect("the profile's folder");
    let name = profile.file_name().and_then(|name| name.to_str()).expect("the profile");
    let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or("cargo".into()));
    cargo.current_dir(package()).args(["build", "--offline", "--locked", "--quiet"]);
    cargo.args(["--profile", if name == "debug" { "dev" } else { name }]);
    cargo.arg("--target-dir").arg(profile.parent().expect("the target folder"));
    cargo.args([
        "-p",
        "scatterproof",
        "--test",
        "integration",
        "-p",
        "own-estimator",
        "--bin",
        "own-estimator",
    ]);
    let output = cargo.args(features).output().expect("cargo starts");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{cargo:?}\n{said}");
    let program = format!("own-estimator{}", std::env::consts::EXE_SUFFIX);
    let copy = into.join(if features.is_empty() { "own" } else { "planted" });
    std::fs::copy(profile.join(program), &copy).expect("the program");
    copy
}

#[test]
fn its_page_quotes_the_crate() {
    let page = text(PAGE);
    let files = ["src/ballistic.rs", "src/main.rs", "Cargo.toml", "experiment.toml"];
    let files = files.map(|name| text(&format!("{CRATE}/{name}")));
    let mut count = 0;
    for block in blocks(&page, "rust").into_iter().chain(blocks(&page, "toml")) {
        let is_quoted = files.iter().any(|file| file.contains(&block.text()));
        assert!(is_quoted || block.tag.ends_with(" other"), "{PAGE}:{}: in no file", block.lines[0].0);
        count += usize::from(is_quoted);
    }
    assert!(count >= 6, "{count} quotes");
    let all = |file: &String| blocks(&page, "toml").iter().any(|block| block.text() == *file);
    assert!(all(&files[3]), "{PAGE} has the experiment whole");
}

/// Runs the page's commands and looks for every line that it shows of their output.
#[test]
fn it_builds_and_does_what_its_page_shows() {
    let work = Work::new();
    let own = build(&work.path(""), &[]);
    let planted = build(&work.path(""), &["--features", "own-estimator/planted"]);
    work.write("experiment.toml", &text(&format!("{CRATE}/experiment.toml")));
    let page = text(PAGE);
    let mut count = 0;
    for block in blocks(&page, "console") {
        let mut said = String::new();
        for (line, shown) in &block.lines {
            let Some(command) = shown.strip_prefix("$ ") else {
                let is_there =
                    *shown == "..." || said.lines().any(|line| line.trim_end() == shown.trim_end());
                assert!(is_there, "{PAGE}:{line}: `{shown}` is not in:\n{said}");
                continue;
            };
            let (cargo, arguments) =
                command.split_once(" -- ").unwrap_or_else(|| panic!("{PAGE}:{line}"));
            let program = if cargo.ends_with("--features planted") { &planted } else { &own };
            let ran = work.run_program(program, arguments);
            said = ran.stdout() + &ran.stderr() + &format!("exit code {}", ran.code().unwrap_or(-1));
            count += 1;
        }
    }
    assert!(count >= 8, "{count} commands");

    let run = |arguments: &str| work.run_program(&own, arguments);
    let ran = run("plan experiment.toml --dry --set object.boundary={smooth={eta=1.3}}");
    ran.exits(2).complains("ballistic needs a matched boundary");
    work.run("check experiment.toml").exits(2).complains("unknown k").complains("`ballistic`");
}
