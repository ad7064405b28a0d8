//! Overrides, settings, sweeps, and what a loaded experiment holds.

use serde_json::json;

use super::*;
use crate::experiment::load;

fn set_error(sets: &[&str]) -> String {
    try_load(GOOD, sets).map(|_| ()).expect_err("the override is refused").to_string()
}

fn content(experiment: &Experiment) -> serde_json::Value {
    experiment.cells[0].content()
}

fn sweep(text: &str) -> String {
    refused_with(&format!("[[sweep]]\n{text}\n"))
}

#[test]
fn set_replaces_leaves_variants_and_elements() {
    let loaded = |sets: &[&str]| try_load(GOOD, sets).unwrap_or_else(|e| panic!("{e}"));
    let one = loaded(&["object.shape.sphere.radius_mm=2", "light.0.directional.irradiance=[1, 2, 3]"]);
    assert_eq!(content(&one)["object"]["shape"], json!({ "sphere": { "radius_mm": 2.0 } }));
    assert_eq!(content(&one)["light"][0]["directional"]["irradiance"], json!([1.0, 2.0, 3.0]));
    let box_shape = json!({ "box": { "size_mm": [1.0, 1.0, 1.0] } });
    for set in
        ["object.shape.box={ size_mm = [1, 1, 1] }", "object.shape={ box = { size_mm = [1, 1, 1] } }"]
    {
        assert_eq!(content(&loaded(&[set]))["object"]["shape"], box_shape);
    }
    assert_eq!(loaded(&["budget.cpu_seconds=1.5"]).resolved()["budget"], json!({ "cpu_seconds": 1.5 }));
    assert_eq!(loaded(&["name=other"]).file.name, "other");
    assert_eq!(loaded(&["light.1={ environment = { radiance = 1 } }"]).cells[0].light.len(), 2);
}

#[test]
fn bad_overrides_are_refused_at_the_argument() {
    let message = set_error(&["object.shape.box.size_mm=[1, 1, 1]"]);
    assert!(message.contains("`object.shape` is `sphere` here: it has no `box.size_mm`"), "{message}");
    let message = set_error(&["object.shape.sphere.radius_mm=-1"]);
    assert!(message.contains("must be greater than 0, is -1"), "{message}");
    assert!(message.contains("--set:1:31"), "{message}");
    let message =
        set_error(&["object.shpe.sphere.radius_mm=1", "seed.x=1", "light.7.name=sun", "a..b=1"]);
    for part in [
        "`seed` is not a table, `x` cannot be set in it",
        "`light` has 1 entries, index 7 is past its end",
        "`a..b` is not a dotted key",
    ] {
        assert!(message.contains(part), "no `{part}` in:\n{message}");
    }
    let message = set_error(&["object.shpe.sphere.radius_mm=1"]);
    assert!(message.contains("unknown key `shpe`") && message.contains("--set:1:1"), "{message}");
}

#[test]
fn settings_come_before_set() {
    let text = format!(
        "{GOOD}[setting.fast]\nbudget.passes = 4\n\"object.boundary.matched\" = {{}}\nseed = 7\n"
    );
    let load = |setting: &str, sets: &[&str]| {
        let sets = sets.iter().map(|s| s.to_string()).collect();
        let options = LoadOptions { sets, setting: Some(setting.into()) };
        load_text(Path::new("x.toml"), &text, &options, &registry())
    };
    let fast = load("fast", &["seed=8"]).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(fast.resolved()["budget"], json!({ "passes": 4 }));
    assert_eq!(content(&fast)["object"]["boundary"], json!({ "matched": {} }));
    assert_eq!(fast.file.seed, Some(8));
    let origin =
        |key: &str| fast.origins.iter().find(|(k, ..)| k == key).map(|(_, v, o)| format!("{v} {o}"));
    assert_eq!(origin("budget.passes").as_deref(), Some("4 setting `fast` (x.toml:15:17)"));
    assert_eq!(origin("seed").as_deref(), Some("8 --set seed=8"));
    assert_eq!(origin("name").as_deref(), Some("\"good\" x.toml:1:8"));
    assert_eq!(origin("sensor.probe.paths_per_pass").as_deref(), Some("1024 default"));
    assert_eq!(origin("display.exposure_stops").as_deref(), Some("0.0 default"));
    let message = load("fst", &[]).map(|_| ()).expect_err("an unknown setting").to_string();
    assert!(
        message.contains("unknown setting `fst`") && message.contains("did you mean `fast`?"),
        "{message}"
    );
}

