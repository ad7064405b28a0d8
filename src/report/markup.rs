//! Text in HTML, SVG and Markdown.

/// Text as HTML shows it, in elements and in attributes.
pub(super) fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// Text of Markdown that begins no HTML, which viewers take as it is.
pub(super) fn without_html(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for (at, sign) in text.char_indices() {
        let begins = text[at..]
            .chars()
            .nth(1)
            .is_some_and(|next| next.is_ascii_alphabetic() || "/!?".contains(next));
        if sign == '<' && begins {
            escaped.push('\\');
        }
        escaped.push(sign);
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn markdown_has_no_html() {
        for (text, markdown) in [
            ("<script>x</script>", "\\<script>x\\</script>"),
            ("a < b <= c <3 <", "a < b <= c <3 <"),
            ("<!-- --><?x?>", "\\<!-- -->\\<?x?>"),
        ] {
            assert_eq!(without_html(text), markdown);
        }
    }
}
