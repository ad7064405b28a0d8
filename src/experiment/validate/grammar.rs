//! A JSON Schema as schemars writes it, read as the grammar of a file.

use serde_json::Value as Json;

/// A JSON Schema with its definitions.
pub(crate) struct Grammar {
    root: Json,
}

/// What a schema asks for.
pub(crate) enum SchemaForm<'a> {
    /// Any value at all.
    Anything,
    /// One of several alternatives of different types.
    Choice(Vec<&'a Json>),
    /// One of several named variants: a bare string, or a table with the name as its only key.
    Variants(Vec<Variant<'a>>),
    /// A value of the type that the schema names.
    Plain(&'a Json),
}

/// One variant of an enum.
pub(crate) struct Variant<'a> {
    /// Its name in the file.
    pub name: &'a str,
    /// The schema of the value under the name; none for a bare string.
    pub content: Option<&'a Json>,
    /// The first line of its documentation.
    pub doc: &'a str,
    /// The schema that documents it.
    pub about: &'a Json,
}

impl Grammar {
    /// The grammar of a complete schema.
    pub(crate) fn new(root: Json) -> Grammar {
        Grammar { root }
    }

    /// The schema of the whole file.
    pub(crate) fn root(&self) -> &Json {
        &self.root
    }

    /// What `schema` asks for, references followed.
    pub(crate) fn form<'a>(&'a self, schema: &'a Json) -> SchemaForm<'a> {
        let schema = self.resolve(schema);
        if let Some(alternatives) = schema.get("anyOf").and_then(Json::as_array) {
            let alternatives: Vec<&Json> = alternatives.iter().filter(|a| !is_null(a)).collect();
            return match alternatives[..] {
                [only] => self.form(only),
                _ => SchemaForm::Choice(alternatives),
            };
        }
        if schema.get("properties").is_none() && schema.get("oneOf").is_some() {
            return SchemaForm::Variants(variants(schema));
        }
        if schema.get("enum").is_some() || schema.get("const").is_some() {
            return SchemaForm::Variants(bare_variants(schema));
        }
        if schema.get("type").is_none() { SchemaForm::Anything } else { SchemaForm::Plain(schema) }
    }

    /// A definition of the schema by its name.
    pub(crate) fn definition(&self, name: &str) -> Option<&Json> {
        self.root["$defs"].get(name)
    }

    /// The schema at a path of keys and indices, if the grammar knows it.
    pub(crate) fn at<'a>(&'a self, path: &[&str]) -> Option<&'a Json> {
        path.iter().try_fold(&self.root, |schema, word| self.step(schema, word))
    }

    /// The names that cannot stand beside the last word of `path`, and are replaced where it is set as a
    /// whole: the other variants of its enum, or the other keys of which its table has exactly one.
    pub(crate) fn rivals(&self, path: &[&str]) -> Vec<&str> {
        let Some((last, parents)) = path.split_last() else { return Vec::new() };
        let mut names = match self.at(parents).map(|parent| self.form(parent)) {
            Some(SchemaForm::Variants(variants)) => variants.iter().map(|v| v.name).collect(),
            Some(SchemaForm::Plain(plain)) => one_of(plain),
            _ => Vec::new(),
        };
        if !names.contains(last) {
            return Vec::new();
        }
        names.retain(|name| name != last);
        names
    }

    /// The names that may follow a path: keys of a table or variants of an enum.
    pub(crate) fn names_at(&self, path: &[&str]) -> Vec<&str> {
        self.at(path).map(|schema| self.names(schema)).unwrap_or_default()
    }

    fn names<'a>(&'a self, schema: &'a Json) -> Vec<&'a str> {
        match self.form(schema) {
            SchemaForm::Anything => Vec::new(),
            SchemaForm::Choice(alternatives) => {
                alternatives.iter().flat_map(|a| self.names(a)).collect()
            }
            SchemaForm::Variants(variants) => variants.iter().map(|v| v.name).collect(),
            SchemaForm::Plain(plain) => keys(plain),
        }
    }

    fn step<'a>(&'a self, schema: &'a Json, word: &str) -> Option<&'a Json> {
        match self.form(schema) {
            SchemaForm::Anything => None,
            SchemaForm::Choice(alternatives) => alternatives.iter().find_map(|a| self.step(a, word)),
            SchemaForm::Variants(variants) => variants.iter().find(|v| v.name == word)?.content,
            SchemaForm::Plain(plain) => match plain.get("properties").and_then(|p| p.get(word)) {
                Some(property) => Some(property),
                None if word.parse::<usize>().is_ok() => plain.get("items"),
                None => plain.get("additionalProperties").filter(|rest| rest.is_object()),
            },
        }
    }

    fn resolve<'a>(&'a self, schema: &'a Json) -> &'a Json {
        let Some(reference) = schema.get("$ref").and_then(Json::as_str) else { return schema };
        let target = reference.strip_prefix('#').and_then(|pointer| self.root.pointer(pointer));
        self.resolve(target.unwrap_or_else(|| panic!("schema reference {reference} has no target")))
    }
}

/// The keys of which a table must have exactly one.
pub(crate) fn one_of(schema: &Json) -> Vec<&str> {
    let alternatives = schema.get("oneOf").and_then(Json::as_array).into_iter().flatten();
    alternatives.flat_map(|alternative| strings(alternative.get("required"))).collect()
}

/// The keys that a table's schema names.
pub(crate) fn keys(schema: &Json) -> Vec<&str> {
    let properties = schema.get("properties").and_then(Json::as_object);
    properties.map(|p| p.keys().map(String::as_str).collect()).unwrap_or_default()
}

/// The first line of a schema's documentation.
pub(crate) fn doc(schema: &Json) -> &str {
    schema.get("description").and_then(Json::as_str).unwrap_or("").lines().next().unwrap_or("")
}

/// The first paragraph of a schema's documentation, on one line.
pub(crate) fn paragraph(schema: &Json) -> String {
    let text = schema.get("description").and_then(Json::as_str).unwrap_or("");
    text.lines().map(str::trim).take_while(|line| !line.is_empty()).collect::<Vec<_>>().join(" ")
}

/// The strings of an array in a schema.
pub(crate) fn strings(list: Option<&Json>) -> Vec<&str> {
    let list = list.and_then(Json::as_array);
    list.map(|l| l.iter().filter_map(Json::as_str).collect()).unwrap_or_default()
}

fn is_null(schema: &Json) -> bool {
    schema.get("type").and_then(Json::as_str) == Some("null")
}

fn variants(schema: &Json) -> Vec<Variant<'_>> {
    let alternatives = schema["oneOf"].as_array().into_iter().flatten();
    alternatives
        .flat_map(|a| if a.get("properties").is_some() { tagged(a) } else { bare_variants(a) })
        .collect()
}

fn tagged(schema: &Json) -> Vec<Variant<'_>> {
    let content = |name| schema["properties"].get(name);
    keys(schema)
        .into_iter()
        .map(|name| Variant { name, content: content(name), doc: doc(schema), about: schema })
        .collect()
}

fn bare_variants(schema: &Json) -> Vec<Variant<'_>> {
    let single = schema.get("const").and_then(Json::as_str);
    let names = strings(schema.get("enum")).into_iter().chain(single);
    names.map(|name| Variant { name, content: None, doc: doc(schema), about: schema }).collect()
}
