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
    holds(&message, "two estimators are named `mis`", "15:8", "");
}

#[test]
fn a_claim_is_of_one_kind() {
    let rule = "exactly one of `equals`, `agree`, `differs`, `reproduces`, `faster`, `not_slower`, `sampler` is \
                needed, found none";
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
    accepted(&format!("not_slower = {{ {pair} }}"));
}

#[test]
fn cpu_time_is_compared_pass_for_pass() {
    let snee = "[[estimator]]\nname = \"snee\"\nsnee = {}\n";
    let claim = "[[claim]]\nnot_slower = { candidate = \"snee\", baseline = \"mis\", cost = \"cpu\" }\n";
    let text = format!("{GOOD}{snee}{claim}");
    good(&text);
    let message = errors(&text.replace("budget.passes = 16", "budget.cpu_seconds = 1"));
    assert!(message.contains("CPU time is compared pass for pass"), "{message}");
    let message = errors(&text.replace("\"snee\"", "\"snee (control)\""));
    assert!(message.contains("`snee (control)` is the name of a control"), "{message}");
}
