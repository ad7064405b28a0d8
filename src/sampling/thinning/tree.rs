//! Thinning by a hierarchy, with exactly the distribution of independent acceptances.
//!
//! Points are in the order of their Morton codes, so that a node is a range of them, with a box around
//! it. A query descends from the root; where it stops at a node, with p_m = p(distance to its box), it
//! draws candidates among the node's points at a rate q >= p_m, and accepts candidate i with probability
//! p_i / q.
//!
//! Why the distribution is that of independent Bernoulli(p_i):
//!   1. The nodes at which a query stops depend on the query point, the tree and constants alone, not on
//!      random numbers, and their ranges partition the points.
//!   2. The candidates of a range are independent Bernoulli(q), made in one of two ways that p_m alone
//!      decides: by gaps, q = p_m: floor(ln U / ln(1 - q)) is geometric with success q on 0, 1, ..., and
//!      independent geometric gaps between successes are what a Bernoulli process has; by words, q =
//!      ceil(256 p_m) / 256: bit by bit from the last binary digit of q, a random word is or-ed
//!      (digit 1) or and-ed (digit 0) to the result, each of whose 64 bits is then 1 with probability
//!      (digit + before) / 2.
//!   3. A candidate is accepted by a fresh number with p_i / q <= 1, as p does not increase and no point
//!      is nearer than its box: independent Bernoulli(q p_i / q) = Bernoulli(p_i).
//!   4. Different ranges use different numbers of the stream.

use std::ops::Range;

use super::{Accepted, Candidates, ThinningRule, ThinningWork};
use crate::math::{DVec3, ln_1p};
use crate::sampling::stream::Stream;

/// Points of a leaf, at most.
const LEAF: usize = 8;
/// A node with at most this many expected candidates is not refined.
const FEW: f64 = 4.0;
/// Nor one over which p varies by at most this factor.
const EVEN: f64 = 2.0;
/// From this p_m on candidates are drawn by words.
const LIKELY: f64 = 1.0 / 16.0;
/// Denominator of their rate.
const DIGITS: u32 = 8;

/// Points in Morton order with a hierarchy of boxes.
#[derive(Clone, Debug)]
pub struct PointTree {
    /// Coordinates, mm, in the order of the tree.
    axes: [Vec<f64>; 3],
    /// The index that each of them had before.
    order: Vec<u32>,
    /// Depth first: a node's left child follows it.
    nodes: Vec<Node>,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    /// Corners of the box, rounded outwards.
    low: [f32; 3],
    high: [f32; 3],
    first: u32,
    end: u32,
    /// The right child; 0 in leaves.
    right: u32,
}

impl PointTree {
    /// Of at most 2^32 - 1 points, mm.
    pub fn new(points: &[DVec3]) -> PointTree {
        let mut coded = coded(points);
        coded.sort_unstable();
        let order: Vec<u32> = coded.iter().map(|&(_, index)| index).collect();
        let codes: Vec<u64> = coded.into_iter().map(|(code, _)| code).collect();
        let axis = |of: fn(&DVec3) -> f64| order.iter().map(|&i| of(&points[i as usize])).collect();
        let axes = [axis(|p| p.x), axis(|p| p.y), axis(|p| p.z)];
        let mut nodes = Vec::with_capacity(points.len() / 2 + 1);
        if !points.is_empty() {
            build(&codes, &axes, 0, points.len(), &mut nodes);
        }
        nodes.shrink_to_fit();
        PointTree { axes, order, nodes }
    }

    /// The index that the point at each place of the tree had before.
    pub fn order(&self) -> &[u32] {
        &self.order
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.order.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.order.is_empty()
    }

    /// The point at a place of the tree.
    #[inline]
    pub fn point(&self, index: usize) -> DVec3 {
        let [x, y, z] = &self.axes;
        DVec3::new(x[index], y[index], z[index])
    }

    /// Coordinates in the order of the tree.
    pub fn axes(&self) -> [&[f64]; 3] {
        [&self.axes[0], &self.axes[1], &self.axes[2]]
    }

    /// Memory behind it, bytes.
    #[cfg(test)]
    pub fn heap_bytes(&self) -> usize {
        let axes: usize = self.axes.iter().map(|axis| size_of_val(&**axis)).sum();
        axes + size_of_val(&*self.order) + size_of_val(&*self.nodes)
    }

