//! A ray or a point against the eight boxes of a node of obvhs's tree, all at once.
//!
//! The arithmetic is that of `CwBvhNode::intersect_ray_basic`, product and sum rounded each, without its least time: eight
//! lanes of plain loops, which the compiler turns into vectors of whatever width the caller's target features allow. No lane
//! depends on the width, so that neither does the answer.

use obvhs::cwbvh::node::CwBvhNode;
use obvhs::ray::Ray as CullRay;

/// What the test needs of a ray.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slabs {
    origin: [f32; 3],
    inverse: [f32; 3],
}

impl Slabs {
    #[inline(always)]
    pub(super) fn new(ray: &CullRay) -> Slabs {
        Slabs { origin: ray.origin.to_array(), inverse: ray.inv_direction.to_array() }
    }

    /// The boxes that the ray is in at some time from 0 to `tau`, in the form of `CwBvhNode::intersect_ray`: a bit of the upper
    /// eight for an inner child in the order of visits, up to three of the lower 24 for the primitives of a leaf.
    #[inline(always)]
    pub(super) fn meet(&self, node: &CwBvhNode, octant: u32, tau: f32) -> u32 {
        let mut times = Times { enter: [0.0; 8], leave: [tau; 8] };
        // Axis by axis: of an array of references the compiler makes vectors of addresses.
        self.narrow(&mut times, node, 0, &node.child_min_x, &node.child_max_x);
        self.narrow(&mut times, node, 1, &node.child_min_y, &node.child_max_y);
        self.narrow(&mut times, node, 2, &node.child_min_z, &node.child_max_z);
        let (mut metas, mut met) = ([0; 8], [0; 8]);
        // In a loop of its own, or the compiler takes the bytes apart by shifts.
        for (lane, meta) in metas.iter_mut().enumerate() {
            *meta = u32::from(node.child_meta[lane]);
        }
        for lane in 0..8 {
            // As `CwBvhNode::get_child_and_index_bits`: an inner child has the bits 3 and 4, its place among the upper eight.
            let meta = metas[lane];
            let turned = if meta & (meta << 1) & 0x10 != 0 { octant } else { 0 };
            let bits = (meta >> 5) << ((meta ^ turned) & 31);
            met[lane] = if times.enter[lane] <= times.leave[lane] { bits } else { 0 };
        }
        met.into_iter().fold(0, |all, bits| all | bits)
    }

    /// Takes the planes across an axis into account.
    #[inline(always)]
    fn narrow(&self, times: &mut Times, node: &CwBvhNode, axis: usize, low: &[u8; 8], high: &[u8; 8]) {
        let step = step_of(node, axis) * self.inverse[axis];
        let start = (node.p[axis] - self.origin[axis]) * self.inverse[axis];
        let (low, high) = (widened(low), widened(high));
        for lane in 0..8 {
            // In vectors two more comparisons are cheaper than the choice of the nearer plane by the ray's direction.
            let (a, b) = (low[lane] * step + start, high[lane] * step + start);
            times.enter[lane] = later(earlier(a, b), times.enter[lane]);
            times.leave[lane] = earlier(later(a, b), times.leave[lane]);
        }
    }
}

/// When a ray enters and leaves eight boxes: of an empty box, and of one that it misses, after it has left.
struct Times {
    enter: [f32; 8],
    leave: [f32; 8],
}

#[inline(always)]
fn widened(bytes: &[u8; 8]) -> [f32; 8] {
    let mut wide = [0.0; 8];
    for lane in 0..8 {
        wide[lane] = f32::from(bytes[lane]);
    }
    wide
}

/// The squared distance of a point to each box of a node.
#[inline]
pub(super) fn distances2(node: &CwBvhNode, point: [f32; 3]) -> [f32; 8] {
    let mut away2 = [0.0; 8];
    for (axis, (low, high)) in planes(node).into_iter().enumerate() {
        let step = step_of(node, axis);
        let start = node.p[axis] - point[axis];
        for lane in 0..8 {
            let below = f32::from(low[lane]) * step + start;
            let above = -(f32::from(high[lane]) * step + start);
            let away = later(later(below, above), 0.0);
            away2[lane] += away * away;
        }
    }
    away2
}

/// Least and greatest coordinates of the boxes by axis, in steps from the node's corner.
#[inline(always)]
fn planes(node: &CwBvhNode) -> [([u8; 8], [u8; 8]); 3] {
    [
        (node.child_min_x, node.child_max_x),
        (node.child_min_y, node.child_max_y),
        (node.child_min_z, node.child_max_z),
    ]
}

/// The length of a step, whose exponent the node holds.
#[inline(always)]
fn step_of(node: &CwBvhNode, axis: usize) -> f32 {
    f32::from_bits(u32::from(node.e[axis]) << 23)
}

/// The later of two times; of equal ones the second. One instruction, which `f32::max` is not.
#[inline(always)]
fn later(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// The earlier of two times; of equal ones the second.
#[inline(always)]
fn earlier(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}
