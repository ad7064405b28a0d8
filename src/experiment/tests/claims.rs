//! Rules of estimators, pairing and claims.

use super::*;

const SWEEP: &str = r#"[[sweep]]
name = "depth"
keys = ["object.shape.sphere.radius_mm"]
rows = [{ label = "thin", values = [1], columns = { r = 0.5, e = 0.1 } }, { label = "thick", values = [2], columns = { r = "x", e = -1 } }]
"#;

/// The errors of the good experiment with the sweep and one claim, which begins at line 18.
fn claim(text: &str) -> String {
    refused_with(&format!("{SWEEP}[[claim]]\n{text}\n"))
}

fn accepted(text: &str) {
    good(&format!("{GOOD}[[estimator]]\nname = \"snee\"\nsnee = {{}}\n{SWEEP}[[claim]]\n{text}\n"));
}

#[test]
fn estimators_have_unique_names() {
    let message = refused_with("[[estimator]]\nname = \"mis\"\nsnee = {}\n");
    holds(&message, "two estimators are named `mis`", "15:8", "a name of its own");
}

#[test]
fn only_claims_of_efficiency_expect_a_failure() {
    let message = claim(
        "agree = { estimators = [\"mis\"], across = \"radius_mm\", detect = 1 }\nexpect = \"fails\"",
    );
    assert!(
        message.contains("`fails` is about efficiency") && message.contains("\"differs\""),
        "{message}"
    );
}

#[test]
fn a_claim_is_of_one_kind() {
    let rule = "exactly one of `equals`, `agree`, `differs`, `mean_path_length`, `reproduces`, `faster`, `not_slower`, \
                `sampler` is needed, found none";
    holds(&claim("name = \"x\""), rule, "18:1", "");
    let equals = "equals = { value = 1, column = \"r\", source = \"\" }";
    assert!(
        claim(equals).contains("exactly one of `value`, `column` is needed, found `value`, `column`")
    );
}

#[test]
fn claims_name_known_estimators() {
    let message = claim("agree = { estimators = [\"mis\", \"mos\"], detect = 0.1 }");
    holds(&message, "unknown estimator `mos`", "19:32", "did you mean `mis`?");
    let message = claim("equals = { estimator = \"x\", value = 1, source = \"\" }");
    holds(&message, "unknown estimator `x`", "19:24", "known estimators: `mis`");
    let message = claim("agree = { estimators = [\"mis\"], detect = 0.1 }");
    holds(&message, "one estimator agrees with itself", "19:24", "`across`");
    let message = claim("agree = { estimators = [\"mis\", \"mis\"], detect = 0.1 }");
    holds(&message, "`mis` occurs twice", "19:32", "");
    accepted("agree = { estimators = [\"mis\", \"snee\"], detect = 0.1 }");
}

#[test]
fn claims_name_known_axes_and_labels() {
    let message = claim("agree = { estimators = [\"mis\"], across = \"dpth\", detect = 0.1 }");
    holds(&message, "unknown axis `dpth`", "19:42", "did you mean `depth`?");
    let message = claim("equals = { value = 1, source = \"\", where = { width = \"a\" } }");
    holds(&message, "unknown axis `width`", "19:46", "known axes: `depth`");
    let message = claim("equals = { value = 1, source = \"\", where = { depth = \"thn\" } }");
    holds(&message, "unknown label `thn` of axis `depth`", "19:54", "did you mean `thin`?");
    let across = "agree = { estimators = [\"mis\"], across = \"depth\", detect = 0.1, where = { depth = \"thin\" } }";
    holds(&claim(across), "`depth` is compared across, `where` cannot fix it", "19:75", "");
    accepted("agree = { estimators = [\"mis\"], across = \"depth\", detect = 0.1 }");
    accepted("equals = { value = 1, source = \"\", where = { depth = \"thin\" } }");
}

#[test]
fn columns_of_expected_values_are_numbers() {
    let message = claim("equals = { column = \"q\", source = \"\" }");
    holds(&message, "no row of the sweep has a column `q`", "19:21", "known columns: `e`, `r`");
    let message = claim("equals = { column = \"r\", source = \"\" }");
    holds(&message, "column `r` must be a number, is `x`", "17:124", "");
    let message = claim("equals = { column = \"e\", error_column = \"e\", source = \"\" }");
    holds(&message, "a standard error must be at least 0, is -1", "17:133", "");
    let message = claim("equals = { value = 1, error_column = \"e\", source = \"\" }");
    assert!(message.contains("`error_column` belongs to `column`, and there is none"), "{message}");
    let message = claim("equals = { column = \"r\", error = 0.1, source = \"\" }");
    assert!(message.contains("`error` belongs to `value`, and there is none"), "{message}");
    accepted("equals = { column = \"e\", source = \"\" }");
}

