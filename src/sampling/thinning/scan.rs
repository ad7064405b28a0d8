//! Thinning by evaluating every point: the oracle of tests, and the method of the hierarchy where nearly all
//! points are accepted.

use super::{Accepted, ThinningRule, ThinningWork, decide};
use crate::math::DVec3;
use crate::sampling::stream::Stream;

/// Points at a time: their distances fit the first-level cache, and are computed in a loop without
/// branches.
const CHUNK: usize = 256;

/// Accepts points in `range` of the coordinates `points`, each with p of its distance from `at`.
pub fn scan(
    points: [&[f64]; 3],
    range: std::ops::Range<usize>,
    at: DVec3,
    rule: &ThinningRule,
    stream: &mut Stream,
    work: &mut ThinningWork,
    mut accept: impl FnMut(Accepted),
) {
    let mut squared = [0.0; CHUNK];
    let mut start = range.start;
    while start < range.end {
        let end = (start + CHUNK).min(range.end);
        let [x, y, z] = points.map(|axis| &axis[start..end]);
        for (((squared, x), y), z) in squared.iter_mut().zip(x).zip(y).zip(z) {
            let [x, y, z] = [x - at.x, y - at.y, z - at.z];
            *squared = x * x + y * y + z * z;
        }
        for (offset, &squared) in squared[..end - start].iter().enumerate() {
            if let Some((distance, weight)) = decide(rule, stream.draw_fine(), squared) {
                accept(Accepted { index: start + offset, distance, weight });
                work.accepted += 1;
            }
        }
        start = end;
    }
    work.candidates += range.len() as u64;
}
