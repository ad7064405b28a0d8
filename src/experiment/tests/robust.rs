//! Damaged files are refused or accepted, never a panic and never accepted by the rules but not by the
//! types.

use proptest::prelude::*;

use super::*;

const WORDS: [&str; 24] = [
    "nan",
    "-1",
    "0",
    "1e400",
    "1.5",
    "true",
    "\"\"",
    "\"x\"",
    "[]",
    "{}",
    "[1]",
    "[[1]]",
    "{ a = 1 }",
    "2020-01-01",
    "99999999999",
    "inf",
    "name",
    "=",
    "object",
    "[[sweep]]",
    "key",
    "half_space",
    "matched",
    "\n",
];

const MORE: &str = r#"[[sweep]]
key = "object.boundary"
values = [{ smooth = { eta = 1.1 } }, { matched = {} }]
[[claim]]
equals = { value = 1, source = "s" }
[pair]
over = ["object.shape"]
[setting.a]
seed = 3
"#;

#[test]
fn the_undamaged_file_is_good() {
    assert_eq!(good(&format!("{GOOD}{MORE}")).cells.len(), 2);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..Default::default() })]
    #[test]
    fn damaged_files_never_panic(edits in prop::collection::vec((any::<prop::sample::Index>(), 0..WORDS.len()), 1..4)) {
        let text = format!("{GOOD}{MORE}");
        let mut tokens: Vec<&str> = text.split_inclusive([' ', '\n', ',', '.']).collect();
        for (index, word) in &edits {
            let i = index.index(tokens.len());
            tokens[i] = WORDS[*word];
        }
        if let Err(error) = try_load(&tokens.concat(), &[]) {
            prop_assert!(!error.to_string().contains("does not fit its types"), "{error}\n{}", tokens.concat());
        }
    }

    #[test]
    fn damaged_overrides_never_panic(key in "[a-z.0-9]{0,30}", word in 0..WORDS.len()) {
        let _ = try_load(GOOD, &[&format!("{key}={}", WORDS[word])]);
        let _ = try_load(GOOD, &[&format!("object.{key}={}", WORDS[word])]);
    }
}
