//! Rust source as tokens, as far as the rules of `layering` need it: comments are dropped, a string is
//! one token, and every token knows whether it stands in test code.

use std::path::{Component, Path, PathBuf};

/// A word, a literal or a punctuation mark; `::` is one token.
#[derive(Clone, Debug, PartialEq)]
pub struct Token<'a> {
    pub text: &'a str,
    pub line: usize,
    /// Inside an item under `#[cfg(test)]`.
    pub is_test: bool,
    /// Inline modules around it.
    pub depth: usize,
}

impl Token<'_> {
    pub fn is_word(&self) -> bool {
        self.text.starts_with(|c: char| c.is_alphabetic() || c == '_')
    }
}

/// The tokens of a source text.
pub fn tokens(text: &str) -> Vec<Token<'_>> {
    let mut tokens = Vec::new();
    let (mut rest, mut line) = (text, 1);
    while let Some(first) = rest.chars().next() {
        let (length, is_token) = next(rest, first);
        let (word, after) = rest.split_at(length);
        if is_token {
            tokens.push(Token { text: word, line, is_test: false, depth: 0 });
        }
        line += word.matches('\n').count();
        rest = after;
    }
    mark_depths(&mut tokens);
    mark_tests(&mut tokens);
    tokens
}

/// Length of the next piece, and whether it is a token.
fn next(rest: &str, first: char) -> (usize, bool) {
    let all = rest.len();
    if first.is_whitespace() {
        return (first.len_utf8(), false);
    }
    if rest.starts_with("//") {
        return (rest.find('\n').unwrap_or(all), false);
    }
    if rest.starts_with("/*") {
        return (block_comment(rest), false);
    }
    if let Some(length) = string(rest) {
        return (length, true);
    }
    if first == '\'' {
        return (quoted_char(rest), true);
    }
    if first.is_alphabetic() || first == '_' {
        return (rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(all), true);
    }
    if first.is_ascii_digit() {
        return (number(rest), true);
    }
    (if rest.starts_with("::") { 2 } else { first.len_utf8() }, true)
}

fn block_comment(rest: &str) -> usize {
    let (mut depth, mut at) = (0, 0);
    while at < rest.len() {
        if rest[at..].starts_with("/*") {
            (depth, at) = (depth + 1, at + 2);
        } else if rest[at..].starts_with("*/") {
            (depth, at) = (depth - 1, at + 2);
            if depth == 0 {
                return at;
            }
        } else {
            at += rest[at..].chars().next().map_or(1, char::len_utf8);
        }
    }
    rest.len()
}

/// Length of a string literal, raw or not, where one begins.
fn string(rest: &str) -> Option<usize> {
    let body = rest.trim_start_matches(['b', 'c']);
    let prefix = rest.len() - body.len();
    if prefix > 1 {
        return None;
    }
    if let Some(raw) = body.strip_prefix('r') {
        let opened = raw.trim_start_matches('#');
        let hashes = raw.len() - opened.len();
        let inner = opened.strip_prefix('"')?;
        let end = format!("\"{}", "#".repeat(hashes));
        let length = inner.find(&end).map_or(inner.len(), |at| at + end.len());
        return Some(prefix + 1 + hashes + 1 + length);
    }
    let inner = body.strip_prefix('"')?;
    let mut escaped = false;
    for (at, c) in inner.char_indices() {
        match c {
            _ if escaped => escaped = false,
            '\\' => escaped = true,
            '"' => return Some(prefix + 1 + at + 1),
            _ => {}
        }
    }
    Some(rest.len())
}

/// Length of a character literal, or of a lifetime's tick.
fn quoted_char(rest: &str) -> usize {
    let inner = &rest[1..];
    if let Some(escape) = inner.strip_prefix('\\') {
        return 2 + escape.char_indices().skip(1).find(|(_, c)| *c == '\'').map_or(1, |(at, _)| at + 1);
    }
    let first = inner.chars().next().map_or(0, char::len_utf8);
    if inner[first..].starts_with('\'') { 1 + first + 1 } else { 1 }
}

fn number(rest: &str) -> usize {
    let bytes = rest.as_bytes();
    let mut at = 0;
    while at < bytes.len() {
        let next_is_digit = bytes.get(at + 1).is_some_and(u8::is_ascii_digit);
        match bytes[at] {
            b'.' if next_is_digit => at += 1,
            b if b.is_ascii_alphanumeric() || b == b'_' => at += 1,
            _ => break,
        }
    }
    at
}

/// Counts the inline modules around every token.
fn mark_depths(tokens: &mut [Token]) {
    let (mut braces, mut modules) = (0usize, Vec::new());
    for i in 0..tokens.len() {
        match tokens[i].text {
            "{" => {
                let opens_module = i >= 2 && tokens[i - 2].text == "mod" && tokens[i - 1].is_word();
                if opens_module {
                    modules.push(braces);
                }
                braces += 1;
            }
            "}" => {
                braces = braces.saturating_sub(1);
                if modules.last() == Some(&braces) {
                    modules.pop();
                }
            }
            _ => {}
        }
        tokens[i].depth = modules.len();
    }
}

