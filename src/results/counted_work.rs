//! The factor by which ratios of counted work may differ from those of CPU time, by kind of estimator.

/// By kind, the largest factor between the cost of a run by counted work (`verify::weights`) and by CPU
/// time, both relative to path tracing in the same cell: over 27 cells of light transport and 12 of BSSRDF
/// models, on a sphere: the largest of two machines, by the weights of their time. For `path` itself it is that of analog
/// roulette. Printed by
///
/// ```text
/// cargo test --release --test integration -- --ignored --nocapture cpu_time_follows_the_counters
/// ```
///
/// One set of weights cannot serve all kinds: the counters know how often something was done, not what of
/// it was done (the Newton steps of a connection, light samples below the horizon, points of a cloud that
/// were put in order). BSSRDF models are farthest off under a matched boundary, where a shadow ray of path
/// tracing is one visibility test at every event and costs far less than its weight.
pub const FACTORS: [(&str, f64); 8] = [
    ("path", 1.2),
    ("snee", 3.6),
    ("bidirectional", 4.2),
    ("light_trace", 1.7),
    ("point_cloud", 4.6),
    ("bssrdf_probe", 8.1),
    ("bssrdf_rays", 3.6),
    ("bssrdf_density", 9.9),
];

/// The factor by which a ratio of counted work between two kinds may be off: between runs of one kind
/// that of the kind, else the product of both.
///
/// # Errors
/// As a sentence: a kind has no stated factor.
pub fn factor(a: &str, b: &str) -> Result<f64, String> {
    let of = |kind: &str| {
        let known = FACTORS.iter().find(|(known, _)| *known == kind).map(|(_, factor)| *factor);
        known
            .ok_or_else(|| format!("the counted work of `{kind}` has never been compared with CPU time"))
    };
    let (of_a, of_b) = (of(a)?, of(b)?);
    Ok(if a == b { of_a } else { of_a * of_b })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_have_a_factor() {
        let [path, snee] = ["path", "snee"].map(|kind| factor(kind, kind).expect("a factor"));
        assert_eq!(factor("snee", "path"), Ok(path * snee));
        assert!(factor("path", "ballistic").is_err_and(|why| why.contains("`ballistic`")));
    }
}
