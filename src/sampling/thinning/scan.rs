//! Thinning by evaluating every point: the oracle of tests, and the method of the hierarchy where nearly all
//! points are accepted.

use super::{Accepted, BATCH, Candidates, ThinningRule, ThinningWork};
use crate::math::DVec3;
use crate::sampling::stream::Stream;

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
    let mut candidates = Candidates::none();
    // Of a batch of points: they fit the first-level cache, and are computed in a loop without branches.
    let mut squared = [0.0; BATCH];
    let mut start = range.start;
    while start < range.end {
        let end = (start + BATCH).min(range.end);
        let [x, y, z] = points.map(|axis| &axis[start..end]);
        for (((squared, x), y), z) in squared.iter_mut().zip(x).zip(y).zip(z) {
            let [x, y, z] = [x - at.x, y - at.y, z - at.z];
            *squared = x * x + y * y + z * z;
        }
        for (offset, &squared) in squared[..end - start].iter().enumerate() {
            candidates.add(rule, start + offset, stream.draw_fine(), squared);
        }
        candidates.decide(rule, work, &mut accept);
        start = end;
    }
    work.candidates += range.len() as u64;
}
