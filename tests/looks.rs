//! `verify` looks twice, counts nights, and runs passes of records again.

use serde_json::Value;

use super::work::{SENSOR, Work, edit, replaced};

/// One band, one estimator, a probe.
fn grey() -> String {
    let text = edit("bands = { rgb = {} }", "bands = { explicit = [{ name = \"grey\" }] }");
    let medium = "sigma_t_per_mm = [1, 2, 4], albedo = [0.9, 0.8, 0.7]";
    let text = replaced(&text, medium, "sigma_t_per_mm = 2, albedo = 0.9");
    let text = replaced(
        &text,
        SENSOR,
        "sensor.probe = { point_mm = [0.2, 0, 3], toward = [0, 0, -1], paths_per_pass = 64 }",
    );
    let analog = "[[estimator]]\nname = \"analog\"\npath = { roulette = { analog = {} } }\n";
    let sun = "[[light]]\nname = \"sun\"\ndirectional = { toward = [1, 0, 1], irradiance = 1.0 }\n";
    let text = replaced(&replaced(&text, analog, ""), sun, "");
    replaced(&text, "passes = 100", "passes = 1024")
}

fn json(text: &str) -> Value {
    serde_json::from_str(text).expect("JSON")
}

/// Mean and standard error of the experiment's first measurement.
fn measured(text: &str) -> (f64, f64) {
    let work = Work::with(text);
    work.run("run x.toml -q").exits(0);
    let first = &json(&work.read("results/x/summary.json"))["measurements"][0];
    let number = |key: &str| first[key].as_f64().expect(key);
    (number("mean"), number("std_error"))
}

fn equals(value: f64) -> String {
    format!("{}[[claim]]\nname = \"c\"\nequals = {{ value = {value}, source = \"a test\" }}\n", grey())
}

#[test]
fn a_second_look_is_run_and_decides() {
    // A value 4.3 standard errors from what the first look is known to find: p = 6e-5, between the
    // levels.
    let (mean, error) = measured(&grey());
    let work = Work::with(&equals(mean - 4.3 * error));
    let ran = work.run("verify x.toml -q");
    ran.exits(1).complains("second look at x").says("at both looks");
    let record = json(&work.read("results/x/retest/record/record.json"));
    assert_eq!(
        (&record["stage"], &record["cells"][0]["runs"][0]["passes"]),
        (&"retest".into(), &4096.into())
    );
    // The retest exists now: nothing is run again, the report is the same.
    let again = work.run("verify x.toml -q");
    again.exits(1).says("at both looks").check(!again.stderr().contains("second look"), "it is there");
    assert!(work.read("results/x/verdicts.csv").contains("at both looks"));
    work.run("report results/x").exits(0);
    assert!(work.read("results/x/verdicts.csv").contains("at both looks"));
    // A folder without its second look is not green either, and its message names the second look.
    std::fs::remove_dir_all(work.path("results/x/retest")).expect("removed");
    work.run("verify results/x").exits(1).says("needs a second look on fresh streams");
    // Nearer, the first look is enough.
    let work = Work::with(&equals(mean - 2.0 * error));
    work.run("verify x.toml -q").exits(0);
    assert!(!work.path("results/x/retest").exists());
}

#[test]
fn controls_and_each_class() {
    let analog = "[[estimator]]\nname = \"analog\"\npath = { roulette = { analog = {} } }\n";
    let sweep = "[[sweep]]\nkey = \"object.medium.coefficients.albedo\"\nvalues = [0.9, 0.8]\n";
    let claimed = |claim: &str| {
        let text = replaced(&grey(), "passes = 1024", "passes = 4096");
        let work = Work::with(&format!("{text}{analog}{sweep}[[claim]]\n{claim}\n"));
        work.run("verify x.toml -q --verbose")
    };
    // Absorption matters; the way to end a path does not, and a control that claims so is red.
    let found = claimed("differs = { estimators = [\"mis\"], across = \"albedo\" }");
    found.exits(0).says("control, expects a difference");
    let same = claimed("differs = { estimators = [\"mis\", \"analog\"] }");
    same.exits(1).says("no difference found");
    let twice = "expect = \"differs\"\ndiffers = { estimators = [\"mis\", \"analog\"] }";
    claimed(twice).exits(2).complains("`differs` states what is expected already");
    // Each class and their sum; the power is relative to the sum.
    let each = claimed("agree = { estimators = [\"mis\", \"analog\"], class = \"each\", detect = 0.2 }");
    for class in ["all", "surface", "single ", "single_internal", "multiple ", "multiple_internal"] {
        each.says(class);
    }
    each.exits(0).says("12 of 12 verdicts are green");
}

#[test]
fn records_come_out_again() {
    let claim = |more: &str| format!("{}[[claim]]\nreproduces = {{ passes = 50{more} }}\n", grey());
    let work = Work::with(&claim(""));
    work.run("verify x.toml -q --verbose --threads 2").exits(0).says("the same bits").says("replay");
    let numbers =
        json(&work.read("results/x/summary.json"))["numbers"].as_str().expect("a hash").to_string();
    let work = Work::with(&claim(&format!(", numbers = \"{numbers}\"")));
    work.run("verify x.toml -q --verbose").exits(0).says("checksum");
    let work = Work::with(&claim(", numbers = \"other\""));
    work.run("verify x.toml -q").exits(1).says("the claim wants other");
}

#[test]
fn fresh_streams_and_their_nights() {
    let (mean, _) = measured(&grey());
    let work = Work::with(&equals(mean));
    let first = work.run("verify x.toml -q --fresh-seed monday");
    first.complains("--fresh-seed \"monday\"").says("evidence over 1 nights: 0 alarms");
    work.run("verify x.toml -q --fresh-seed tuesday").says("evidence over 2 nights");
    work.run("verify x.toml -q --fresh-seed monday").says("these streams are counted already");
    let nights = json(&work.read("results/fresh/evidence.json"));
    assert_eq!(nights["tokens"], serde_json::json!(["monday", "tuesday"]));
    assert_eq!(nights["tests"].as_object().expect("tests").len(), 1, "{nights:#}");
    assert!(!work.path("results/x").exists(), "the records of the file's own streams stay as they are");
    work.write("results/fresh/evidence.json", "{");
    work.run("verify x.toml -q --fresh-seed monday").exits(3).complains("not a state of nights");
    // The date and the commit where nothing is named.
    work.run("verify x.toml -q --fresh-seed --evidence e.json").complains("--fresh-seed \"20");
    assert!(work.path("e.json").exists());
    work.run("verify x.toml --evidence e.json").exits(2).complains("--fresh-seed");
}

/// A mistake in the last of three files is told before the first is run.
#[test]
fn all_files_are_checked_before_the_first_runs() {
    let work = Work::with(&equals(1.0));
    let malformed = equals(1.0).replace("value = 1", "valu = 1");
    std::fs::write(work.path("y.toml"), malformed).expect("written");
    // Valid as a text, and its sensor is inside the body.
    let inside = equals(1.0).replace("[0.2, 0, 3]", "[0.2, 0, 0]");
    std::fs::write(work.path("z.toml"), inside).expect("written");
    let found = work.run("verify x.toml y.toml z.toml -q");
    found.exits(2).complains("unknown key").complains("inside or on the body");
    assert!(!work.path("results/x").exists(), "nothing was run");
}
