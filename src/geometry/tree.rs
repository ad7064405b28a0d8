//! The interface between f32 culling and f64 intersection. Only this module and `node` use `obvhs`.
//!
//! The tree only rules triangles out; every number a result sees is computed in f64 by the caller.
//! Culling is conservative, so results do not depend on the tree.
//!
//! # Frame
//!
//! The tree lives in units where the mesh's box is centred and its longest side is in [1024, 2048).
//! The scale is a power of two: scaling a scene by 2^k gives the same tree and the same bits.
//!
//! # Behind the origin
//!
//! The f32 ray starts [`BEHIND`] = 2^-6 before the true one, so that rounding of the start puts no hit before it, and
//! `tau = scale t - skip` counts from there. A ray from afar skips to the bounding sphere, so all f32 coordinates stay
//! below 2^11.
//!
//! # Padding
//!
//! The node test computes the time of the plane `p + q e` as `q (e inv) + (p - o) inv`. Let u = 2^-24
//! be f32's rounding. Per axis, in units of length (a time error times the direction's component):
//!
//! | source | error | bound |
//! |---|---|---|
//! | rounding of the origin | u abs(o) | 1.1e-4 |
//! | direction, inverse, products | 5 u (q e + abs(p - o)), q e <= 2100, abs(p - o) <= 2810 | 1.5e-3 |
//! | node corner and 8-bit steps from rounded differences | 2 u 2048 | 2.5e-4 |
//! | step exponent from a rounded log2, box cut at 255 steps | 2048 3e-7 | 6e-4 |
//! | `safe_inverse` takes components below 2^-23 as 2^-23 | 2^-22 tau, tau <= 3600 | 8.6e-4 |
//!
//! Their sum, 3.4e-3, is less than half of [`PAD`] = 2^-7. A box padded by that much is entered, in
//! f32, no later than the ray truly meets the triangle in it; and the bound on tau that the tree
//! holds against it is rounded up.

use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh;
use obvhs::ray::Ray as CullRay;

use super::Ray;
use super::node::{Slabs, distances2};
use crate::error::{Error, Result};
use crate::math::{DVec3, Vec3, Vectorized, vectorized};

/// Start of the f32 ray before the true origin, units of the frame.
const BEHIND: f64 = 0.015625;

/// Growth of every box on every side, units of the frame.
pub(super) const PAD: f64 = 0.0078125;

/// Levels that a search can hold.
const MAX_DEPTH: usize = 32;

/// The least of the bits by which a node states its inner children that a ray meets; those below are primitives.
const INNER: u32 = 1 << 24;

/// Map from mm to the units of the mesh's tree.
#[derive(Clone, Copy, Debug)]
pub(super) struct MeshFrame {
    center: DVec3,
    /// Units per mm, a power of two.
    pub scale: f64,
    /// Radius of a sphere about the centre that holds the mesh, units.
    radius: f64,
}

impl MeshFrame {
    /// The frame of an axis-aligned box, mm. Its longest side must be a normal number.
    pub(super) fn new(min: DVec3, max: DVec3) -> MeshFrame {
        let size = max - min;
        let exponent = (size.max_element().to_bits() >> 52) as i64 - 1023;
        let scale = f64::from_bits(((1023 + 10 - exponent) as u64) << 52);
        MeshFrame { center: (min + max) * 0.5, scale, radius: (size * (0.5 * scale)).length() }
    }

    /// A point in units of the frame.
    pub(super) fn place(&self, point: DVec3) -> DVec3 {
        (point - self.center) * self.scale
    }

    /// The f32 ray and its skip; none if it passes beside the mesh or stops before it.
    #[inline(always)]
    fn cull_ray(&self, ray: &Ray, t_max: f64) -> Option<(CullRay, f64)> {
        let origin = self.place(ray.origin);
        let skip = self.distance(origin, ray.dir)? - BEHIND;
        let tau_max = round_up(self.scale * t_max - skip);
        if tau_max < 0.0 {
            return None;
        }
        let start = (origin + ray.dir * skip).as_vec3();
        // Adding 0 turns -0 into +0: obvhs swaps the planes of an axis by `dir < 0` but takes the
        // sign of the inverse from the sign bit, and would cull everything.
        let dir = ray.dir.as_vec3() + Vec3::ZERO;
        Some((CullRay::new(start.into(), dir.into(), 0.0, tau_max), skip))
    }

