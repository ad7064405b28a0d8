//! Verdicts for continuous integration, in JUnit's XML format.

use super::verdict::{Outcome, Verdict};

/// One `testsuite` an experiment, one `testcase` a verdict; a failed claim is a `failure`, one that
/// could not be judged an `error`.
pub(crate) fn to_junit(verdicts: &[Verdict]) -> String {
    let mut experiments: Vec<&str> = verdicts.iter().map(|v| v.experiment.as_str()).collect();
    experiments.dedup();
    let mut xml = String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites>\n");
    for experiment in experiments {
        let own: Vec<&Verdict> = verdicts.iter().filter(|v| v.experiment == experiment).collect();
        let failures = own.iter().filter(|v| v.outcome == Outcome::Fail).count();
        let errors = own.iter().filter(|v| !v.is_green()).count() - failures;
        xml += &format!(
            "  <testsuite name=\"{}\" tests=\"{}\" failures=\"{failures}\" errors=\"{errors}\">\n",
            escape(experiment),
            own.len()
        );
        own.iter().for_each(|v| xml += &case(v));
        xml += "  </testsuite>\n";
    }
    xml + "</testsuites>\n"
}

fn case(v: &Verdict) -> String {
    // Of a sampler, the test's name states what is tested.
    let what = if v.observable.is_empty() { v.test_name() } else { v.observable.clone() };
    let parts = [&v.cell, &v.band, &what, &v.class, &v.estimators];
    let name: Vec<&str> =
        parts.iter().map(|part| part.as_str()).filter(|part| !part.is_empty()).collect();
    let head = format!(
        "    <testcase classname=\"{}\" name=\"{}\"",
        escape(&format!("{}.{}", v.experiment, v.claim)),
        escape(&name.join(", "))
    );
    let element = match v.outcome {
        Outcome::Pass => return head + "/>\n",
        Outcome::Fail => "failure",
        Outcome::Underpowered | Outcome::Invalid(_) => "error",
    };
    let numbers = [("measured", v.value), ("expected", v.expected), ("p", v.p_value)];
    let numbers = numbers.into_iter().filter_map(|(name, x)| Some(format!("{name} {:e}", x?)));
    let text = format!("{} {}", v.test_name(), numbers.collect::<Vec<_>>().join(", "));
    format!(
        "{head}>\n      <{element} type=\"{}\" message=\"{}\">{}</{element}>\n    </testcase>\n",
        v.outcome,
        escape(&v.note),
        escape(text.trim())
    )
}

/// Text for element content and attribute values; characters that XML 1.0 forbids become U+FFFD.
fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out += "&amp;",
            '<' => out += "&lt;",
            '>' => out += "&gt;",
            '"' => out += "&quot;",
            '\n' => out += "&#10;",
            c if c < ' ' && c != '\t' => out.push('\u{fffd}'),
            c => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::judge::judge_alone;
    use super::*;
    use crate::results::sample;

    #[test]
    fn escapes() {
        assert_eq!(escape("a<b & \"c\"\u{1}"), "a&lt;b &amp; &quot;c&quot;\u{fffd}");
    }

    #[test]
    fn counts_and_cases() {
        let stored = sample::judged(&[("a<b", 1.0), ("far", 2.0)]);
        let xml = to_junit(&judge_alone(&stored));
        assert!(
            xml.contains("<testsuite name=\"sample\" tests=\"2\" failures=\"1\" errors=\"0\">"),
            "{xml}"
        );
        assert!(
            xml.contains("classname=\"sample.a&lt;b\" name=\"smooth, R, mean, all, mis\"/>"),
            "{xml}"
        );
        assert!(xml.contains("<failure type=\"fail\" message=\"off by -"), "{xml}");
    }
}
