//! "Did you mean": the help for a name that is not known. The only module that uses `strsim`.

use strsim::normalized_damerau_levenshtein;

/// Names at least this similar (1 is equal) are offered as what was meant.
const NEAR: f64 = 0.6;

/// The known name nearest to `name`, if one is near.
pub(crate) fn nearest<'a>(name: &str, known: &[&'a str]) -> Option<&'a str> {
    let name = name.to_lowercase();
    let likeness = |candidate: &str| normalized_damerau_levenshtein(&name, &candidate.to_lowercase());
    let best = known.iter().max_by(|a, b| likeness(a).total_cmp(&likeness(b)))?;
    (likeness(best) >= NEAR).then_some(*best)
}

/// The help for an unknown name: the nearest known one, else all of them, introduced by `what`.
pub(crate) fn help(name: &str, known: &[&str], what: &str) -> String {
    match nearest(name, known) {
        Some(near) => format!("did you mean `{near}`?"),
        None if known.is_empty() => format!("there are no {what} here"),
        None => format!("known {what}: {}", quoted(known)),
    }
}

/// `` `a`, `b` ``.
pub(crate) fn quoted(names: &[&str]) -> String {
    names.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
}

/// `a, b or c` for the joining word `or`.
pub(crate) fn join(names: &[&str], word: &str) -> String {
    match names.split_last() {
        Some((end, rest)) if !rest.is_empty() => format!("{} {word} {end}", rest.join(", ")),
        _ => names.concat(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_names_are_offered_and_far_ones_listed() {
        let known = ["albedo", "sigma_t_per_mm", "g"];
        assert_eq!(help("albdo", &known, "keys"), "did you mean `albedo`?");
        assert_eq!(help("sigma_t", &known, "keys"), "known keys: `albedo`, `sigma_t_per_mm`, `g`");
        assert_eq!(help("x", &[], "keys"), "there are no keys here");
        assert_eq!(join(&["a", "b", "c"], "and"), "a, b and c");
    }
}