    /// Distance to the bounding sphere, 0 inside; none if it is missed or lies behind. The sphere
    /// is grown by the padding and by the rounding of coordinates of the origin's size.
    #[inline(always)]
    fn distance(&self, origin: DVec3, dir: DVec3) -> Option<f64> {
        let away2 = origin.length_squared();
        if away2 <= self.radius * self.radius {
            return Some(0.0);
        }
        let radius = self.radius + PAD + 8.0 * f64::EPSILON * away2.sqrt();
        let b = origin.dot(dir);
        let miss = (origin - dir * b).length();
        let half_chord2 = (radius - miss) * (radius + miss);
        let half_chord = if half_chord2 >= 0.0 { half_chord2.sqrt() } else { return None };
        (half_chord >= b).then(|| (-b - half_chord).max(0.0))
    }
}

/// Number of levels of nodes.
fn depth(bvh: &CwBvh) -> usize {
    let mut deepest = 0;
    let mut open = vec![(0, 1)];
    while let Some((index, level)) = open.pop() {
        let node = &bvh.nodes[index as usize];
        deepest = deepest.max(level);
        let children = node.child_base_idx..node.child_base_idx + node.imask.count_ones();
        open.extend(children.map(|child| (child, level + 1)));
    }
    deepest
}

/// An f32 above the number.
fn round_up(x: f64) -> f32 {
    (x as f32).next_up()
}

/// The tree over the boxes of a mesh's triangles.
#[derive(Clone, Debug)]
pub(super) struct BoxTree {
    /// The units that the tree lives in.
    pub frame: MeshFrame,
    bvh: CwBvh,
}

impl BoxTree {
    /// Builds the tree over boxes (least and greatest corner, mm).
    ///
    /// # Errors
    /// If it gets too deep to be traversed.
    pub(super) fn new(frame: MeshFrame, boxes: impl Iterator<Item = (DVec3, DVec3)>) -> Result<BoxTree> {
        let corner = |point: DVec3, pad: f64| (frame.place(point) + pad).as_vec3().into();
        let boxes: Vec<Aabb> =
            boxes.map(|(min, max)| Aabb::new(corner(min, -PAD), corner(max, PAD))).collect();
        let bvh = build_cwbvh(&boxes, BvhBuildParams::medium_build(), &mut Default::default());
        let depth = depth(&bvh);
        if depth > MAX_DEPTH {
            let rule = format!("the mesh needs a search tree of {depth} levels, of {MAX_DEPTH} at most");
            return Err(Error::input_help(rule, "remesh it: its triangles differ too much in size"));
        }
        Ok(BoxTree { frame, bvh })
    }

    /// Slot -> box: the order in which a visit finds neighbours close in memory.
    pub(super) fn order(&self) -> &[u32] {
        &self.bvh.primitive_indices
    }

    /// Visits every slot whose box the ray may meet within `t_max`, nearer nodes first, until the visitor has enough.
    pub(super) fn search(&self, ray: &Ray, t_max: f64, visitor: &mut impl Visit) {
        vectorized(BoxSearch { tree: self, ray, t_max, visitor });
    }

    /// The nearest slot to a point, in units of the frame, and its squared distance there. `first` is one that may be near.
    pub(super) fn nearest(
        &self,
        point: DVec3,
        first: usize,
        mut distance2: impl FnMut(usize) -> f64,
    ) -> (usize, f64) {
        let place = point.as_vec3().to_array();
        let mut nearest = (first, distance2(first));
        let mut open = vec![(0.0, 0)];
        while let Some((away2, index)) = open.pop() {
            // The padding of boxes is more than the rounding of the distance to them.
            if f64::from(away2) > nearest.1 {
                continue;
            }
            let node = &self.bvh.nodes[index as usize];
            let below = open.len();
            for (child, away2) in distances2(node, place).into_iter().enumerate() {
                if f64::from(away2) > nearest.1 || node.is_child_empty(child) {
                    continue;
                }
                if node.is_leaf(child) {
                    let (start, count) = node.child_primitives(child);
                    for slot in start as usize..(start + count) as usize {
                        let slot = (slot, distance2(slot));
                        nearest = if slot.1 < nearest.1 { slot } else { nearest };
                    }
                } else {
                    open.push((away2, node.child_node_index(child)));
                }
            }
            // The nearest last, to be next.
            open[below..].sort_unstable_by(|a: &(f32, u32), b| b.0.total_cmp(&a.0));
        }
        nearest
    }

