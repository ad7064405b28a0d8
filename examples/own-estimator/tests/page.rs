//! What docs/own-estimator.md shows is this crate, and what its commands print.
//!
//!   cargo test --release -p own-estimator
//!   cargo test --release -p own-estimator --features planted       the one command that plants the defect

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

const PAGE: &str = "../../docs/own-estimator.md";

fn text(path: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// The fenced blocks of a page: tag, number of the first line, lines.
fn blocks(page: &str) -> Vec<(&str, usize, Vec<&str>)> {
    let (mut blocks, mut open) = (Vec::new(), None);
    for (line, number) in page.lines().zip(1..) {
        match (line.strip_prefix("```"), &mut open) {
            (Some(tag), None) => open = Some((tag, number + 1, Vec::new())),
            (Some(_), Some(_)) => blocks.extend(open.take()),
            (None, Some((_, _, lines))) => lines.push(line),
            (None, None) => {}
        }
    }
    blocks
}

#[test]
fn the_page_quotes_the_crate() {
    let files = ["src/ballistic.rs", "src/main.rs", "Cargo.toml", "experiment.toml"].map(text);
    let page = text(PAGE);
    let (mut count, mut is_whole) = (0, false);
    for (tag, line, lines) in blocks(&page) {
        let block: String = lines.iter().map(|line| format!("{line}\n")).collect();
        if tag == "rust" || tag == "toml" {
            assert!(files.iter().any(|file| file.contains(&block)), "{PAGE}:{line}: in no file");
            count += 1;
            is_whole |= block == files[3];
        }
    }
    assert!(count >= 6, "{count} quotes");
    assert!(is_whole, "{PAGE} has the experiment whole");
}

/// An empty folder with the experiment.
fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).expect("a folder");
    fs::write(folder.join("experiment.toml"), text("experiment.toml")).expect("the experiment");
    folder
}

/// What the program prints, and its exit code.
fn run(folder: &Path, arguments: &str) -> (String, i32) {
    let mut program = Command::new(env!("CARGO_BIN_EXE_own-estimator"));
    let ran =
        program.args(arguments.split_whitespace()).current_dir(folder).output().expect("it starts");
    let code = ran.status.code().unwrap_or(-1);
    let said = String::from_utf8_lossy(&ran.stdout) + String::from_utf8_lossy(&ran.stderr);
    (format!("{said}exit code {code}"), code)
}

/// Runs those of the page's commands that are for this build, and looks for every line that it shows of their output.
#[test]
fn the_program_does_what_the_page_shows() {
    let is_planted = cfg!(feature = "planted");
    let folder = folder(if is_planted { "planted" } else { "own" });
    let (mut count, page) = (0, text(PAGE));
    for (_, first, lines) in blocks(&page).into_iter().filter(|(tag, ..)| *tag == "console") {
        let mut said = None;
        for (shown, line) in lines.into_iter().zip(first..) {
            if let Some(command) = shown.strip_prefix("$ ") {
                let (cargo, arguments) =
                    command.split_once(" -- ").unwrap_or_else(|| panic!("{PAGE}:{line}"));
                let is_ours = cargo.ends_with("--features planted") == is_planted;
                said = is_ours.then(|| run(&folder, arguments).0);
                count += usize::from(is_ours);
            } else if let Some(said) = &said {
                let is_there =
                    shown == "..." || said.lines().any(|line| line.trim_end() == shown.trim_end());
                assert!(is_there, "{PAGE}:{line}: `{shown}` is not in:\n{said}");
            }
        }
    }
    assert!(count >= if is_planted { 1 } else { 7 }, "{count} commands");
}

/// The planted defect turns the claim red, and nothing else does.
#[test]
fn the_claim_finds_the_planted_defect() {
    let (said, code) = run(&folder("claim"), "verify experiment.toml");
    assert_eq!(code, i32::from(cfg!(feature = "planted")), "{said}");
}

#[test]
fn bad_input_is_refused() {
    let folder = folder("refused");
    let (said, code) =
        run(&folder, "plan experiment.toml --dry --set object.boundary={smooth={eta=1.3}}");
    assert!(code == 2 && said.contains("ballistic needs a matched boundary"), "{said}");
    let (said, code) = run(&folder, "check experiment.toml --set estimator.1.ballistic.beams=3");
    assert!(code == 2 && said.contains("unknown key `beams`"), "{said}");
}
