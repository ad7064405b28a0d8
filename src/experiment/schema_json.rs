//! The complete JSON Schema of an experiment file, estimators included: what editors complete
//! from, what `scatterproof schema` prints, and what validation walks.

use serde_json::{Map, Value as Json, json};

use super::registry::Registry;
use super::schema::ExperimentFile;

/// The JSON Schema (2020-12) of an experiment file whose estimators are those of `registry`.
pub fn json_schema(registry: &Registry) -> Json {
    let mut schema = schemars::schema_for!(ExperimentFile).to_value();
    schema["title"] = json!("scatterproof experiment");
    let entry = inject(registry, &mut schema);
    schema["$defs"]["EstimatorEntry"] = entry;
    schema
}

/// The schema of one `[[estimator]]`: its name and exactly one registered kind.
fn inject(registry: &Registry, schema: &mut Json) -> Json {
    let mut entry = schema["$defs"]["EstimatorEntry"].clone();
    for kind in &registry.entries {
        let mut options = kind.options();
        options["description"] = json!(kind.doc);
        if let Some(object) = options.as_object_mut() {
            object.remove("$schema");
            object.remove("title");
        }
        lift_definitions(kind.kind, &mut options, schema);
        entry["properties"][kind.kind] = options;
    }
    entry["additionalProperties"] = json!(false);
    if registry.entries.is_empty() {
        return entry;
    }
    entry["oneOf"] = registry.kinds().iter().map(|kind| json!({ "required": [kind] })).collect();
    entry
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
