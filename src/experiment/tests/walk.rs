//! What the schema refuses.

use super::*;
use crate::experiment::schema_json::json_schema;
use crate::experiment::validate::SchemaWalk;
use crate::experiment::validate::grammar::Grammar;

/// The keywords of JSON Schema that the walk understands, and those that carry no rule for it: `pattern`
/// is of names, of which the rules say more than a pattern can.
const KEYWORDS: [&str; 24] = [
    "$defs",
    "$ref",
    "$schema",
    "additionalProperties",
    "anyOf",
    "const",
    "default",
    "description",
    "enum",
    "exclusiveMaximum",
    "exclusiveMinimum",
    "format",
    "items",
    "maxItems",
    "maximum",
    "minItems",
    "minLength",
    "minimum",
    "oneOf",
    "pattern",
    "properties",
    "required",
    "title",
    "type",
];

/// The keywords of a schema that the walk would silently ignore: none in a schema that is enforced.
fn unsupported_keywords(schema: &serde_json::Value) -> Vec<String> {
    let Some(object) = schema.as_object() else { return Vec::new() };
    let mut unsupported: Vec<String> =
        object.keys().filter(|key| !KEYWORDS.contains(&key.as_str())).cloned().collect();
    for (key, value) in object {
        let inner: Vec<&serde_json::Value> = match key.as_str() {
            "properties" | "$defs" => value.as_object().into_iter().flat_map(|o| o.values()).collect(),
            "anyOf" | "oneOf" => value.as_array().into_iter().flatten().collect(),
            "items" | "additionalProperties" => vec![value],
            _ => Vec::new(),
        };
        unsupported.extend(inner.into_iter().flat_map(unsupported_keywords));
    }
    unsupported
}

#[test]
fn unknown_keys_are_named_with_what_was_meant() {
    holds(&refused("albedo =", "albdo ="), "unknown key `albdo`", "6:53", "did you mean `albedo`?");
    let message = refused("radius_mm = 1.0", "raduis_mm = 1.0");
    holds(&message, "unknown key `raduis_mm`", "4:25", "did you mean `radius_mm`?");
    let message = refused_with("[display]\nzzz = 1\n");
    holds(&message, "unknown key `zzz`", "15:1", "known keys: `exposure_stops`");
    holds(&refused("seed = 1", "seed = 1\nsed = 2"), "unknown key `sed`", "3:1", "did you mean `seed`?");
}

#[test]
fn wrong_types_are_named() {
    let message = refused("radius_mm = 1.0", "radius_mm = \"1\"");
    holds(&message, "expected a number, found a string", "4:37", "write 1, without quotes");
    holds(&refused("seed = 1", "seed = 1.5"), "expected an integer, found 1.5", "2:8", "");
    let message = refused("eta = 1.3", "eta = true");
    holds(&message, "expected a number, an array or a table, found true", "5:34", "");
    holds(
        &refused("toward = [0, 0, -1]", "toward = 3"),
        "expected an array or a table, found 3",
        "7:49",
        "",
    );
    holds(&refused("{ rgb = {} }", "\"rgb\""), "expected a table, found a string", "3:9", "");
    holds(&refused("seed = 1", "seed = 2020-01-01"), "expected an integer, found a date", "2:8", "");
}

#[test]
fn missing_keys_are_named_at_their_table() {
    let message = refused("radius_mm = 1.0", "");
    holds(&message, "missing key `object.shape.sphere.radius_mm`", "4:23", "`radius_mm`: Radius, mm.");
    holds(&refused("name = \"good\"\n", ""), "missing key `name`", "1:1", "Name of the experiment");
    holds(&refused("name = \"mis\"\n", ""), "missing key `estimator.0.name`", "11:1", "");
    let message = refused("object.boundary.smooth = { eta = 1.3 }\n", "");
    holds(&message, "missing key `object.boundary`", "4:1", "");
}

