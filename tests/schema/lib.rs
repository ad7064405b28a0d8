//! The published schema, by a validator that is not the program's: it takes every shipped experiment and the example of
//! `init`, and refuses what the program refuses by its schema.

#![forbid(unsafe_code)]
#![cfg(test)]

use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

/// A small experiment.
const EXPERIMENT: &str = r#"name = "small"
bands = { rgb = {} }
object.shape.sphere = { radius_mm = 1.0 }
object.boundary.smooth = { eta = 1.3 }
object.medium.coefficients = { sigma_t_per_mm = 1.0, albedo = 0.9, g = 0.0 }
sensor.orthographic = { resolution = [4, 4], center_mm = [0, 0, 5], toward = [0, 0, -1], up = [0, 1, 0], width_mm = 2.2 }
light = [{ name = "sky", environment = { radiance = 1.0 } }]
estimator = [{ name = "mis", path = {} }]
budget.passes = 100
"#;

fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
}

/// What the program prints.
fn printed(argument: &str) -> String {
    let program = root().join("target/release/scatterproof");
    let output = Command::new(&program).arg(argument).output();
    let output = output.unwrap_or_else(|e| panic!("{}: {e}; cargo build --release", program.display()));
    assert!(output.status.success(), "{argument}");
    String::from_utf8(output.stdout).expect("text")
}

fn json(text: &str) -> Value {
    toml::from_str(text).expect("it is TOML")
}

/// Every experiment of the repository.
fn shipped() -> Vec<PathBuf> {
    let mut folders = vec![root().join("experiments")];
    let mut files = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "toml") {
                files.push(path);
            }
        }
    }
    assert!(files.len() > 40, "{} experiments", files.len());
    files
}

#[test]
fn the_schema_takes_every_experiment() {
    let schema: Value = serde_json::from_str(&printed("schema")).expect("it is JSON");
    jsonschema::meta::validate(&schema).expect("a schema");
    let validator = jsonschema::validator_for(&schema).expect("a schema");
    for file in shipped() {
        let value = json(&std::fs::read_to_string(&file).expect("a file"));
        let wrong: Vec<String> =
            validator.iter_errors(&value).map(|e| format!("{}: {e}", e.instance_path())).collect();
        assert!(wrong.is_empty(), "{}: {wrong:#?}", file.display());
    }
    assert!(validator.is_valid(&json(EXPERIMENT)));
    let sweep = "[[sweep]]\nkey = \"object.shape.sphere.radius_mm\"\nvalues = [1, 2]\n";
    let edit = |old: &str, new: &str| {
        assert!(EXPERIMENT.contains(old), "{old}");
        EXPERIMENT.replace(old, new)
    };
    for (old, new, more) in [
        ("radius_mm", "radius_m", ""),
        ("radius_mm", "radius_m", sweep),
        ("sphere = { radius_mm = 1.0 }", "sphere = {}", ""),
        ("radius_mm = 1.0", "radius_mm = \"one\"", ""),
        ("path = {}", "pth = {}", ""),
        ("budget.passes = 100\n", "", ""),
    ] {
        let text = edit(old, new) + more;
        assert!(!validator.is_valid(&json(&text)), "`{new}` is accepted");
    }
    let swept = edit("sphere = { radius_mm = 1.0 }", "sphere = {}") + sweep;
    assert!(validator.is_valid(&json(&swept)), "a row gives what is missing");
}
