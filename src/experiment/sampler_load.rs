//! From a text to a validated experiment on samplers: overrides, the walk, the rules, the types.

use std::path::Path;

use super::document::{self, Node, Value};
use super::load::{apply, refusal, settings, typed};
use super::registry::Registry;
use super::rules::{At, Findings, unique_names};
use super::sampler_file::{SamplerExperiment, SamplerFile};
use super::schema_json::sampler_schema;
use super::validate::Walk;
use super::validate::grammar::Grammar;
use super::{LoadOptions, origins, suggest};
use crate::error::{Error, Result};

/// Keys that only an experiment with a scene has: a file with one of them is judged as such, so that its
/// other mistakes are told in its own terms.
const OF_SCENES: [&str; 6] = ["bands", "object", "sensor", "light", "estimator", "budget"];

/// Whether a text is an experiment on samplers. A text that cannot be parsed is not.
pub fn is_on_samplers(path: &Path, text: &str) -> bool {
    let Ok(root) = document::parse(&path.display().to_string(), text) else { return false };
    let has = |key: &&str| root.get(key).is_some();
    has(&"sampler") && !OF_SCENES.iter().any(has)
}

/// Reads, overrides and validates the experiment in `text`, which stands at `path`.
///
/// # Errors
/// Everything that is wrong with it, at once.
pub fn load_text(
    path: &Path,
    text: &str,
    options: &LoadOptions,
    registry: &Registry,
) -> Result<SamplerExperiment> {
    let grammar = Grammar::new(sampler_schema(registry));
    let mut root = document::parse(&path.display().to_string(), text).map_err(Error::Input)?;
    apply(&mut root, options, &grammar).map_err(Error::Input)?;
    let findings = Findings::default();
    let mut walk = Walk::new(&grammar, false);
    walk.root(&root, &[]);
    walk.into_findings().into_iter().for_each(|finding| findings.add(finding));
    rules(&root, &findings);
    let settings = settings(&root);
    if let Value::Table(entries) = &mut root.value {
        entries.remove("setting");
    }
    match (findings.into_sorted(), typed::<SamplerFile>(&root)) {
        (findings, Some(file)) if findings.is_empty() => {
            let origins = origins::list_of(&root, &super::resolved::json(&file));
            Ok(SamplerExperiment { path: path.to_path_buf(), file, settings, origins })
        }
        (findings, _) => Err(refusal(findings)),
    }
}

/// Names are unique, and claims name samplers that are there, each once.
fn rules(root: &Node, findings: &Findings) {
    let at = At::new(root, findings);
    let Some(entries) = root.get("sampler") else { return };
    unique_names(at.to("sampler"), entries, "samplers");
    let known: Vec<&str> =
        entries.items().iter().filter_map(|entry| entry.get("name")?.as_str()).collect();
    for (i, claim) in root.get("claim").map(Node::items).unwrap_or_default().iter().enumerate() {
        let Some(names) = claim.at(&["sampler", "samplers"]) else { continue };
        let at = at.to("claim").item(i).to("sampler").to("samplers");
        let mut seen = Vec::new();
        for (k, name) in names.items().iter().enumerate() {
            let Some(name) = name.as_str() else { continue };
            if !known.contains(&name) {
                let help = suggest::help(name, &known, "samplers");
                at.item(k).report_help(format!("unknown sampler `{name}`"), help);
            } else if seen.contains(&name) {
                at.item(k).report(format!("`{name}` stands twice"));
            }
            seen.push(name);
        }
    }
}