#[test]
fn pairing_is_over_known_keys() {
    let message = refused_with("[pair]\nover = [\"object.shpe\"]\n");
    holds(&message, "unknown key `object.shpe`", "15:9", "did you mean `shape`?");
    let message = refused_with("[pair]\nover = [\"budget.passes\"]\n");
    holds(
        &message,
        "unknown key `budget.passes`",
        "15:9",
        "keys begin with `object`, `sensor` or `light`",
    );
    for key in [
        "object.shape",
        "object.boundary.matched",
        "light.0.directional.toward",
        "object.shape.box.size_mm.1",
    ] {
        good(&format!("{GOOD}[pair]\nover = [\"{key}\"]\n"));
    }
}

/// The good experiment with a second estimator and a claim of efficiency at line 18 with `words` in it.
fn duel(words: &str) -> String {
    let snee = "[[estimator]]\nname = \"snee\"\nsnee = {}\n";
    errors(&format!("{GOOD}{snee}{SWEEP}[[claim]]\nfaster = {{ {words} }}\n"))
}

#[test]
fn claims_of_efficiency_name_two_estimators() {
    let pair = "candidate = \"snee\", baseline = \"mis\"";
    let message = duel("candidate = \"sne\", baseline = \"mis\"");
    holds(&message, "unknown estimator `sne`", "22:24", "did you mean `snee`?");
    let message = duel("candidate = \"mis\", baseline = \"mis\"");
    holds(&message, "`mis` is candidate and baseline", "22:24", "an estimator is as fast as itself");
    let message = duel(&format!("{pair}, ratio = 0"));
    assert!(message.contains("must be greater than 0"), "{message}");
    let message = duel(&format!("{pair}, where = {{ depth = \"thn\" }}"));
    assert!(message.contains("unknown label `thn` of axis `depth`"), "{message}");
    let message = duel(&format!("{pair} }}\nexpect = \"differs\"\n#"));
    assert!(message.contains("this claim is about efficiency"), "{message}");
    accepted(&format!("faster = {{ {pair}, ratio = 2, cost = \"cpu\" }}\nexpect = \"fails\""));
    accepted(&format!("not_slower = {{ {pair}, cost = \"cpu\" }}"));
    // Counted work between `snee` and `path` may be off by more than a tenth.
    let (of, by) = ("[[estimator]]\nname = \"snee\"\nsnee = {}\n", "[[claim]]\nnot_slower = ");
    let message = errors(&format!("{GOOD}{of}{by}{{ {pair} }}\n"));
    assert!(message.contains("may be off by") && message.contains("the margin of 1.10"), "{message}");
    good(&format!("{GOOD}{of}{by}{{ {pair}, margin = 10 }}\n"));
}

#[test]
fn a_control_that_expects_invalidity_names_the_reason() {
    let equals = "equals = { value = 1, source = \"x\" }";
    good(&format!("{GOOD}{SWEEP}[[claim]]\nexpect = \"invalid\"\nbecause = \"heavy_tail\"\n{equals}\n"));
    let message = claim(&format!("expect = \"invalid\"\n{equals}"));
    let rule = "`expect = \"invalid\"` without the reason: lost rays would satisfy it as well";
    holds(&message, rule, "18:1", "add `because = \"heavy_tail\"`");
    let message = claim(&format!("expect = \"invalid\"\nbecause = \"heavy\"\n{equals}"));
    assert!(message.contains("heavy_tail"), "{message}");
    for expect in ["", "expect = \"differs\"\n"] {
        let message = claim(&format!("because = \"heavy_tail\"\n{expect}{equals}"));
        let rule = "a reason for an invalid test, and none is expected";
        holds(&message, rule, "19:11", "add `expect = \"invalid\"`");
    }
    let message = duel("candidate = \"snee\", baseline = \"mis\" }\nexpect = \"invalid\"\n#");
    assert!(message.contains("`invalid` is about a test of means"), "{message}");
}

