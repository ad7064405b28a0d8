//! Rules of pictures.

use super::*;
use crate::experiment::picture::wanted;
use crate::results::pictures::Wanted;

const SWEEP: &str = r#"[[sweep]]
key = "object.medium.coefficients.g"
values = [0.0, 0.8]
"#;

/// The good experiment with pixels, two estimators, a sweep over `g` and one picture, which begins at
/// line 20.
fn text(picture: &str) -> String {
    let pixels = "sensor.orthographic = { resolution = [8, 8], center_mm = [0, 0, 0], toward = [0, 0, -1], \
                  up = [0, 1, 0], width_mm = 2 }";
    let probe = GOOD.lines().find(|line| line.starts_with("sensor")).expect("a sensor");
    let good = GOOD.replace(probe, pixels);
    format!("{good}[[estimator]]\nname = \"snee\"\nsnee = {{}}\n{SWEEP}[[picture]]\n{picture}\n")
}

fn picture(words: &str) -> String {
    errors(&text(&format!("split = {{ {words} }}")))
}

#[test]
fn pictures_name_estimators_and_axes() {
    let message = picture("left = \"mos\", right = \"snee\"");
    holds(&message, "unknown estimator `mos`", "21:18", "did you mean `mis`?");
    let message = picture("left = \"snee\", right = \"snee\"");
    holds(&message, "`snee` is left and right", "21:34", "name two");
    let message = picture("left = \"mis\", right = \"snee\", rows = \"h\"");
    holds(&message, "unknown axis `h`", "21:48", "`g`");
    let message = picture("left = \"mis\", right = \"snee\", rows = \"g\", columns = \"g\"");
    holds(&message, "rows and columns are the same axis", "21:63", "");
    let message = picture("left = \"mis\", right = \"snee\", exposure_stops = nan");
    assert!(message.contains("exposure_stops"), "{message}");
    assert!(
        errors(&text("")).contains("`split`, `running`, `strip` is needed"),
        "{}",
        errors(&text(""))
    );
}

#[test]
fn pictures_need_pixels() {
    let split = "split = { left = \"mis\", right = \"snee\" }";
    let message =
        errors(&format!("{GOOD}[[estimator]]\nname = \"snee\"\nsnee = {{}}\n[[picture]]\n{split}\n"));
    assert!(message.contains("a split picture needs pixels, and the sensor has none"), "{message}");
    let message = errors(&format!("{GOOD}[[picture]]\nstrip = {{ estimator = \"mis\" }}\n"));
    assert!(message.contains("a strip of bands needs pixels, and the sensor has none"), "{message}");
}

#[test]
fn strips_name_an_estimator_and_have_a_band() {
    let strip = |words: &str| errors(&text(&format!("strip = {{ {words} }}")));
    holds(&strip("estimator = \"mos\""), "unknown estimator `mos`", "21:23", "did you mean `mis`?");
    assert!(strip("estimator = \"mis\", bands = 0").contains("bands"));
    let wanted = wanted(&good(&text("strip = { estimator = \"mis\" }")).file.picture);
    let [Wanted::Strip(strip)] = &wanted[..] else { panic!("{wanted:?}") };
    assert_eq!((strip.estimator.as_str(), strip.bands), ("mis", 8));
}

#[test]
fn plots_of_means_name_estimators_and_a_band() {
    let plot = |words: &str| errors(&text(&format!("running = {{ {words} }}")));
    assert!(plot("band = \"infrared\"").contains("unknown band `infrared`"));
    assert!(plot("estimators = [\"mos\"], band = \"R\"").contains("unknown estimator `mos`"));
    assert!(plot("class = \"multiple\"").contains("missing key"));
}

// How a record is shown is no part of what it is.
#[test]
fn pictures_are_no_part_of_the_resolved_experiment() {
    let with = good(&text("split = { left = \"mis\", right = \"snee\", rows = \"g\" }"));
    let without = good(text("").split("[[picture]]").next().expect("a file"));
    assert_eq!(with.resolved(), without.resolved());
    let there = wanted(&with.file.picture);
    let [Wanted::Split(split)] = &there[..] else { panic!("{there:?}") };
    assert_eq!((split.rows.as_deref(), split.left.as_str()), (Some("g"), "mis"));
}
