//! The small part of regular expressions that schemas here use: `^`, `$`, literal characters and
//! `[...]` classes, each with an optional `*`, `+` or `?`.

/// One element of a pattern: what it takes and how often.
struct Element {
    class: Vec<(char, char)>,
    least: usize,
    most: usize,
}

impl Element {
    fn takes(&self, c: char) -> bool {
        self.class.iter().any(|&(from, to)| (from..=to).contains(&c))
    }
}

/// Whether the whole `text` matches `pattern`, which must begin with `^` and end with `$`.
///
/// # Panics
/// On a pattern outside the supported part: a mistake in a schema, not in an experiment.
pub fn matches(pattern: &str, text: &str) -> bool {
    let inner = pattern.strip_prefix('^').and_then(|p| p.strip_suffix('$'));
    let inner = inner.unwrap_or_else(|| panic!("pattern `{pattern}` must begin with ^ and end with $"));
    matches_from(&elements(inner), &text.chars().collect::<Vec<_>>())
}

fn elements(pattern: &str) -> Vec<Element> {
    let mut rest = pattern.chars().peekable();
    let mut elements = Vec::new();
    while let Some(c) = rest.next() {
        assert!(!"(){}|\\.".contains(c), "unsupported sign {c} in pattern `{pattern}`");
        let class = match c {
            '[' => class(&rest.by_ref().take_while(|&c| c != ']').collect::<Vec<_>>()),
            c => vec![(c, c)],
        };
        let (least, most) = match rest.peek() {
            Some('*') => (0, usize::MAX),
            Some('+') => (1, usize::MAX),
            Some('?') => (0, 1),
            _ => (1, 1),
        };
        if (least, most) != (1, 1) {
            rest.next();
        }
        elements.push(Element { class, least, most });
    }
    elements
}

fn class(signs: &[char]) -> Vec<(char, char)> {
    let mut ranges = Vec::new();
    let mut i = 0;
    while i < signs.len() {
        let is_range = i + 2 < signs.len() && signs[i + 1] == '-';
        ranges.push((signs[i], if is_range { signs[i + 2] } else { signs[i] }));
        i += if is_range { 3 } else { 1 };
    }
    ranges
}

fn matches_from(elements: &[Element], text: &[char]) -> bool {
    let Some((first, rest)) = elements.split_first() else { return text.is_empty() };
    let taken = text.iter().take(first.most).take_while(|&&c| first.takes(c)).count();
    (first.least..=taken).rev().any(|n| matches_from(rest, &text[n..]))
}

#[cfg(test)]
mod tests {
    use super::matches;

    #[test]
    fn names_match_and_others_do_not() {
        let name = "^[A-Za-z0-9][A-Za-z0-9_-]*$";
        for good in ["a", "snee-matrix", "9_x", "A-"] {
            assert!(matches(name, good), "{good}");
        }
        for bad in ["", "-a", "a b", "a/b", "ä"] {
            assert!(!matches(name, bad), "{bad}");
        }
        assert!(matches("^ab?c+$", "acc") && !matches("^ab?c+$", "abb"));
    }

    #[test]
    #[should_panic(expected = "unsupported sign")]
    fn other_patterns_are_mistakes() {
        matches("^(a|b)$", "a");
    }
}
