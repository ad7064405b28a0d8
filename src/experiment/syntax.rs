//! Errors of TOML syntax, with what was probably meant.

use std::collections::BTreeSet;

use crate::error::{Diagnostic, Place};

/// The parser's finding at `place`, in plain words and with what to write instead.
pub(super) fn finding(message: &str, place: Place) -> Diagnostic {
    let said = |rule: &str, help: &str| (rule.to_string(), Some(help.to_string()));
    let begin = place.text[..place.span.start].rfind('\n').map_or(0, |at| at + 1);
    let line = place.text[begin..].lines().next().unwrap_or("");
    let here = place.text().trim();
    let is_value = message.starts_with("string values must be quoted");
    if let Some(number) = decimal_comma(line) {
        let at = begin + line.find(number).unwrap_or(0);
        let help = Some(format!("write {}, with a point", number.replace(',', ".")));
        let place = Place { span: at..at + number.len(), ..place.clone() };
        return Diagnostic { rule: format!("`{number}` is not a number"), place: Some(place), help };
    }
    let (rule, help) = match message {
        _ if is_value && here.contains(['\u{201c}', '\u{201d}', '\u{2018}', '\u{2019}']) => {
            said("a typographic quotation mark", "write the straight one: \"")
        }
        _ if is_value && here.contains("//") => {
            said("`//` does not begin a comment", "a comment begins with #")
        }
        _ if is_value && here.starts_with('(') => {
            said("a list is written in brackets", "write [1, 2, 3], not (1, 2, 3)")
        }
        _ if is_value && here.starts_with(char::is_alphabetic) => {
            ("text is written in quotes".to_string(), Some(format!("write \"{here}\"")))
        }
        "duplicate key" => said(
            "duplicate key",
            "remove one of the two; a table that is written in several parts names each key once",
        ),
        "invalid mantissa, expected digits" if here.starts_with('.') || line.contains("= .") => {
            said("a number begins with a digit", "write 0 before the point, as 0.5")
        }
        _ if message.starts_with("invalid boolean") => {
            said(message, "write true or false, in small letters")
        }
        _ => (message.to_string(), None),
    };
    Diagnostic { rule, place: Some(place), help }
}

/// A value such as `1,3`, a number with a decimal comma.
fn decimal_comma(line: &str) -> Option<&str> {
    let value = line.split_once('=')?.1;
    let value = value.rsplit('=').next()?.trim_start();
    let end = value.find(|c: char| !c.is_ascii_digit() && c != ',').unwrap_or(value.len());
    let (whole, rest) = value[..end].split_once(',')?;
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    (is_number(whole) && is_number(rest)).then_some(&value[..end])
}

/// Of the findings in a line keeps the first: the others are mostly its consequences.
pub(super) fn keep_first_of_lines(findings: &mut Vec<Diagnostic>) {
    let at = |finding: &Diagnostic| finding.place.as_ref().map_or((0, 0), Place::line_column);
    findings.sort_by_key(at);
    let mut lines = BTreeSet::new();
    findings.retain(|finding| lines.insert(at(finding).0));
}

#[cfg(test)]
mod tests {
    use crate::experiment::document::parse;

    #[test]
    fn slips_that_are_not_toml_are_answered_with_what_to_write() {
        for (text, at, rule, help) in [
            ("name = base\n", (1, 8), "text is written in quotes", "write \"base\""),
            ("name = \u{201c}base\u{201d}\n", (1, 8), "a typographic quotation mark", "straight one"),
            ("seed = 1 // root\n", (1, 8), "`//` does not begin a comment", "begins with #"),
            ("toward = (0, 0, -1)\n", (1, 10), "a list is written in brackets", "write [1, 2, 3]"),
            ("seed = 1\nseed = 2\n", (2, 1), "duplicate key", "remove one of the two"),
            ("a = .3\n", (1, 5), "a number begins with a digit", "0.5"),
            ("a = True\n", (1, 5), "invalid boolean", "small letters"),
            ("a = 1,3\n", (1, 5), "`1,3` is not a number", "write 1.3"),
        ] {
            let findings = parse("x.toml", text).expect_err("it is not TOML");
            let [finding] = &findings[..] else { panic!("{text}: {findings:#?}") };
            let place = finding.place.as_ref().expect("it has a place").line_column();
            let told = finding.help.as_deref().unwrap_or("");
            assert!(finding.rule.contains(rule) && told.contains(help), "{finding:#?}");
            assert_eq!(place, at, "{text}");
        }
        let inline = parse("x.toml", "b = { eta = 1,3 }\n").expect_err("it is not TOML");
        assert!(inline.len() == 1 && inline[0].rule == "`1,3` is not a number", "{inline:#?}");
        assert!(parse("x.toml", "a = [1,3]\nb = { c = 1, d = 3 }\n").is_ok());
    }
}
