//! The complete JSON Schemas of experiment files, estimators and samplers included: what editors complete
//! from, what `scatterproof schema` prints, and what validation walks.

use serde_json::{Map, Value as Json, json};

use super::registry::Registry;
use super::sampler_file::SamplerFile;
use super::schema::ExperimentFile;

/// The JSON Schema (2020-12) of an experiment file whose estimators are those of `registry`.
pub fn json_schema(registry: &Registry) -> Json {
    let mut schema = schemars::schema_for!(ExperimentFile).to_value();
    schema["title"] = json!("scatterproof experiment");
    let kinds = registry.estimators.iter().map(|entry| (entry.kind, entry.doc, entry.options()));
    inject("EstimatorEntry", kinds.collect(), &mut schema);
    schema
}

/// The JSON Schema of an experiment file on samplers, whose kinds are those of `registry`.
pub fn sampler_schema(registry: &Registry) -> Json {
    let mut schema = schemars::schema_for!(SamplerFile).to_value();
    schema["title"] = json!("scatterproof experiment on samplers");
    let kinds = registry.samplers.iter();
    let kinds = kinds.map(|entry| (entry.kind, entry.doc, entry.options()));
    inject("SamplerEntry", kinds.collect(), &mut schema);
    schema
}

/// The JSON Schema of any experiment file: one with a `sampler` is an experiment on samplers.
pub fn any_schema(registry: &Registry) -> Json {
    let (mut scenes, mut samplers) = (json_schema(registry), sampler_schema(registry));
    let mut definitions = Map::new();
    for (schema, prefix) in [(&mut scenes, ""), (&mut samplers, "sampler")] {
        if !prefix.is_empty() {
            rename_references(prefix, schema);
        }
        if let Some(object) = schema.as_object_mut() {
            object.remove("$schema");
            let Some(Json::Object(own)) = object.remove("$defs") else { continue };
            let name = |name: String| if prefix.is_empty() { name } else { format!("{prefix}.{name}") };
            definitions.extend(own.into_iter().map(|(key, schema)| (name(key), schema)));
        }
    }
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "scatterproof experiment",
        "if": { "required": ["sampler"] },
        "then": samplers,
        "else": scenes,
        "$defs": definitions,
    })
}

/// Completes the definition `name` of one entry: its name and exactly one registered kind, of which a
/// line of documentation and the schema of the options are given.
fn inject(name: &str, kinds: Vec<(&'static str, &'static str, Json)>, schema: &mut Json) {
    let mut entry = schema["$defs"][name].clone();
    let required = kinds.iter().map(|(kind, ..)| json!({ "required": [kind] })).collect::<Vec<_>>();
    for (kind, doc, mut options) in kinds {
        options["description"] = json!(doc);
        if let Some(object) = options.as_object_mut() {
            object.remove("$schema");
            object.remove("title");
        }
        lift_definitions(kind, &mut options, schema);
        entry["properties"][kind] = options;
    }
    entry["additionalProperties"] = json!(false);
    if !required.is_empty() {
        entry["oneOf"] = json!(required);
    }
    schema["$defs"][name] = entry;
}

/// Moves the definitions of an estimator's options to the root, under names that carry its kind.
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
