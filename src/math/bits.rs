//! Whether functions have the bits of others.

/// At one number; all that are none are the same.
pub(super) fn assert_same(own: fn(f64) -> f64, other: fn(f64) -> f64, x: f64) {
    let (own, expected) = (own(x), other(x));
    let both_none = own.is_nan() && expected.is_nan();
    assert!(own.to_bits() == expected.to_bits() || both_none, "{x:e}: {own:e}, {expected:e}");
}

/// At 200 numbers on each side.
pub(super) fn around(x: f64, check: impl Fn(f64)) {
    let (mut up, mut down) = (x, x);
    for _ in 0..200 {
        check(up);
        check(down);
        (up, down) = (up.next_up(), down.next_down());
    }
}

/// A million bit patterns, and a number in [0, 1) from each: a counter through the finaliser of SplitMix64.
pub(super) fn scattered() -> impl Iterator<Item = (u64, f64)> {
    (0..1_000_000u64).map(|k| {
        let x = k.wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        let bits = x ^ (x >> 31);
        (bits, (bits >> 11) as f64 / (1u64 << 53) as f64)
    })
}
