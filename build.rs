//! Notes the compiler's version and the commit that is built, which a record's provenance states.

use std::process::Command;

/// What the program is made of.
const SOURCES: [&str; 4] = ["src", "Cargo.toml", "Cargo.lock", "build.rs"];

fn main() {
    for path in SOURCES {
        println!("cargo::rerun-if-changed={path}");
    }
    let rustc = std::env::var("RUSTC").unwrap_or_else(|_| "rustc".into());
    if let Some(version) = output(&rustc, &["--version"]) {
        println!("cargo::rustc-env=SCATTERPROOF_RUSTC={version}");
    }

    // A commit alone does not build the program anew (minutes, after every change of a page).
    // Without a change of the sources since, the older commit is as right; who needs the newest
    // (scripts/reproduce), or builds without git, names it.
    println!("cargo::rerun-if-env-changed=SCATTERPROOF_COMMIT");
    let named = std::env::var("SCATTERPROOF_COMMIT").ok().filter(|commit| !commit.is_empty());
    // git would find another project's checkout above an unpacked package.
    let own = std::path::Path::new(".git").exists();
    let git = |arguments: &[&str]| output("git", arguments).filter(|_| own);
    if let Some(commit) = named.or_else(|| git(&["rev-parse", "HEAD"])) {
        println!("cargo::rustc-env=SCATTERPROOF_COMMIT={commit}");
    }
    if let Some(changes) = git(&[&["status", "--porcelain", "--"][..], &SOURCES[..]].concat()) {
        println!("cargo::rustc-env=SCATTERPROOF_DIRTY={}", !changes.is_empty());
    }
}

/// What a command prints; nothing where it fails or is not there.
fn output(program: &str, arguments: &[&str]) -> Option<String> {
    let output = Command::new(program).args(arguments).output().ok()?;
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_string())
}