#[test]
fn unknown_kinds_are_named_with_what_was_meant() {
    let message = refused("sphere =", "spere =");
    holds(&message, "unknown kind `spere`", "4:14", "did you mean `sphere`?");
    let rough = "rough = { distribution = \"gxx\", alpha = 0.1, eta = 1.3 }";
    let message = refused("smooth = { eta = 1.3 }", rough);
    holds(&message, "unknown kind `gxx`", "5:42", "did you mean `ggx`?");
    let message = refused("budget.passes = 16", "budget = {}");
    let rule = "exactly one of `passes`, `cpu_seconds`, `relative_error` is needed, found none";
    holds(&message, rule, "8:10", "");
    let message = refused("budget.passes = 16", "budget = { passes = 16, cpu_seconds = 1 }");
    holds(&message, "only one kind may be given, found `cpu_seconds`, `passes`", "8:10", "");
}

#[test]
fn shares_of_the_budget_name_what_is_there() {
    let share = |text: &str| refused_with(&format!("[[budget_share]]\n{text}\n"));
    let message = share("share = 0.5\nestimators = [\"pth\"]");
    assert!(message.contains("unknown estimator `pth`"), "{message}");
    let message = share("share = 0.5\nwhere = { light = \"sky\" }");
    assert!(message.contains("unknown axis `light`"), "{message}");
    assert!(share("share = 0").contains("must be greater than 0, is 0"));
    assert!(share("share = 1001").contains("must be at most 1000, is 1001"));
    let error = "budget.relative_error = { at_most = 0.1 }";
    let message =
        errors(&format!("{}[[budget_share]]\nshare = 0.5\n", GOOD.replace("budget.passes = 16", error)));
    assert!(message.contains("an error cannot be shared out"), "{message}");
}

#[test]
fn numbers_are_finite_and_in_range() {
    for text in ["nan", "inf", "-inf"] {
        let message = refused("radius_mm = 1.0", &format!("radius_mm = {text}"));
        holds(&message, "must be a finite number", "4:37", "");
    }
    let message = refused("radius_mm = 1.0", "radius_mm = -3");
    holds(&message, "must be greater than 0, is -3", "4:37", "");
    let message = refused("radius_mm = 1.0", "radius_mm = 0");
    holds(&message, "must be greater than 0, is 0", "4:37", "");
    let message = refused("path = {}", "path = { max_bounces = 5000000000 }");
    holds(&message, "must be at most 4294967295, is 5000000000", "13:24", "");
    holds(&refused("passes = 16", "passes = 1"), "must be at least 2, is 1", "8:17", "");
    let torus =
        "torus = { major_radius_mm = 2, minor_radius_mm = 1, segments = [2, 8], normals = \"flat\" }";
    let message = refused("sphere = { radius_mm = 1.0 }", torus);
    holds(&message, "must be at least 3, is 2", "4:78", "");
    let direction = "{ cos_z = 1.5, azimuth_deg = 0 }";
    let message = refused("toward = [0, 0, -1]", &format!("toward = {direction}"));
    holds(&message, "must be at most 1, is 1.5", "7:59", "");
    let fov = "sensor.perspective = { resolution = [1, 1], position_mm = [0, 0, 3], look_at_mm = [0, 0, 0], \
               up = [0, 1, 0], fov_deg = 180 }";
    let message = refused("sensor.probe = { point_mm = [0, 0, 3], toward = [0, 0, -1] }", fov);
    assert!(message.contains("must be less than 180, is 180"), "{message}");
}

#[test]
fn arrays_and_texts_have_their_form() {
    let message = refused("point_mm = [0, 0, 3]", "point_mm = [0, 0]");
    holds(&message, "`point_mm` must have exactly 3 entries, has 2", "7:29", "");
    let none = GOOD.replace("[[light]]\ndirectional = { toward = [1, 1, 1], irradiance = 1.0 }\n", "");
    let message = errors(&none.replace("seed = 1", "seed = 1\nlight = []"));
    holds(&message, "`light` is empty, it must have at least 1 entry", "3:9", "");
    holds(&refused("\"good\"", "\"a b\""), "`a b` cannot name a folder", "1:8", "letters, digits");
    holds(&refused("\"mis\"", "\"\""), "must not be empty", "12:8", "");
}

