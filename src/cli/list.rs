//! `scatterproof list`: names what an experiment file may use.

use std::io::Write;

use clap::ValueEnum;

use super::output::unwritable;
use crate::error::{Error, Result};
use crate::experiment::describe::{describe, example, takes};
use crate::experiment::registry::option_docs;
use crate::experiment::schema_json::json_schema;
use crate::experiment::validate::grammar::{Grammar, SchemaForm, doc, keys, paragraph};
use crate::experiment::{Registry, suggest};
use crate::optics::{dispersion, materials};

/// List what an experiment file may use: estimators, materials, shapes and more.
///
/// The name of a topic lists its kinds; that of a kind, as `path` or `mesh`, its options with their types,
/// defaults and choices, and an example.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// A topic or a kind; default: all topics.
    #[arg(value_name = "TOPIC or KIND")]
    pub name: Option<String>,
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
    let topic = |name: &str| Topic::value_variants().iter().find(|topic| heading(topic) == name);
    let text = match args.name.as_deref() {
        Some(name) => match topic(name) {
            Some(topic) => lines(*topic, registry) + &hint(),
            None => kind(name, registry)?,
        },
        None => {
            let sections = Topic::value_variants()
                .iter()
                .map(|topic| format!("{}\n{}", heading(topic), indented(&lines(*topic, registry))));
            sections.collect::<Vec<_>>().join("\n") + "\n" + &hint()
        }
    };
    out.write_all(text.as_bytes()).map_err(unwritable)
}

fn heading(topic: &Topic) -> String {
    topic.to_possible_value().map(|v| v.get_name().to_string()).unwrap_or_default()
}

fn hint() -> String {
    "options of a kind, with types, defaults and an example: scatterproof list KIND\n".into()
}

/// Where the kinds of a topic are in the schema, and the key under which a file names one.
const PLACES: [(&[&str], &str); 10] = [
    (&["estimator", "0"], ""),
    (&["sampler", "0"], ""),
    (&["bands"], "bands."),
    (&["object", "shape"], "object.shape."),
    (&["object", "boundary"], "object.boundary."),
    (&["object", "medium"], "object.medium."),
    (&["sensor"], "sensor."),
    (&["light", "0"], ""),
    (&["budget"], "budget."),
    (&["claim", "0"], ""),
];

/// Keys of entries that are no kinds.
const NO_KINDS: [&str; 3] = ["name", "expect", "because"];

/// All that is known of the kinds of one name.
fn kind(name: &str, registry: &Registry) -> Result<String> {
    let grammar = Grammar::new(json_schema(registry));
    let mut text = String::new();
    let mut known = Vec::new();
    for (path, prefix) in PLACES {
        let names = grammar.names_at(path).into_iter().filter(|kind| !NO_KINDS.contains(kind));
        known.extend(names.map(String::from));
        let words: Vec<&str> = path.iter().copied().chain([name]).collect();
        if let Some(schema) = grammar.at(&words).filter(|_| !NO_KINDS.contains(&name)) {
            text += &described(&grammar, registry, schema, (path, prefix), name);
        }
    }
    for material in materials::MATERIALS.iter().filter(|m| m.name == name) {
        let example = format!("object.medium.preset = {{ name = \"{name}\", scale = 1.0 }}");
        text += &format!("{name}  {}\n\nexample\n  {example}\n", numbers(material));
    }
    for glass in dispersion::GLASSES.iter().filter(|g| g.name == name) {
        let example = format!("object.boundary.smooth = {{ eta = {{ material = \"{name}\" }} }}");
        text += &format!("{name}  {}\n\nexample\n  {example}\n", glass.source);
    }
    if text.is_empty() {
        known.extend(Topic::value_variants().iter().map(heading));
        known.extend(materials::names().into_iter().map(String::from));
        known.extend(dispersion::GLASSES.iter().map(|glass| glass.name.to_string()));
        let names: Vec<&str> = known.iter().map(String::as_str).collect();
        let help = match suggest::nearest(name, &names) {
            Some(near) => format!("did you mean `{near}`?"),
            None => "`scatterproof list` names everything".into(),
        };
        return Err(Error::input_help(format!("unknown topic or kind `{name}`"), help));
    }
    Ok(text)
}

