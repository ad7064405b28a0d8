//! The complete JSON Schemas of experiment files, estimators and samplers included: what editors
//! complete from, what `scatterproof schema` prints, and what validation walks.

use serde_json::{Map, Value as Json, json};

use super::registry::Registry;
use super::rules::{SAMPLER_KEYS, SCENE_KEYS};
use super::schema::ExperimentFile;

/// The JSON Schema (2020-12) of an experiment file whose estimators and samplers are those of
/// `registry`, as validation walks it.
pub(crate) fn json_schema(registry: &Registry) -> Json {
    let mut schema = schemars::schema_for!(ExperimentFile).to_value();
    schema["title"] = json!("scatterproof experiment");
    let estimators = registry.estimators.iter().map(|entry| (entry.kind, entry.doc, entry.options()));
    inject("EstimatorEntry", "", estimators.collect(), &mut schema);
    let samplers = registry.samplers.iter().map(|entry| (entry.kind, entry.doc, entry.options()));
    inject("SamplerEntry", "sampler.", samplers.collect(), &mut schema);
    schema
}

/// The same for editors, which keys belong together included: a scene with estimators, or samplers, or
/// both.
pub(crate) fn editor_schema(registry: &Registry) -> Json {
    let mut schema = json_schema(registry);
    let parts = [&SCENE_KEYS[..], &SAMPLER_KEYS];
    schema["anyOf"] = json!(parts.map(|keys| json!({ "required": keys })));
    let together = parts.into_iter().flat_map(|keys| keys.iter().map(move |key| (*key, json!(keys))));
    schema["dependentRequired"] = Json::Object(together.map(|(k, v)| (k.to_string(), v)).collect());
    schema
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