    /// Memory behind the tree, bytes.
    pub(super) fn heap_bytes(&self) -> usize {
        size_of_val(&*self.bvh.nodes) + size_of_val(&*self.bvh.primitive_indices)
    }
}

/// What a search does with the slots that it comes by. Implementations are `inline(always)`, or they are not compiled for the
/// vector instructions that the search is compiled for.
pub(super) trait Visit {
    /// Looks at a slot.
    fn visit(&mut self, slot: usize) -> Interest;
}

/// Where a search goes on after a visit.
pub(super) enum Interest {
    /// Where it did before.
    AsBefore,
    /// Up to this `t`.
    Within(f64),
    /// Nowhere: it ends.
    Nowhere,
}

/// A search, for the vector instructions of the machine.
struct BoxSearch<'a, V> {
    tree: &'a BoxTree,
    ray: &'a Ray,
    t_max: f64,
    visitor: &'a mut V,
}

impl<V: Visit> Vectorized for BoxSearch<'_, V> {
    type Output = ();

    /// The loop of `obvhs::traverse!`, written out: the state of the macro stays in memory, as it holds the stack.
    #[inline(always)]
    fn call(self) {
        let BoxSearch { tree: BoxTree { frame, bvh }, ray, t_max, visitor } = self;
        let Some((ray, skip)) = frame.cull_ray(ray, t_max) else { return };
        let slabs = Slabs::new(&ray);
        let octant = bvh.new_traversal(ray.direction).oct_inv4 & 7;
        let nodes = &bvh.nodes[..];
        let mut tau = ray.tmax;
        // Children of a node that are still to be visited: index of the first of its inner ones; in the upper byte, by the
        // order of visits, those of them that the ray meets; in the lower byte, by slot, those that there are.
        let (mut first, mut children) = (0, 1_u32 << 31);
        let (mut open, mut depth) = ([[0; 2]; MAX_DEPTH], 0);
        loop {
            let place = 31 - children.leading_zeros();
            let others = children & !(1 << place);
            if others >= INNER {
                open[depth] = [first, others];
                depth += 1;
            }
            let slot = (place - 24) ^ octant;
            let before = (children & !(u32::MAX << slot)).count_ones();
            let node = &nodes[(first + before) as usize];
            let met = slabs.meet(node, octant, tau);
            let mut primitives = met & (INNER - 1);
            while primitives != 0 {
                let primitive = 31 - primitives.leading_zeros();
                primitives &= !(1 << primitive);
                match visitor.visit((node.primitive_base_idx + primitive) as usize) {
                    Interest::AsBefore => {}
                    Interest::Within(t) => tau = tau.min(round_up(frame.scale * t - skip)),
                    Interest::Nowhere => return,
                }
            }
            (first, children) = (node.child_base_idx, met & !(INNER - 1) | u32::from(node.imask));
            if children < INNER {
                if depth == 0 {
                    return;
                }
                depth -= 1;
                [first, children] = open[depth];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depth_counts_levels() {
        let row = |count: usize| {
            let boxes = (0..count).map(|i| (DVec3::splat(i as f64), DVec3::splat(i as f64 + 1.0)));
            let frame = MeshFrame::new(DVec3::ZERO, DVec3::splat(count as f64));
            depth(&BoxTree::new(frame, boxes).expect("shallow").bvh)
        };
        assert_eq!(row(1), 1);
        // Eight children of three boxes at most.
        assert!((4..=12).contains(&row(4096)), "{}", row(4096));
    }

    #[test]
    fn the_longest_side_is_1024_to_2048_units() {
        for side in [1e-60, 0.3, 1.0, 1.0f64.next_down(), 7.0, 1e60] {
            let frame = MeshFrame::new(DVec3::ZERO, DVec3::new(0.5 * side, side, 0.0));
            let length = side * frame.scale;
            assert!((1024.0..2048.0).contains(&length), "{side} {length}");
            assert_eq!(frame.scale.to_bits() << 12, 0, "a power of two");
        }
    }
}
