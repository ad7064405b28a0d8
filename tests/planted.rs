//! The defects of `scripts/plant.py` apply to the source as it is.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use toml::{Table, Value};

fn package() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Each text that a defect replaces occurs once, and what is to find it exists.
#[test]
fn planted_defects_apply() {
    let list = fs::read_to_string(package().join("tests/planted.toml")).expect("the list");
    let list: Table = list.parse().expect("TOML");
    let mut names = BTreeSet::new();
    for defect in list["defect"].as_array().expect("defects") {
        let text = |key: &str| defect[key].as_str().unwrap_or_else(|| panic!("{key} of {defect}"));
        let name = text("name");
        assert!(names.insert(name), "{name} is there twice");
        let source = fs::read_to_string(package().join(text("file"))).expect("a source file");
        assert_eq!(source.matches(text("find")).count(), 1, "{name}: occurrences in {}", text("file"));
        assert_ne!(text("find"), text("replace"), "{name} changes nothing");
        let words = |key: &str| -> Vec<&str> {
            let list = defect.get(key).and_then(Value::as_array).into_iter().flatten();
            list.map(|word| word.as_str().expect("a name")).collect()
        };
        for file in words("verify") {
            let path = package().join(format!("experiments/verify/{file}.toml"));
            assert!(path.is_file(), "{name}: no file {}", path.display());
        }
        assert!(words("verify").len() + words("tests").len() > 0, "{name}: nothing is to find it");
    }
    assert!(names.len() >= 10, "{} defects", names.len());
}