    /// Accepts each point independently with p of its distance from `at`.
    pub fn thin(
        &self,
        at: DVec3,
        rule: &ThinningRule,
        stream: &mut Stream,
        work: &mut ThinningWork,
        mut accept: impl FnMut(Accepted),
    ) {
        let mut stack = [0u32; 128]; // a Morton code halves at most 63 times, equal codes 32 times more
        let mut height = usize::from(!self.nodes.is_empty());
        let candidates = &mut Candidates::none();
        while height > 0 {
            height -= 1;
            let index = stack[height];
            let node = &self.nodes[index as usize];
            work.nodes += 1;
            let (nearest, farthest) = node.distances(at);
            let most = rule.probability(nearest);
            let count = f64::from(node.end - node.first);
            if node.right != 0 && count * most > FEW && rule.varies(EVEN, [nearest, farthest], most) {
                stack[height] = node.right;
                stack[height + 1] = index + 1;
                height += 2;
                continue;
            }
            let (stream, work) = (&mut *stream, &mut *work);
            let mut query = Query { tree: self, at, rule, stream, work, candidates };
            let range = node.first as usize..node.end as usize;
            if most > LIKELY {
                query.by_words(range, most, &mut accept);
            } else if most > 0.0 {
                query.by_gaps(range, most, &mut accept);
            }
        }
        candidates.decide(rule, work, &mut accept);
    }
}

struct Query<'a> {
    tree: &'a PointTree,
    at: DVec3,
    rule: &'a ThinningRule,
    stream: &'a mut Stream,
    work: &'a mut ThinningWork,
    candidates: &'a mut Candidates,
}

impl Query<'_> {
    /// Candidates at rate `rate` by geometric gaps.
    #[inline]
    fn by_gaps(&mut self, range: Range<usize>, rate: f64, accept: &mut impl FnMut(Accepted)) {
        let per_gap = 1.0 / ln_1p(-rate);
        let mut index = range.start;
        while index < range.end {
            // In floating point: a gap may exceed any integer.
            let gap = ln_1p(-self.stream.draw_fine()) * per_gap;
            if gap >= (range.end - index) as f64 {
                return;
            }
            index += gap as usize;
            self.ask(index, rate, accept);
            index += 1;
        }
    }

    /// Candidates at the next rate above `most` that has few digits, 64 points at a time.
    #[inline]
    fn by_words(&mut self, range: Range<usize>, most: f64, accept: &mut impl FnMut(Accepted)) {
        let whole = f64::from(1u32 << DIGITS);
        let digits = (most * whole).ceil() as u32;
        let rate = f64::from(digits) / whole;
        for start in range.clone().step_by(64) {
            let mut word = self.trials(digits);
            if range.end - start < 64 {
                word &= (1 << (range.end - start)) - 1;
            }
            while word != 0 {
                self.ask(start + word.trailing_zeros() as usize, rate, accept);
                word &= word - 1;
            }
        }
    }

    /// 64 bits, each 1 with probability digits / 2^DIGITS.
    #[inline]
    fn trials(&mut self, digits: u32) -> u64 {
        if digits >> DIGITS != 0 {
            return u64::MAX;
        }
        let mut word = 0;
        // Digits 0 after the last 1 would and to a word of zeros.
        for digit in digits.trailing_zeros()..DIGITS {
            let random = self.stream.draw_bits();
            word = if digits >> digit & 1 == 1 { word | random } else { word & random };
        }
        word
    }

    /// Adds a candidate that was drawn at rate `rate`, and decides about all where there is room for no more.
    #[inline]
    fn ask(&mut self, index: usize, rate: f64, accept: &mut impl FnMut(Accepted)) {
        self.work.candidates += 1;
        let squared = (self.tree.point(index) - self.at).length_squared();
        self.candidates.add(self.rule, index, rate * self.stream.draw_fine(), squared);
        if self.candidates.is_full() {
            self.candidates.decide(self.rule, self.work, accept);
        }
    }
}

impl Node {
    /// Distances from a point to the nearest and to the farthest point of the box.
    #[inline]
    fn distances(&self, at: DVec3) -> (f64, f64) {
        let (mut near, mut far) = (0.0, 0.0);
        for ((low, high), at) in self.low.iter().zip(&self.high).zip(at.to_array()) {
            let [below, above] = [f64::from(*low) - at, at - f64::from(*high)];
            let outside = below.max(above).max(0.0);
            let across = below.min(above);
            near += outside * outside;
            far += across * across;
        }
        (near.sqrt(), far.sqrt())
    }
}