#[test]
fn exactly_one_kind_of_light_and_estimator() {
    let light = "directional = { toward = [1, 1, 1], irradiance = 1.0 }";
    let message = refused(light, "name = \"sun\"");
    let rule = "exactly one of `directional`, `solid_angle`, `environment` is needed, found none";
    holds(&message, rule, "9:1", "");
    let message = refused(light, &format!("{light}\nenvironment = {{ radiance = 1 }}"));
    let rule = "exactly one of `directional`, `solid_angle`, `environment` is needed, \
                found `directional`, `environment`";
    holds(&message, rule, "11:1", "");
    let message = refused(light, "environment = { radiance = 1, map = \"a.exr\" }");
    let rule = "exactly one of `radiance`, `map` is needed, found `radiance`, `map`";
    holds(&message, rule, "10:31", "");
    let message = refused("path = {}", "");
    holds(&message, "exactly one of `path`, `snee` is needed, found none", "11:1", "");
    holds(&refused("path = {}", "pth = {}"), "unknown key `pth`", "13:1", "did you mean `path`?");
}

#[test]
fn options_of_estimators_follow_their_own_schema() {
    let message = refused("path = {}", "path = { max_bounce = 3 }");
    holds(&message, "unknown key `max_bounce`", "13:10", "did you mean `max_bounces`?");
    let message = refused("path = {}", "path = { strategy = \"al\" }");
    holds(&message, "unknown kind `al`", "13:21", "did you mean `all`?");
    good(&GOOD.replace("path = {}", "path = { max_bounces = 3, strategy = \"none\" }"));
}

#[test]
fn several_violations_come_out_together() {
    let text = GOOD
        .replace("albedo =", "albdo =")
        .replace("eta = 1.3", "eta = [1.3, 0]")
        .replace("radius_mm = 1.0", "radius_mm = -1")
        .replace("toward = [1, 1, 1]", "toward = [0, 0, 0]")
        .replace("seed = 1", "seed = \"one\"");
    let message = errors(&text);
    for part in [
        "expected an integer, found a string",
        "must be greater than 0, is -1",
        "there are 3 bands, the list has 2 entries",
        "must be greater than 0, is 0",
        "unknown key `albdo`",
        "a direction must not be the zero vector",
        "6 errors",
    ] {
        assert!(message.contains(part), "no `{part}` in:\n{message}");
    }
    let places: Vec<usize> = [":2:", ":4:", ":5:", ":6:", ":10:"]
        .iter()
        .map(|place| message.find(&format!("x.toml{place}")).expect("every line is named"))
        .collect();
    assert!(places.is_sorted(), "{message}");
}

#[test]
fn syntax_errors_come_out_together() {
    let message = errors("a = \nb = [1,,2]\n");
    assert!(message.contains("x.toml:1:") && message.contains("x.toml:2:"), "{message}");
}

#[test]
fn the_walk_enforces_every_keyword_of_the_schema() {
    for registry in [registry(), crate::experiment::Registry::builtin()] {
        assert_eq!(unsupported_keywords(&json_schema(&registry)), Vec::<String>::new());
    }
    let planted = serde_json::json!({ "properties": { "a": { "type": "number", "multipleOf": 2 } } });
    assert_eq!(unsupported_keywords(&planted), ["multipleOf"]);
}

#[test]
fn the_schema_holds_the_registered_kinds() {
    let schema = json_schema(&registry());
    assert_eq!(schema["$schema"], "https://json-schema.org/draft/2020-12/schema");
    let entry = &schema["$defs"]["EstimatorEntry"];
    assert_eq!(entry["properties"]["path"]["description"], "Path tracing.");
    assert_eq!(entry["additionalProperties"], false);
    let strategy = &entry["properties"]["snee"]["properties"]["strategy"]["anyOf"][0]["$ref"];
    assert_eq!(strategy, "#/$defs/snee.StubStrategy");
    assert!(schema["$defs"]["snee.StubStrategy"].is_object());

    let grammar = Grammar::new(schema);
    let findings = |text: &str| {
        let root = crate::experiment::document::parse("x.toml", text).expect("it is TOML");
        let mut walk = SchemaWalk::new(&grammar, false);
        walk.root(&root, &[], &[]);
        walk.into_findings()
    };
    assert_eq!(findings(GOOD), []);
    assert_eq!(findings(&GOOD.replace("path = {}", "path = {}\nsnee = {}")).len(), 1);
}
