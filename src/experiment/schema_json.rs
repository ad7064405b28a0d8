//! The complete JSON Schemas of experiment files, estimators and samplers included: what editors
//! complete from, what `scatterproof schema` prints, and what validation walks.

use serde_json::{Map, Value as Json, json};

use super::registry::Registry;
use super::rules::{CELL_KEYS, SAMPLER_KEYS, SCENE_KEYS};
use super::schema::ExperimentFile;
use super::spectrum_csv;

/// The JSON Schema (2020-12) of an experiment file whose estimators and samplers are those of
/// `registry`, as validation walks it.
pub(crate) fn json_schema(registry: &Registry) -> Json {
    let mut schema = schemars::schema_for!(ExperimentFile).to_value();
    schema["title"] = json!("scatterproof experiment");
    spectrum_csv::extend_schema(&mut schema);
    let estimators = registry.estimators.iter().map(|entry| (entry.kind, entry.doc, entry.options()));
    inject("EstimatorEntry", "", estimators.collect(), &mut schema);
    let samplers = registry.samplers.iter().map(|entry| (entry.kind, entry.doc, entry.options()));
    inject("SamplerEntry", "sampler.", samplers.collect(), &mut schema);
    schema
}

/// The same for editors, which keys belong together included: a scene with estimators, or samplers, or
/// both. In a file with a sweep, keys that rows may set can be missing.
pub(crate) fn editor_schema(registry: &Registry) -> Json {
    let mut schema = json_schema(registry);
    leave_null_out(&mut schema);
    let without = |keys: &[&'static str], left_out: &[&str]| -> Vec<&'static str> {
        keys.iter().copied().filter(|key| !left_out.contains(key)).collect()
    };
    // A medium that emits needs no light.
    let scene = without(&SCENE_KEYS, &["light"]);
    let swept = without(&scene, &CELL_KEYS);
    let strict: Map<String, Json> =
        CELL_KEYS.iter().map(|key| (key.to_string(), schema["properties"][key].clone())).collect();
    for key in CELL_KEYS {
        let mut names = Vec::new();
        schema["properties"][key] = relaxed(&schema["properties"][key], &mut names);
        while let Some(name) = names.pop() {
            let relaxed_name = format!("{RELAXED}{name}");
            if schema["$defs"].get(&relaxed_name).is_none() {
                let definition = relaxed(&schema["$defs"][&name], &mut names);
                schema["$defs"][relaxed_name] = definition;
            }
        }
    }
    let together = |parts: [&[&'static str]; 2]| {
        let pairs = parts.into_iter().flat_map(|keys| keys.iter().map(move |key| (*key, json!(keys))));
        Json::Object(pairs.map(|(key, keys)| (key.to_string(), keys)).collect())
    };
    let either = |scene: &[&str]| json!([{ "required": scene }, { "required": SAMPLER_KEYS }]);
    schema["if"] = json!({ "required": ["sweep"] });
    schema["then"] =
        json!({ "anyOf": either(&swept), "dependentRequired": together([&swept, &SAMPLER_KEYS]) });
    schema["else"] = json!({
        "properties": strict,
        "anyOf": either(&scene),
        "dependentRequired": together([&scene, &SAMPLER_KEYS]),
    });
    schema
}

/// TOML has no null: an optional key takes what it takes where it is given, and editors then say what is wrong
/// with that.
fn leave_null_out(schema: &mut Json) {
    let is_null = |form: &Json| form["type"] == "null";
    match schema {
        Json::Object(object) => {
            if let Some(Json::Array(forms)) = object.get_mut("anyOf") {
                forms.retain(|form| !is_null(form));
            }
            let only = match object.get("anyOf") {
                Some(Json::Array(forms)) if forms.len() == 1 => forms[0].as_object().cloned(),
                _ => None,
            };
            if let Some(only) = only {
                object.remove("anyOf");
                for (key, value) in only {
                    object.entry(key).or_insert(value);
                }
            }
            if let Some(Json::Array(types)) = object.get_mut("type") {
                types.retain(|name| name != "null");
                if let [only] = &types[..] {
                    let only = only.clone();
                    object.insert("type".into(), only);
                }
            }
            object.values_mut().for_each(leave_null_out);
        }
        Json::Array(items) => items.iter_mut().for_each(leave_null_out),
        _ => {}
    }
}

/// What the names of definitions begin with in which rows of a sweep may set what is missing.
const RELAXED: &str = "swept.";

/// A schema without required keys, and the names of the definitions that it refers to.
fn relaxed(schema: &Json, names: &mut Vec<String>) -> Json {
    match schema {
        Json::Object(object) => {
            let mut copy = Map::new();
            for (key, value) in object {
                let name = value.as_str().and_then(|target| target.strip_prefix("#/$defs/"));
                match (key.as_str(), name) {
                    ("required", _) if value.is_array() => {}
                    ("$ref", Some(name)) => {
                        names.push(name.into());
                        copy.insert(key.clone(), json!(format!("#/$defs/{RELAXED}{name}")));
                    }
                    ("oneOf", _) => {
                        // A table that may be empty fits several alternatives.
                        let list = value.as_array().into_iter().flatten().map(|one| relaxed(one, names));
                        let list: Vec<Json> = list.filter(|one| *one != json!({})).collect();
                        if !list.is_empty() {
                            copy.insert("anyOf".into(), json!(list));
                        }
                    }
                    _ => {
                        copy.insert(key.clone(), relaxed(value, names));
                    }
                }
            }
            Json::Object(copy)
        }
        Json::Array(items) => items.iter().map(|item| relaxed(item, names)).collect(),
        other => other.clone(),
    }
}

/// Completes the definition `name` of one entry: its name and exactly one registered kind, of which a
/// line of documentation and the schema of the options are given. What the options define is at the
/// root under names that begin with `prefix` and the kind.
fn inject(name: &str, prefix: &str, kinds: Vec<(&'static str, &'static str, Json)>, schema: &mut Json) {
    let mut entry = schema["$defs"][name].clone();
    let required = kinds.iter().map(|(kind, ..)| json!({ "required": [kind] })).collect::<Vec<_>>();
    for (kind, doc, mut options) in kinds {
        options["description"] = json!(doc);
        if let Some(object) = options.as_object_mut() {
            object.remove("$schema");
            object.remove("title");
        }
        lift_definitions(&format!("{prefix}{kind}"), &mut options, schema);
        entry["properties"][kind] = options;
    }
    entry["additionalProperties"] = json!(false);
    if !required.is_empty() {
        entry["oneOf"] = json!(required);
    }
    schema["$defs"][name] = entry;
}

/// Moves the definitions of a kind's options to the root, under names that carry the kind.
fn lift_definitions(kind: &str, options: &mut Json, schema: &mut Json) {
    let Some(Json::Object(definitions)) = options.as_object_mut().and_then(|o| o.remove("$defs")) else {
        return;
    };
    rename_references(kind, options);
    let target: &mut Map<String, Json> = match schema["$defs"].as_object_mut() {
        Some(target) => target,
        None => return,
    };
    for (name, mut definition) in definitions {
        rename_references(kind, &mut definition);
        target.insert(format!("{kind}.{name}"), definition);
    }
}

fn rename_references(kind: &str, schema: &mut Json) {
    match schema {
        Json::Object(object) => {
            for (key, value) in object.iter_mut() {
                let name = value.as_str().and_then(|r| r.strip_prefix("#/$defs/")).map(String::from);
                match name {
                    Some(name) if key == "$ref" => *value = json!(format!("#/$defs/{kind}.{name}")),
                    _ => rename_references(kind, value),
                }
            }
        }
        Json::Array(items) => items.iter_mut().for_each(|item| rename_references(kind, item)),
        _ => {}
    }
}