/// Morton codes in a cube around the points, 21 bits an axis, with the points' indices.
fn coded(points: &[DVec3]) -> Vec<(u64, u32)> {
    let low = points.iter().fold(DVec3::INFINITY, |low, &p| low.min(p));
    let high = points.iter().fold(DVec3::NEG_INFINITY, |high, &p| high.max(p));
    let side = (high - low).max_element();
    let scale = if side > 0.0 { f64::from((1u32 << 21) - 1) / side } else { 0.0 };
    let code = |&point: &DVec3| {
        let [x, y, z] = ((point - low) * scale).to_array().map(|x| spread(x as u64));
        x << 2 | y << 1 | z
    };
    points.iter().enumerate().map(|(index, point)| (code(point), index as u32)).collect()
}

/// Two zeros between the lowest 21 bits.
fn spread(x: u64) -> u64 {
    let x = (x | x << 32) & 0x001f_0000_0000_ffff;
    let x = (x | x << 16) & 0x001f_0000_ff00_00ff;
    let x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
    let x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
    (x | x << 2) & 0x1249_2492_4924_9249
}

/// Appends the node of a range and its children; returns its index.
fn build(codes: &[u64], axes: &[Vec<f64>; 3], first: usize, end: usize, nodes: &mut Vec<Node>) -> u32 {
    let index = nodes.len();
    let range = [first as u32, end as u32];
    nodes.push(Node { low: [0.0; 3], high: [0.0; 3], first: range[0], end: range[1], right: 0 });
    if end - first <= LEAF {
        let corner = |axis: &[f64]| {
            let low = axis[first..end].iter().fold(f64::INFINITY, |low, &x| low.min(x));
            let high = axis[first..end].iter().fold(f64::NEG_INFINITY, |high, &x| high.max(x));
            ((low as f32).next_down(), (high as f32).next_up())
        };
        let corners = [corner(&axes[0]), corner(&axes[1]), corner(&axes[2])];
        nodes[index].low = corners.map(|(low, _)| low);
        nodes[index].high = corners.map(|(_, high)| high);
    } else {
        let middle = split(&codes[first..end]) + first;
        build(codes, axes, first, middle, nodes);
        let right = build(codes, axes, middle, end, nodes);
        let [a, b] = [nodes[index + 1], nodes[right as usize]];
        let node = &mut nodes[index];
        node.low = std::array::from_fn(|i| a.low[i].min(b.low[i]));
        node.high = std::array::from_fn(|i| a.high[i].max(b.high[i]));
        node.right = right;
    }
    index as u32
}

/// Where the highest bit changes that not all codes share; the middle where all are equal.
fn split(codes: &[u64]) -> usize {
    let differing = codes[0] ^ codes[codes.len() - 1];
    if differing == 0 {
        return codes.len() / 2;
    }
    let bit = 1u64 << (63 - differing.leading_zeros());
    codes.partition_point(|code| code & bit == 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every point is inside the boxes of all nodes that hold it, in double precision: else p at the
    /// nearest point of a box would not bound p at the point.
    #[test]
    fn boxes_hold_their_points() {
        // Far from the origin, where single precision resolves 6e-5.
        let at = |k: u32, turn: f64| 700.0 + (f64::from(k) * turn).fract();
        let points: Vec<DVec3> = (0..3000)
            .map(|k| {
                DVec3::new(at(k, 0.618_033_988_749_894_9), -at(k, 0.754_877_666), at(k, 0.569_840_29))
            })
            .collect();
        let tree = PointTree::new(&points);
        assert!(tree.nodes.len() > 300);
        let query = DVec3::new(699.5, -700.2, 701.3);
        for node in &tree.nodes {
            let (nearest, farthest) = node.distances(query);
            for index in node.first as usize..node.end as usize {
                let point = tree.point(index).to_array();
                for (x, (low, high)) in point.iter().zip(node.low.iter().zip(&node.high)) {
                    assert!(f64::from(*low) <= *x && *x <= f64::from(*high), "{x} {low} {high}");
                }
                let distance = (tree.point(index) - query).length();
                assert!(nearest <= distance && distance <= farthest, "{nearest} {distance} {farthest}");
            }
        }
    }
}