#[test]
fn sweeps_multiply() {
    let sweeps = r#"[[sweep]]
key = "object.shape.sphere.radius_mm"
values = [1, 2.5]
[[sweep]]
name = "surface"
keys = ["object.boundary", "light.0.directional.irradiance"]
rows = [
  { label = "smooth", values = [{ smooth = { eta = 1.5 } }, 1] },
  { label = "matched", values = [{ matched = {} }, 2] },
]
"#;
    let text = GOOD.replace("object.boundary.smooth = { eta = 1.3 }\n", "") + sweeps;
    let experiment = good(&text);
    let labels: Vec<&str> = experiment.cells.iter().map(|cell| cell.label.as_str()).collect();
    assert_eq!(labels, ["1, smooth", "1, matched", "2.5, smooth", "2.5, matched"]);
    assert_eq!(experiment.axes[0].name, "radius_mm");
    assert_eq!(experiment.axes[1].labels, ["smooth", "matched"]);
    let cell = &experiment.cells[3];
    assert_eq!(cell.axes["surface"], "matched");
    assert_eq!(cell.content()["object"]["boundary"], json!({ "matched": {} }));
    assert_eq!(cell.sweep_values["object.shape.sphere.radius_mm"], json!(2.5));
    let over = ["object.boundary".to_string(), "light.0.directional.irradiance".to_string()];
    assert_eq!(cell.content_without(&over), experiment.cells[2].content_without(&over));
    assert_ne!(cell.content(), experiment.cells[2].content());
}

#[test]
fn sweeps_have_one_form() {
    let rule =
        "a sweep needs exactly one of `key` with `values`, `keys` with `rows`, `csv`; found `key`";
    holds(&sweep("key = \"object.shape\""), rule, "14:1", "");
    holds(&sweep("key = \"object.shape\"\nvalues = []"), "empty sweep", "16:10", "");
    holds(&sweep("keys = [\"object.shape\"]\nrows = []"), "empty sweep", "16:8", "");
    let rows = "keys = [\"object.shape\"]\nrows = [{ label = \"a\", values = [1, 2] }]";
    holds(&sweep(rows), "the row has 2 values for 1 keys", "16:33", "");
}

#[test]
fn sweeps_set_keys_of_cells_once() {
    let message = sweep("key = \"bands.rgb\"\nvalues = [4, 8]");
    holds(&message, "`bands.rgb` cannot be swept", "15:7", "`light`, `estimator` or `budget`");
    let radius = "key = \"object.shape.sphere.radius_mm\"\nvalues = [1, 2]";
    let message = sweep(&format!("{radius}\n[[sweep]]\nname = \"again\"\n{radius}"));
    holds(&message, "`object.shape.sphere.radius_mm` is swept twice", "19:7", "");
    let whole = "key = \"object.shape\"\nvalues = [{ half_space = {} }]";
    let rule =
        "`object.shape` and `object.shape.sphere.radius_mm` are swept, and one contains the other";
    holds(&sweep(&format!("{radius}\n[[sweep]]\n{whole}")), rule, "18:7", "");
    let message = sweep(&format!("name = \"a\"\n{radius}\n[[sweep]]\nname = \"a\"\n{whole}"));
    assert!(message.contains("two axes are named `a`") && message.contains("x.toml:19:8"), "{message}");
    holds(
        &sweep(&radius.replace("[1, 2]", "[1, 1]")),
        "label `1` occurs twice on the axis",
        "16:14",
        "",
    );
    let text = format!("{GOOD}[[sweep]]\n{radius}\n");
    let error = try_load(&text, &["object.shape.sphere.radius_mm=3"]).map(|_| ());
    let message = error.expect_err("the override is lost").to_string();
    let rule =
        "`object.shape.sphere.radius_mm` has no effect: the sweep `radius_mm` sets it in every cell";
    assert!(message.contains(rule), "{message}");
}

#[test]
fn values_of_sweeps_are_checked_in_their_cells_once() {
    let radii = "key = \"object.shape.sphere.radius_mm\"\nvalues = [1, -2]";
    let gs = "[[sweep]]\nkey = \"object.medium.coefficients.g\"\nvalues = [0.1, 0.2]";
    let message = sweep(&format!("{radii}\n{gs}"));
    holds(&message, "must be greater than 0, is -2", "16:14", "");
    let message = sweep("key = \"object.boundry\"\nvalues = [{ matched = {} }]");
    holds(&message, "unknown key `boundry`", "15:7", "did you mean `boundary`?");
}

/// A folder with an experiment that sweeps over a CSV file.
fn with_csv(csv: &str, sweep: &str) -> (tempfile::TempDir, Result<Experiment, Error>) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    std::fs::write(folder.path().join("t.csv"), csv).expect("the table is written");
    let path = folder.path().join("x.toml");
    std::fs::write(&path, format!("{GOOD}[[sweep]]\n{sweep}\n")).expect("the file is written");
    let loaded = load(&path, &LoadOptions::default(), &registry());
    (folder, loaded)
}

const CSV_SWEEP: &str = r#"name = "table"
csv = { path = "t.csv", columns = { r = "object.shape.sphere.radius_mm", a = "object.medium.coefficients.albedo" } }
[[claim]]
equals = { column = "expected", source = "a table" }"#;

fn csv_error(csv: &str, sweep: &str) -> String {
    with_csv(csv, sweep).1.map(|_| ()).expect_err("the table is refused").to_string()
}

