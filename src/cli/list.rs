//! `scatterproof list`: names what an experiment file may use.

use std::io::Write;

use clap::ValueEnum;

use super::output::unwritable;
use crate::error::Result;
use crate::experiment::Registry;
use crate::experiment::registry::option_docs;
use crate::experiment::schema_json::json_schema;
use crate::experiment::validate::grammar::{Grammar, SchemaForm, doc, keys};
use crate::optics::{dispersion, materials};

/// List what an experiment file may use: estimators, materials, shapes and more.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// The topic; default: all topics.
    pub topic: Option<Topic>,
}

/// Topics that can be listed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Topic {
    /// Kinds of `[[estimator]]` and their options.
    Estimators,
    /// Kinds of `[[sampler]]` and their options, in experiments on samplers.
    Samplers,
    /// Measured media, for `medium.preset`.
    Materials,
    /// Glasses, for `eta = { material = NAME }`.
    Glasses,
    /// Kinds of `bands`.
    Bands,
    /// Kinds of `object.shape`.
    Shapes,
    /// Kinds of `object.boundary`.
    Boundaries,
    /// Kinds of `object.medium`.
    Media,
    /// Kinds of `sensor`.
    Sensors,
    /// Kinds of `[[light]]`.
    Lights,
    /// Kinds of `budget`.
    Budgets,
    /// Kinds of `[[claim]]`.
    Claims,
}

/// Prints the topic, or all of them under headings.
///
/// # Errors
/// The output cannot be written.
pub(super) fn run(args: &Args, registry: &Registry, out: &mut dyn Write) -> Result<()> {
    let text = match args.topic {
        Some(topic) => lines(topic, registry),
        None => {
            let sections = Topic::value_variants().iter().map(|topic| {
                let heading = topic.to_possible_value().map(|v| v.get_name().to_string());
                format!("{}\n{}", heading.unwrap_or_default(), indented(&lines(*topic, registry)))
            });
            sections.collect::<Vec<_>>().join("\n")
        }
    };
    out.write_all(text.as_bytes()).map_err(unwritable)
}

fn lines(topic: Topic, registry: &Registry) -> String {
    let schema = |path: &[&str]| table(&schema_names(registry, path));
    // The kinds of an entry, without its other keys.
    let kinds = |path: &[&str]| {
        let mut names = schema_names(registry, path);
        names.retain(|(name, _)| !["name", "expect"].contains(&name.as_str()));
        table(&names)
    };
    match topic {
        Topic::Estimators => estimators(registry),
        Topic::Samplers => samplers(registry),
        Topic::Materials => table(&materials::MATERIALS.map(|m| (m.name.to_string(), numbers(&m)))),
        Topic::Glasses => {
            table(&dispersion::GLASSES.map(|g| (g.name.to_string(), g.source.to_string())))
        }
        Topic::Bands => schema(&["bands"]),
        Topic::Shapes => schema(&["object", "shape"]),
        Topic::Boundaries => schema(&["object", "boundary"]),
        Topic::Media => schema(&["object", "medium"]),
        Topic::Sensors => schema(&["sensor"]),
        Topic::Lights => kinds(&["light", "0"]),
        Topic::Budgets => schema(&["budget"]),
        Topic::Claims => {
            let of_samplers =
                "the claim of an experiment on samplers: samplers draw from their densities";
            kinds(&["claim", "0"]) + &table(&[("sampler".into(), of_samplers.into())])
        }
    }
}

fn estimators(registry: &Registry) -> String {
    let entries = registry.estimators.iter().map(|known| {
        let options = indented(&table(&option_docs(&known.options())));
        format!("{}  {}\n{options}  serves: {}\n", known.kind, known.doc, known.serves)
    });
    entries.collect()
}

fn samplers(registry: &Registry) -> String {
    let entries = registry.samplers.iter().map(|known| {
        format!("{}  {}\n{}", known.kind, known.doc, indented(&table(&option_docs(&known.options()))))
    });
    entries.collect()
}

fn numbers(material: &materials::MeasuredMaterial) -> String {
    format!(
        "reduced sigma_s {:?}, sigma_a {:?} per mm, eta {}; {}",
        material.reduced_sigma_s,
        material.sigma_a,
        material.eta,
        materials::SOURCE
    )
}

/// The names that may occur at a path, with the first line of their documentation.
fn schema_names(registry: &Registry, path: &[&str]) -> Vec<(String, String)> {
    let grammar = Grammar::new(json_schema(registry));
    let Some(schema) = grammar.at(path) else { return Vec::new() };
    let pair = |name: &str, doc: &str| (name.to_string(), doc.to_string());
    match grammar.form(schema) {
        SchemaForm::Variants(variants) => variants.iter().map(|v| pair(v.name, v.doc)).collect(),
        SchemaForm::Plain(plain) => {
            keys(plain).into_iter().map(|key| pair(key, doc(&plain["properties"][key]))).collect()
        }
        SchemaForm::Anything | SchemaForm::Choice(_) => Vec::new(),
    }
}

/// Names and texts in two columns.
fn table(rows: &[(String, String)]) -> String {
    let width = rows.iter().map(|(name, _)| name.len()).max().unwrap_or(0);
    rows.iter().map(|(name, text)| format!("{name:width$}  {text}\n")).collect()
}

fn indented(text: &str) -> String {
    text.lines().map(|line| format!("  {line}\n")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::tests::registry;

    fn list(topic: Option<Topic>) -> String {
        let mut out = Vec::new();
        run(&Args { topic }, &registry(), &mut out).expect("it prints");
        String::from_utf8(out).expect("it is text")
    }

    #[test]
    fn every_topic_has_names_with_a_line_of_documentation() {
        for topic in Topic::value_variants() {
            let text = list(Some(*topic));
            assert!(!text.is_empty(), "{topic:?} is empty");
            for line in text.lines() {
                assert!(line.split_whitespace().count() > 2, "{topic:?} has a bare line: {line}");
            }
        }
        assert!(list(Some(Topic::Shapes)).contains("half_space     Everything below z = 0."));
        assert!(
            list(Some(Topic::Estimators))
                .contains("path  Path tracing.\n  max_bounces  Largest number of bounces.")
        );
        assert!(list(Some(Topic::Lights)).contains("directional"));
    }

    #[test]
    fn everything_has_headings() {
        let text = list(None);
        assert!(text.contains("materials\n  apple ") && text.contains("sensors\n"), "{text}");
    }
}
