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

/// The published table has defects of the list alone, and all of them were found. (Those that were listed since are missing.)
#[test]
fn published_defects_were_found() {
    let table = fs::read_to_string(package().join("results/published/shipped.csv")).expect("a table");
    let list = fs::read_to_string(package().join("tests/planted.toml")).expect("the list");
    let mut rows = csv::Reader::from_reader(table.as_bytes());
    let mut found = 0;
    for row in rows.records() {
        let row = row.expect("a row");
        assert!(list.contains(&format!("name = \"{}\"", &row[0])), "{} is not in the list", &row[0]);
        assert_eq!(&row[3], "yes", "{}", &row[0]);
        found += 1;
    }
    assert!(found >= 10, "{found} rows");
}