#[test]
fn rows_come_from_csv_files() {
    let csv = "# comment\nr, a, expected\n1, 0.5, 0.25\n# more\n2, 1e-1, 0.125\n";
    let experiment = with_csv(csv, CSV_SWEEP).1.unwrap_or_else(|e| panic!("{e}"));
    let cell = &experiment.cells[1];
    assert_eq!((cell.label.as_str(), cell.csv_line), ("1e-1, 2", Some(5)));
    assert_eq!(cell.csv_row["expected"], "0.125");
    assert_eq!(cell.content()["object"]["medium"]["coefficients"]["albedo"], json!(0.1));
    let labelled =
        with_csv("label,r,a,expected\nx,1,0.5,1\n", CSV_SWEEP).1.unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(labelled.axes[0].labels, ["x"]);
}

#[test]
fn rows_of_csv_files_can_be_left_out() {
    let csv = "r,a,expected\n1,0.5,1\n1,0.9,2\n2,0.5,3\n2.0,0.9,4\n3,0.9,5\n";
    let except = |rows: &str| {
        let albedo = "\"object.medium.coefficients.albedo\" }";
        CSV_SWEEP.replace(albedo, &format!("{albedo}, except = {rows}"))
    };
    let labels = |rows: &str| {
        let experiment = with_csv(csv, &except(rows)).1.unwrap_or_else(|e| panic!("{e}"));
        experiment.axes[0].labels.join(" | ")
    };
    assert_eq!(labels("{ r = [2, 3], a = [0.9] }"), "0.5, 1 | 0.9, 1 | 0.5, 2");
    assert_eq!(labels("{ a = [0.5] }"), "0.9, 1 | 0.9, 2.0 | 0.9, 3");
    assert_eq!(labels("{}").split(" | ").count(), 5);
    let message = csv_error(csv, &except("{ r = [2, 4] }"));
    assert!(message.contains("no row of the CSV file has r = 4"), "{message}");
    let message = csv_error(csv, &except("{ radius = [2] }"));
    assert!(message.contains("the CSV file has no column `radius`"), "{message}");
    let message = csv_error(csv, &except("{ r = [1, 2, 3] }"));
    assert!(message.contains("empty sweep"), "{message}");
}

#[test]
fn bad_csv_files_are_refused_at_their_line() {
    let message = csv_error("r,expected\n1,2\n", CSV_SWEEP);
    assert!(
        message.contains("the CSV file has no column `a`") && message.contains("x.toml:16:"),
        "{message}"
    );
    let message = csv_error("r,a,expected\n1,0.5,1\n2,high,2\n", CSV_SWEEP);
    assert!(message.contains("expected a number, an array or a table, found a string"), "{message}");
    assert!(message.contains("t.csv:3:3"), "{message}");
    let message = csv_error("r,a,expected\n1,0.5,1\n2,0.5,much\n", CSV_SWEEP);
    assert!(message.contains("column `expected` must be a number, is `much`"), "{message}");
    assert!(message.contains("t.csv:3:7"), "{message}");
    let message = csv_error("r,a,expected\n1,0.5\n2,0.5,much\n", CSV_SWEEP);
    assert!(
        message.contains("the row has 2 fields, the header 3") && message.contains("t.csv:2:1"),
        "{message}"
    );
    let message = csv_error("r\n1\n", "csv = { path = \"t.csv\", columns = {} }");
    assert!(message.contains("empty sweep: `columns` sets no key"), "{message}");
    let message = csv_error("r,a,expected\n", CSV_SWEEP);
    assert!(message.contains("empty sweep"), "{message}");
    let message = csv_error("", &CSV_SWEEP.replace("t.csv", "u.csv"));
    assert!(message.contains("could not read") && message.contains("x.toml:16:16"), "{message}");
}

#[test]
fn a_resolved_experiment_loads_to_the_same_cells() {
    let (_folder, loaded) = with_csv("label,r,a,expected\nx,1,0.50,1.0\ny,2,0.25,2\n", CSV_SWEEP);
    let first = loaded.unwrap_or_else(|e| panic!("{e}"));
    let text = toml::to_string(&first.resolved()).expect("it is TOML");
    let again = good(&text);
    let strip = |experiment: &Experiment| {
        let cells = experiment.cells.iter().cloned();
        cells.map(|cell| super::super::CellSpec { csv_line: None, ..cell }).collect::<Vec<_>>()
    };
    assert_eq!(strip(&first), strip(&again));
    assert_eq!((&first.axes, first.resolved()), (&again.axes, again.resolved()));
    assert_eq!(again.cells[0].csv_row["a"], "0.50");
}

#[test]
fn content_has_sorted_keys_and_floats() {
    let text = good(GOOD).cells[0].content().to_string();
    assert!(
        text.starts_with(
            r#"{"light":[{"directional":{"irradiance":1.0,"toward":[1.0,1.0,1.0]}}],"object":"#
        ),
        "{text}"
    );
}
