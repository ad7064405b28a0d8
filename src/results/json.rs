//! Canonical JSON and content hashes: equal values have equal bytes.

use serde::Serialize;

/// JSON with sorted keys, two-space indentation and a final newline; numbers are the shortest text
/// that reads back as the same f64. Numbers that are not finite become `null`.
///
/// # Panics
/// On a type that has no JSON (a map whose keys are no texts): a mistake in the program, and no input
/// makes it.
pub fn canonical(value: &impl Serialize) -> String {
    // serde_json::Value keeps its keys in a BTreeMap, so the detour sorts structs and maps alike.
    let value =
        serde_json::to_value(value).unwrap_or_else(|error| panic!("a type without JSON: {error}"));
    format!("{value:#}\n")
}

/// blake3 hash of `bytes`.
pub fn hash_bytes(bytes: &[u8]) -> [u8; 32] {
    *blake3::hash(bytes).as_bytes()
}

/// blake3 of bytes, hex.
pub fn hash_hex(bytes: &[u8]) -> String {
    blake3::hash(bytes).to_hex().to_string()
}

/// blake3 of a value's canonical JSON, hex.
pub fn hash_json(value: &impl Serialize) -> String {
    hash_hex(canonical(value).as_bytes())
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[derive(Serialize)]
    struct Unsorted {
        b: f64,
        a: [f64; 2],
    }

    #[test]
    fn keys_are_sorted_and_bytes_fixed() {
        let text = canonical(&Unsorted { b: 0.1, a: [1.0, 1e-300] });
        assert_eq!(text, "{\n  \"a\": [\n    1.0,\n    1e-300\n  ],\n  \"b\": 0.1\n}\n");
        assert_eq!(text, canonical(&json!({"b": 0.1, "a": [1.0, 1e-300]})));
    }

    // Needs serde_json's `float_roundtrip`: without it some of these come back one bit off.
    #[test]
    fn numbers_read_back_exactly() {
        let mut bits: u64 = 1;
        for _ in 0..20_000 {
            bits = bits.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(0x1405_7b7e_f767_814f);
            let x = f64::from_bits(bits);
            if x.is_finite() {
                let back: f64 = serde_json::from_str(&canonical(&x)).expect("a number");
                assert_eq!(back.to_bits(), x.to_bits(), "{x:e}");
            }
        }
    }

    // `printf 'abc' | b3sum` and the test vectors of the BLAKE3 repository.
    #[test]
    fn known_hash() {
        assert_eq!(hash_hex(b"abc"), "6437b3ac38465133ffb63b75273a8db548c558465d79db03fd359c6cd5bd9d85");
        assert_ne!(hash_json(&json!({"a": 1})), hash_json(&json!({"a": 2})));
    }
}