#[test]
fn comparing_cpu_time_adds_a_control() {
    let snee = "[[estimator]]\nname = \"snee\"\nsnee = {}\n";
    let claim = "[[claim]]\nnot_slower = { candidate = \"snee\", baseline = \"mis\", cost = \"cpu\" }\n";
    let text = format!("{GOOD}{snee}{claim}");
    good(&text);
    good(&text.replace("budget.passes = 16", "budget.cpu_seconds = 1"));
    let message = errors(&text.replace("\"snee\"", "\"snee (control)\""));
    assert!(message.contains("`snee (control)` is the name of a control"), "{message}");
}

/// A good claim on path lengths; every test replaces a part of it.
const LENGTHS: &str = r#"name = "lengths"
bands = { explicit = [{ name = "a" }, { name = "b" }] }
object.shape.icosphere = { radius_mm = 1.0, subdivisions = 1, normals = "flat" }
object.boundary.smooth = { eta = 1.3 }
object.medium.coefficients = { sigma_t_per_mm = 10, albedo = 1, g = 0 }
sensor.path_length = {}
budget.passes = 16
[[light]]
environment = { radiance = 1 }
[[estimator]]
name = "mis"
path = {}
[[sweep]]
key = "object.medium.coefficients.g"
values = [0.0, 0.5]
[[claim]]
mean_path_length = { estimators = ["mis"], detect = 0.1, where = { g = "0.5" } }
"#;

/// A change that makes 4 eta^2 V / S wrong, and the reason with its place.
#[test]
fn mean_path_lengths_need_a_body_without_losses() {
    good(LENGTHS);
    let rough = "rough = { distribution = \"ggx\", alpha = 0.2, eta = 1.3 }";
    let cases = [
        (
            "smooth = { eta = 1.3 }",
            rough,
            "a rough one loses the light that its facets send into each other",
        ),
        (
            "\"flat\"",
            "\"interpolated\"",
            "interpolated normals lose the light that they send to the wrong",
        ),
        ("albedo = 1,", "albedo = [1, 0.99],", "holds without absorption, and band `b` absorbs"),
        ("sigma_t_per_mm = 10", "sigma_t_per_mm = [1, 0]", "in band `b` nothing scatters it into those"),
        ("radiance = 1 }", "radiance = 1, hemisphere = [0, 0, 1] }", "and another light shines"),
        ("radiance = 1 }", "radiance = [1, 0] }", "and another light shines"),
        (
            "environment = { radiance = 1 }",
            "environment = { map = \"sky.exr\" }",
            "and another light shines",
        ),
        (
            "[[estimator]]",
            "[[light]]\ndirectional = { toward = [1, 0, 0], irradiance = 1 }\n[[estimator]]",
            "another",
        ),
        (
            "path_length = {}",
            "flux = { bins = 1, axis = [0, 0, 1] }",
            "the claim needs the sensor `path_length`",
        ),
    ];
    for (old, new, reason) in cases {
        assert!(LENGTHS.contains(old), "{old}");
        let text = LENGTHS.replacen(old, new, 1);
        let message = errors(&text);
        let line =
            text.lines().position(|line| line.starts_with("mean_path_length")).map(|line| line + 1);
        let place = format!("x.toml:{}:", line.expect("the claim"));
        assert!(message.contains(reason) && message.contains(&place), "{message}");
        assert!(!message.contains("2 errors"), "{message}");
    }
    // Bodies without end have neither volume nor surface.
    for shape in ["half_space = {}", "slab = { thickness_mm = 1 }"] {
        let body = "icosphere = { radius_mm = 1.0, subdivisions = 1, normals = \"flat\" }";
        let message = errors(&LENGTHS.replace(body, shape));
        assert!(message.contains("path lengths are measured in bodies of finite size"), "{message}");
    }
    // Interpolated normals matter to a boundary that refracts; other cells are not the claim's.
    good(
        &LENGTHS
            .replace("\"flat\"", "\"interpolated\"")
            .replace("smooth = { eta = 1.3 }", "matched = {}"),
    );
    let albedo = LENGTHS
        .replace("coefficients.g\"", "coefficients.albedo\"")
        .replace("g = \"0.5\"", "albedo = \"LABEL\"");
    good(&albedo.replace("[0.0, 0.5]", "[0.5, 1.0]").replace("LABEL", "1.0"));
    let message = errors(&albedo.replace("[0.0, 0.5]", "[0.5, 1.0]").replace("LABEL", "0.5"));
    assert!(message.contains("band `a` absorbs"), "{message}");
    holds(
        &errors(&LENGTHS.replace("[\"mis\"]", "[\"mos\"]")),
        "unknown estimator `mos`",
        "17:36",
        "`mis`",
    );
}