const CFG_TEST: [&str; 7] = ["#", "[", "cfg", "(", "test", ")", "]"];

fn is_cfg_test(tokens: &[Token]) -> bool {
    tokens.len() >= CFG_TEST.len() && tokens.iter().zip(CFG_TEST).all(|(token, text)| token.text == text)
}

/// Marks every item under `#[cfg(test)]`.
fn mark_tests(tokens: &mut [Token]) {
    let mut i = 0;
    while i < tokens.len() {
        if is_cfg_test(&tokens[i..]) {
            let end = item_end(tokens, i);
            tokens[i..end].iter_mut().for_each(|token| token.is_test = true);
            i = end;
        } else {
            i += 1;
        }
    }
}

/// Where the item that begins at `start`, with its attributes, ends.
fn item_end(tokens: &[Token], start: usize) -> usize {
    let mut nesting = 0usize;
    for (i, token) in tokens.iter().enumerate().skip(start) {
        match token.text {
            "(" | "[" | "{" => nesting += 1,
            ")" | "]" => nesting = nesting.saturating_sub(1),
            "}" => {
                nesting = nesting.saturating_sub(1);
                if nesting == 0 {
                    return i + 1;
                }
            }
            ";" if nesting == 0 => return i + 1,
            _ => {}
        }
    }
    tokens.len()
}

/// Files of the test modules that a source declares with `#[cfg(test)] mod name;`.
pub fn test_modules(path: &Path, text: &str) -> Vec<PathBuf> {
    let tokens = tokens(text);
    let mut files = Vec::new();
    for (i, token) in tokens.iter().enumerate() {
        let [name, end] = tokens.get(i + 1..i + 3).unwrap_or_default() else { continue };
        if token.text == "mod" && token.is_test && end.text == ";" {
            files.extend(module_files(path, name.text, path_attribute(&tokens[..i])));
        }
    }
    files
}

/// The text of `#[path = ".."]` before an item.
fn path_attribute<'a>(before: &[Token<'a>]) -> Option<&'a str> {
    let tail = before.iter().rev().take(8).collect::<Vec<_>>();
    let at = tail.iter().position(|token| token.text == "path")?;
    tail[..at].iter().find(|token| token.text.starts_with('"')).map(|token| token.text.trim_matches('"'))
}

fn module_files(path: &Path, name: &str, named: Option<&str>) -> Vec<PathBuf> {
    let folder = path.parent().unwrap_or(Path::new(""));
    if let Some(named) = named {
        return vec![folder.join(named)];
    }
    let base = match module_path(path).last() {
        Some(own) if !path.ends_with("mod.rs") => folder.join(own),
        _ => folder.to_path_buf(),
    };
    vec![base.join(format!("{name}.rs")), base.join(name).join("mod.rs")]
}

/// The modules that a file below `src` is: `src/a/b.rs` is `a`, `b`; the crate's root is none.
pub fn module_path(path: &Path) -> Vec<String> {
    let without = path.with_extension("");
    let words = without.components().filter_map(|c| match c {
        Component::Normal(word) => Some(word.to_string_lossy().into_owned()),
        _ => None,
    });
    let mut words: Vec<String> = words.skip(1).collect();
    if words.last().is_some_and(|word| ["mod", "lib", "main"].contains(&word.as_str())) {
        words.pop();
    }
    words
}

#[test]
fn strings_comments_and_ticks_are_no_code() {
    let text = "// a\n/* b /* c */ d */ e \"f \\\" g\" r#\"h \" i\"# 'j' '\\'' &'k l<'_> 2.0f64.m b\"n\" br\"o\"";
    let found: Vec<&str> = tokens(text).iter().filter(|t| t.is_word()).map(|t| t.text).collect();
    assert_eq!(found, ["e", "r#\"h \" i\"#", "k", "l", "_", "m", "b\"n\"", "br\"o\""]);
    assert_eq!(tokens("a::b\n.c(1..2)").iter().map(|t| t.line).collect::<Vec<_>>()[..4], [1, 1, 1, 2]);
}

#[test]
fn test_code_is_known() {
    let text =
        "fn a() {} #[cfg(test)] #[path = \"x_tests.rs\"] mod t; b #[cfg(test)] mod u { c { d } } e";
    let marked: Vec<&str> = tokens(text)
        .iter()
        .filter(|t| t.is_test && t.text.len() == 1 && t.is_word())
        .map(|t| t.text)
        .collect();
    assert_eq!(marked, ["t", "u", "c", "d"]);
    assert_eq!(test_modules(Path::new("src/a/b.rs"), text), [PathBuf::from("src/a/x_tests.rs")]);
    let plain = test_modules(Path::new("src/a/b.rs"), "#[cfg(test)]\nmod tests;");
    assert!(plain.contains(&PathBuf::from("src/a/b/tests.rs")), "{plain:?}");
    let plain = test_modules(Path::new("src/a/mod.rs"), "#[cfg(test)]\nmod tests;");
    assert!(plain.contains(&PathBuf::from("src/a/tests.rs")), "{plain:?}");
}