fn described(
    grammar: &Grammar,
    registry: &Registry,
    schema: &serde_json::Value,
    (path, prefix): (&[&str], &str),
    name: &str,
) -> String {
    let doc_of = || {
        let of_variant = match grammar.at(path).map(|parent| grammar.form(parent)) {
            Some(SchemaForm::Variants(variants)) => {
                variants.iter().find(|v| v.name == name).map(|v| paragraph(v.about))
            }
            _ => None,
        };
        of_variant.unwrap_or_else(|| paragraph(schema))
    };
    let place = match path {
        [list, "0"] => format!("[[{list}]]"),
        _ => path.join("."),
    };
    let mut text = format!("{name}  (in {place})  {}\n", doc_of());
    if let Some(known) = registry.get(name).filter(|_| path[0] == "estimator") {
        text += &format!("serves {}\n", known.serves);
    }
    let rows = describe(grammar, schema);
    if !rows.is_empty() {
        text += "\nkeys\n";
    } else if prefix == "budget." {
        text += &format!("\ntakes {}\n", takes(grammar, schema));
    }
    for row in rows {
        let margin = "  ".repeat(row.depth + 1);
        let words = [row.takes, row.default].into_iter().filter(|word| !word.is_empty());
        let words: Vec<String> = words.collect();
        text += &match words.is_empty() {
            true => format!("{margin}\"{}\"\n", row.key),
            false => format!("{margin}{}: {}\n", row.key, words.join(", ")),
        };
        if !row.doc.is_empty() {
            text += &format!("{margin}    {}\n", row.doc);
        }
    }
    let example = example(grammar, schema, &format!("{prefix}{name}"));
    let example = match path {
        ["estimator" | "sampler", _] => format!("[[{}]]\n  name = \"{name}\"\n  {example}", path[0]),
        [list, "0"] => format!("[[{list}]]\n  {example}"),
        _ => example,
    };
    text + &format!("\nexample\n  {example}\n")
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
    use crate::experiment::document;
    use crate::experiment::tests::registry;
    use crate::experiment::validate::SchemaWalk;

    fn list(topic: Option<Topic>) -> String {
        let mut out = Vec::new();
        run(&Args { name: topic.map(|topic| heading(&topic)) }, &registry(), &mut out)
            .expect("it prints");
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

    /// Every kind has an example that fits the schema, and every key a type.
    #[test]
    fn kinds_are_described_with_examples() {
        let registry = Registry::builtin();
        let grammar = Grammar::new(json_schema(&registry));
        for (path, prefix) in PLACES {
            for name in grammar.names_at(path).into_iter().filter(|name| !NO_KINDS.contains(name)) {
                let words: Vec<&str> = path.iter().copied().chain([name]).collect();
                if name == "emission_per_mm" {
                    continue;
                }
                let schema = grammar.at(&words).expect("a schema");
                for row in describe(&grammar, schema) {
                    let is_bare = row.takes.is_empty() && row.doc.is_empty();
                    assert!(!is_bare, "{name}: `{}` is not described", row.key);
                }
                let example = example(&grammar, schema, &format!("{prefix}{name}"));
                let tree =
                    document::parse("example", &example).unwrap_or_else(|e| panic!("{name}: {e:?}"));
                let words = format!("{prefix}{name}");
                let words: Vec<&str> = words.split('.').collect();
                let node = tree.at(&words).unwrap_or_else(|| panic!("{name}: {example}"));
                let mut walk = SchemaWalk::new(&grammar, false);
                walk.node(node, schema, name);
                let findings = walk.into_findings();
                assert!(findings.is_empty(), "{name}: {example}: {findings:?}");
            }
        }
    }

    #[test]
    fn a_kind_is_described() {
        let text = |name: &str| {
            let mut out = Vec::new();
            let args = Args { name: Some(name.into()) };
            run(&args, &Registry::builtin(), &mut out).unwrap_or_else(|error| panic!("{error}"));
            String::from_utf8(out).expect("it is text")
        };
        let cloud = text("point_cloud");
        for part in [
            "samples: an integer from 1 to 1073741824, default 10000",
            "model: ",
            "required",
            "point_cloud = {",
        ] {
            assert!(cloud.contains(part), "no `{part}` in:\n{cloud}");
        }
        let rough = text("rough");
        for part in ["alpha: a number from 0.0001 to 1, required", "\"ggx\" or \"beckmann\""] {
            assert!(rough.contains(part), "no `{part}` in:\n{rough}");
        }
        assert!(text("skin1").contains("object.medium.preset = { name = \"skin1\""));
        assert!(text("bk7").contains("material = \"bk7\""));
        let args = Args { name: Some("point_clod".into()) };
        let error = run(&args, &Registry::builtin(), &mut Vec::new()).expect_err("no such kind");
        assert!(error.to_string().contains("did you mean `point_cloud`?"), "{error}");
    }

    #[test]
    fn everything_has_headings() {
        let text = list(None);
        assert!(text.contains("materials\n  apple ") && text.contains("sensors\n"), "{text}");
    }
}
