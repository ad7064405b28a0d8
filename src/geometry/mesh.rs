//! Closed triangle meshes: f64 geometry behind an f32 tree.

use super::clearance::Clearance;
use super::near_surface::NearSurface;
use super::normals::Normals;
use super::tree::{BoxTree, Interest, MeshFrame, Visit};
use super::triangle::{self, Crossing, PackedTriangle, PreciseNormal, Sheared};
use super::{BoundingSphere, Cone, FaceId, Hit, Ray, Side, topology};
use crate::error::Result;
use crate::math::DVec3;

/// A closed, consistently oriented triangle mesh with outward normals. Several components may enclose
/// separate volumes, or cavities with normals into them.
#[derive(Clone, Debug)]
pub struct Mesh {
    vertices: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    /// Vertex normals that shading normals are interpolated from; none for flat shading.
    normals: Option<Normals>,
    bounds: BoundingSphere,
    tree: BoxTree,
    /// The triangles in the tree's order, with their corners.
    leaves: Vec<Leaf>,
    /// Where a triangle is among them.
    slots: Vec<u32>,
    clearance: Clearance,
    near_surface: NearSurface,
    /// The distance by which rounding may displace a point of the surface, mm: a point is a sum of three corners
    /// and, on a ray, of origin and flight, each rounded a few times at the size of its coordinates.
    slack: f64,
    around: Around,
}

/// The triangles at each vertex: those of vertex v are `triangles[starts[v]..starts[v + 1]]`.
#[derive(Clone, Debug)]
struct Around {
    starts: Vec<u32>,
    triangles: Vec<u32>,
}

impl Around {
    fn new(vertices: usize, triangles: &[[u32; 3]]) -> Around {
        let mut starts = vec![0; vertices + 1];
        triangles.iter().flatten().for_each(|&v| starts[v as usize + 1] += 1);
        (0..vertices).for_each(|v| starts[v + 1] += starts[v]);
        let mut next = starts.clone();
        let mut around = vec![0; 3 * triangles.len()];
        for (index, triangle) in triangles.iter().enumerate() {
            for &v in triangle {
                around[next[v as usize] as usize] = index as u32;
                next[v as usize] += 1;
            }
        }
        Around { starts, triangles: around }
    }

    fn of(&self, vertex: u32) -> &[u32] {
        let [from, to] = [vertex as usize, vertex as usize + 1].map(|i| self.starts[i] as usize);
        &self.triangles[from..to]
    }
}

#[derive(Clone, Debug)]
struct Leaf {
    packed: PackedTriangle,
    /// The corners' normals, if shading normals are interpolated.
    normals: [u32; 3],
    triangle: u32,
}

impl Leaf {
    /// The squared distance of a point, both in units of the frame.
    fn distance2(&self, frame: &MeshFrame, point: DVec3) -> f64 {
        let [a, b, c] = self.packed.corners();
        triangle::distance2(&[frame.place(a), frame.place(b), frame.place(c)], point)
    }
}

/// The nearest crossing so far. At equal distances (a hit on an edge) the smaller index wins, so that the
/// result does not depend on the order of visits.
struct Nearest {
    t: f64,
    triangle: u32,
    found: Option<(Crossing, usize)>,
}

impl Nearest {
    fn within(t_max: f64) -> Nearest {
        // The index after all triangles: a crossing at t_max itself comes before it.
        Nearest { t: t_max, triangle: u32::MAX, found: None }
    }

    /// Whether it takes the crossing.
    #[inline(always)]
    fn offer(&mut self, crossing: Crossing, triangle: u32, slot: usize) -> bool {
        let is_nearer = (crossing.t, triangle) < (self.t, self.triangle);
        if is_nearer {
            *self = Nearest { t: crossing.t, triangle, found: Some((crossing, slot)) };
        }
        is_nearer
    }
}

/// Looks for the nearest crossing.
struct Closest<'a> {
    mesh: &'a Mesh,
    sheared: Sheared,
    from: Option<FaceId>,
    nearest: Nearest,
}

impl Visit for Closest<'_> {
    #[inline(always)]
    fn visit(&mut self, slot: usize) -> Interest {
        match self.mesh.meet(&self.sheared, slot, self.from) {
            Some((crossing, triangle)) if self.nearest.offer(crossing, triangle, slot) => {
                Interest::Within(crossing.t)
            }
            _ => Interest::AsBefore,
        }
    }
}

/// Looks for any crossing.
struct Any<'a> {
    mesh: &'a Mesh,
    sheared: Sheared,
    from: Option<FaceId>,
    is_met: bool,
}

impl Visit for Any<'_> {
    #[inline(always)]
    fn visit(&mut self, slot: usize) -> Interest {
        self.is_met = self.mesh.meet(&self.sheared, slot, self.from).is_some();
        if self.is_met { Interest::Nowhere } else { Interest::AsBefore }
    }
}

impl Mesh {
    /// A mesh from vertices (mm) and triangles whose corners turn counter-clockwise seen from
    /// outside. `interpolated` gives it shading normals: `normals`, or else angle-weighted ones.
    ///
    /// # Errors
    /// Everything that keeps the mesh from bounding a body: no triangles, indices out of range, vertices
    /// that are not finite, triangles without area, edges and vertices where it is not a closed,
    /// consistently oriented 2-manifold, components that are inside out. Self-intersections are not detected.
    ///
    /// # Panics
    /// If `normals` has not as many triangles as the mesh.
    pub fn new(
        vertices: Vec<DVec3>,
        triangles: Vec<[u32; 3]>,
        normals: Option<Normals>,
        interpolated: bool,
    ) -> Result<Mesh> {
        topology::check(&vertices, &triangles)?;
        if let Some(normals) = &normals {
            assert_eq!(normals.corners.len(), triangles.len(), "normals for every triangle");
        }
        let normals = interpolated
            .then(|| normals.unwrap_or_else(|| Normals::angle_weighted(&vertices, &triangles)));
        let corners = |t: &[u32; 3]| t.map(|i| vertices[i as usize]);
        let extent = super::extent(vertices.iter().copied());
        let frame = MeshFrame::new(extent.0, extent.1);
        let boxes = triangles.iter().map(|t| super::extent(corners(t).into_iter()));
        let tree = BoxTree::new(frame, boxes)?;
        let leaves: Vec<Leaf> = tree
            .order()
            .iter()
            .map(|&triangle| {
                let index = triangle as usize;
                let normals = normals.as_ref().map_or([0; 3], |normals| normals.corners[index]);
                Leaf { packed: PackedTriangle::new(&corners(&triangles[index])), normals, triangle }
            })
            .collect();
        let mut slots = vec![0; leaves.len()];
        leaves.iter().enumerate().for_each(|(slot, leaf)| slots[leaf.triangle as usize] = slot as u32);
        // In units of the frame, whose squares neither overflow nor vanish.
        let mut last = 0;
        let distance = |point: DVec3| {
            let distance2;
            (last, distance2) = tree.nearest(point, last, |slot| leaves[slot].distance2(&frame, point));
            distance2.sqrt()
        };
        let slack = 16.0 * f64::EPSILON * extent.0.abs().max(extent.1.abs()).max_element();
        let placed = leaves.iter().map(|leaf| {
            let corners = leaf.packed.corners();
            // Not `map`, which is not inlined.
            let [a, b, c] = corners;
            let placed = [frame.place(a), frame.place(b), frame.place(c)];
            (placed, PreciseNormal::of(&corners, slack))
        });
        let (clearance, balls) = Clearance::new(&frame, extent, placed.clone(), distance);
        let near_surface = NearSurface::new(&frame, extent, placed, (&clearance, &balls));
        let bounds = bounding_sphere(extent, &vertices);
        let around = Around::new(vertices.len(), &triangles);
        Ok(Mesh {
            vertices,
            triangles,
            normals,
            bounds,
            tree,
            leaves,
            slots,
            clearance,
            near_surface,
            slack,
            around,
        })
    }

    /// The vertices, mm.
    pub fn vertices(&self) -> &[DVec3] {
        &self.vertices
    }

    /// Indices of the triangles' corners.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Vertex normals that shading normals are interpolated from; none for flat shading.
    pub fn normals(&self) -> Option<&Normals> {
        self.normals.as_ref()
    }

    /// Volume, mm^3, by the divergence theorem for the field x / 3: the sum of the signed tetrahedra that the triangles
    /// span with the middle of the bounding sphere, so that a body far from the origin loses no digits.
    pub fn volume(&self) -> f64 {
        let corners = |t: &[u32; 3]| t.map(|i| self.vertices[i as usize] - self.bounds.center);
        self.triangles.iter().map(corners).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum()
    }

    /// A sphere that holds all vertices.
    pub fn bounds(&self) -> BoundingSphere {
        self.bounds
    }

    /// See [`super::Shape::intersect`].
    pub fn intersect(&self, ray: &Ray, side: Side, from: Option<FaceId>, t_max: f64) -> Option<Hit> {
        if t_max < f64::INFINITY {
            if self.is_clear(ray.origin, ray.at(t_max)) {
                return None;
            }
            if side == Side::Inside {
                return self.end_of_unclear(ray, from, t_max);
            }
        }
        self.search(ray, side, from, t_max)
    }

    /// Whether there surely is no surface between two points.
    #[inline]
    pub(super) fn is_clear(&self, start: DVec3, end: DVec3) -> bool {
        let frame = &self.tree.frame;
        self.clearance.has_ball_around(frame.place(start), frame.place(end))
    }

    /// See [`super::Shape::end_of_unclear`]. What is known near the surface is asked here, not of every flight: most are clear.
    #[inline(never)]
    pub(super) fn end_of_unclear(&self, ray: &Ray, from: Option<FaceId>, t: f64) -> Option<Hit> {
        if self.is_clear_near_surface(ray, t) {
            return None;
        }
        self.search(ray, Side::Inside, from, t)
    }

    /// Whether a flight of length `t` inside surely meets nothing.
    #[inline]
    pub(super) fn is_clear_near_surface(&self, ray: &Ray, t: f64) -> bool {
        let frame = &self.tree.frame;
        self.near_surface.is_clear(frame.place(ray.origin), ray.dir, t * frame.scale)
    }

    /// A lower bound of the distance from a point to the surface, mm.
    pub(super) fn clearance(&self, point: DVec3) -> f64 {
        let frame = &self.tree.frame;
        self.clearance.at(frame.place(point)) / frame.scale
    }

    /// See [`super::Shape::clearance_within`]: the distance to the surface itself, or to that of a ball that has none inside.
    pub(super) fn clearance_within(&self, point: DVec3, cone: &Cone) -> f64 {
        let frame = &self.tree.frame;
        let place = frame.place(point);
        let along = match self.clearance.ball(place) {
            Some((center, radius)) if place.distance_squared(center) < radius * radius => {
                cone.through_sphere(radius, place - center)
            }
            _ => 0.0,
        };
        along.max(self.clearance.at(place)) / frame.scale
    }

    /// [`Mesh::intersect`] by the tree alone.
    pub(super) fn search(&self, ray: &Ray, side: Side, from: Option<FaceId>, t_max: f64) -> Option<Hit> {
        if let Some(hit) = from.and_then(|face| self.at_once(ray, side, face)) {
            return Some(hit);
        }
        let sheared = Sheared::new(ray, side);
        let mut visitor = Closest { mesh: self, sheared, from, nearest: Nearest::within(t_max) };
        self.tree.search(ray, t_max, &mut visitor);
        visitor.nearest.found.map(|(crossing, slot)| self.hit_leaf(crossing, slot))
    }

    /// See [`super::Shape::occluded`].
    pub fn occluded(&self, ray: &Ray, from: Option<FaceId>) -> bool {
        if from.is_some_and(|face| self.at_once(ray, Side::Outside, face).is_some()) {
            return true;
        }
        let sheared = Sheared::new(ray, Side::Outside);
        let mut visitor = Any { mesh: self, sheared, from, is_met: false };
        self.tree.search(ray, f64::INFINITY, &mut visitor);
        visitor.is_met
    }

    /// Whether the nearest crossing of a ray from the point leaves the body. A ray through an edge
    /// may see two crossings at one distance; then another direction decides.
    pub fn contains(&self, point: DVec3) -> bool {
        let distance = |ray: &Ray, side| self.search(ray, side, None, f64::INFINITY).map(|hit| hit.t);
        for [x, y, z] in [[0.36, 0.48, 0.8], [-0.48, 0.64, 0.6], [0.64, -0.6, 0.48], [-0.8, 0.36, 0.48]]
        {
            let ray = Ray { origin: point, dir: DVec3::new(x, y, z) };
            match (distance(&ray, Side::Inside), distance(&ray, Side::Outside)) {
                (None, _) => return false,
                (Some(_), None) => return true,
                (Some(leave), Some(enter)) if leave != enter => return leave < enter,
                _ => {}
            }
        }
        false
    }

    /// See [`super::Shape::building_bytes`].
    pub(super) fn building_bytes(&self) -> usize {
        200 * self.triangles.len() + self.near_surface.building_bytes()
    }

    /// Memory of the mesh on the heap, bytes.
    pub fn heap_bytes(&self) -> usize {
        size_of_val(&*self.vertices)
            + size_of_val(&*self.triangles)
            + self.normals.as_ref().map_or(0, Normals::heap_bytes)
            + self.tree.heap_bytes()
            + size_of_val(&*self.leaves)
            + size_of_val(&*self.slots)
            + self.clearance.heap_bytes()
            + self.near_surface.heap_bytes()
            + size_of_val(&*self.around.starts)
            + size_of_val(&*self.around.triangles)
    }

    /// The hit of a ray that starts on an edge of its face and points through an adjacent face.
    ///
    /// Seen along such a ray the edge is on the silhouette of the body, and rounding decides on which side of
    /// the silhouette the origin lies; outside of it the ray hits no triangle. So an origin that is on an edge
    /// to within rounding is treated as lying on every face there, and leaves (or enters) through the first face
    /// that the ray points through. Between nearly coplanar faces rounding reaches farther along the surface,
    /// hence the margin; the fraction of a surface near the origin that lies so near to an edge is below 1e-9
    /// with fewer than a hundred edges across.
    fn at_once(&self, ray: &Ray, side: Side, from: FaceId) -> Option<Hit> {
        let margin = 1e3 * self.slack;
        // The leaf has just been visited, the triangle's vertices have not.
        let Leaf { packed, .. } = &self.leaves[self.slots[from.0 as usize] as usize];
        if !triangle::is_on_edge(&packed.corners(), ray.origin, margin) {
            return None;
        }
        self.first_beside(ray, side, from, margin)
    }

    #[cold]
    fn first_beside(&self, ray: &Ray, side: Side, from: FaceId, margin: f64) -> Option<Hit> {
        let outward = if side == Side::Inside { 1.0 } else { -1.0 };
        let through = |&face: &u32| {
            let corners = self.corners(face);
            let weights = triangle::nearest(&corners, ray.origin);
            let [a, b, c] = corners;
            let point = a * weights[0] + b * weights[1] + c * weights[2];
            let heads_out = ray.dir.dot(triangle::normal(&corners)) * outward > 0.0;
            (heads_out && point.distance(ray.origin) <= margin).then_some((face, weights))
        };
        let beside = self.triangles[from.0 as usize].into_iter().flat_map(|v| self.around.of(v));
        let met = beside.filter(|face| **face != from.0).filter_map(through);
        let (face, weights) = met.min_by_key(|(face, _)| *face)?;
        Some(
            self.hit_leaf(
                Crossing { t: f64::MIN_POSITIVE, weights },
                self.slots[face as usize] as usize,
            ),
        )
    }

    #[inline]
    fn corners(&self, face: u32) -> [DVec3; 3] {
        // Not `map`, which is not inlined.
        let [a, b, c] = self.triangles[face as usize];
        [self.vertices[a as usize], self.vertices[b as usize], self.vertices[c as usize]]
    }

    #[inline(always)]
    fn meet(&self, ray: &Sheared, slot: usize, from: Option<FaceId>) -> Option<(Crossing, u32)> {
        let Leaf { packed, triangle, .. } = &self.leaves[slot];
        // Few are met at all: whether it is the ray's own is asked last.
        let crossing = ray.meet(packed, self.slack)?;
        (from != Some(FaceId(*triangle))).then_some((crossing, *triangle))
    }

    fn hit_leaf(&self, crossing: Crossing, slot: usize) -> Hit {
        self.hit(crossing, &self.leaves[slot])
    }

    fn hit(&self, Crossing { t, weights }: Crossing, leaf: &Leaf) -> Hit {
        let Leaf { packed, normals, triangle } = leaf;
        let corners = packed.corners();
        let [a, b, c] = corners;
        let point = a * weights[0] + b * weights[1] + c * weights[2];
        let normal = triangle::normal(&corners);
        let smooth = self.normals.as_ref().and_then(|n| n.between(*normals, weights));
        let shading_normal = smooth.unwrap_or(normal);
        Hit { t, point, normal, shading_normal, face: FaceId(*triangle) }
    }
}

/// About the middle of the box; the radius is rounded up so that it holds every vertex.
fn bounding_sphere((min, max): (DVec3, DVec3), vertices: &[DVec3]) -> BoundingSphere {
    let center = (min + max) * 0.5;
    let reach = vertices.iter().map(|v| v.distance(center)).fold(0.0, f64::max);
    BoundingSphere { center, radius: reach * (1.0 + 4.0 * f64::EPSILON) }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{Uniform, bodies, creature, direction, inward};
    use super::super::{Shape, procedural};
    use super::*;

    /// Rays against every triangle, over all bodies.
    const BRUTE_FORCE_RAYS: usize = 50_000;

    impl Mesh {
        pub(in super::super) fn near_surface(&self) -> (&NearSurface, &MeshFrame) {
            (&self.near_surface, &self.tree.frame)
        }

        /// [`Mesh::search`] without the tree.
        fn brute_force(&self, ray: &Ray, side: Side, from: Option<FaceId>, t_max: f64) -> Option<Hit> {
            if let Some(hit) = from.and_then(|face| self.at_once(ray, side, face)) {
                return Some(hit);
            }
            let sheared = Sheared::new(ray, side);
            let mut nearest = Nearest::within(t_max);
            for slot in 0..self.leaves.len() {
                if let Some((crossing, triangle)) = self.meet(&sheared, slot, from) {
                    nearest.offer(crossing, triangle, slot);
                }
            }
            nearest.found.map(|(crossing, slot)| self.hit_leaf(crossing, slot))
        }

        fn some_corners(&self, u: &mut Uniform) -> [DVec3; 3] {
            self.leaves[(u.next() * self.leaves.len() as f64) as usize].packed.corners()
        }
    }

    /// Origins in and around the body, from afar, and 1e-9 off the surface.
    fn some_origin(mesh: &Mesh, u: &mut Uniform) -> DVec3 {
        let BoundingSphere { center, radius } = mesh.bounds();
        match (u.next() * 4.0) as u32 {
            0 => center + direction(u) * (1e6 * radius),
            1 => {
                let [a, b, c] = mesh.some_corners(u);
                let sign = if u.next() < 0.5 { 1e-9 } else { -1e-9 };
                a * 0.5 + b * 0.3 + c * 0.2 + triangle::normal(&[a, b, c]) * (sign * radius)
            }
            _ => center + direction(u) * (u.next() * 1.5 * radius),
        }
    }

    /// Random directions, signed axes with signed zeros, and aims at points of triangles, edges and
    /// vertices.
    fn some_dir(mesh: &Mesh, origin: DVec3, u: &mut Uniform) -> DVec3 {
        let [a, b, c] = mesh.some_corners(u);
        let s = u.next();
        match (u.next() * 5.0) as u32 {
            0 => direction(u),
            1 => {
                let mut dir = DVec3::ZERO.copysign(direction(u));
                let axis = (s * 3.0) as usize;
                dir[axis] = 1.0f64.copysign(dir[axis]);
                dir
            }
            2 => (a * 0.2 + b * s * 0.8 + c * (0.8 - s * 0.8) - origin).normalize(),
            3 => (a + (b - a) * s - origin).normalize(),
            _ => (a - origin).normalize(),
        }
    }

    #[test]
    fn the_tree_finds_what_all_triangles_tell() {
        let mut u = Uniform::named("the_tree_finds_what_all_triangles_tell");
        let is_small =
            |b: &(_, Shape)| matches!(&b.1, Shape::Mesh(mesh) if mesh.triangles().len() < 6000);
        let bodies: Vec<_> = bodies().into_iter().filter(is_small).collect();
        assert!(bodies.len() >= 5);
        let mut hits = 0;
        for (name, shape) in &bodies {
            let Shape::Mesh(mesh) = shape else { unreachable!("bodies are meshes") };
            for _ in 0..BRUTE_FORCE_RAYS / bodies.len() {
                let origin = some_origin(mesh, &mut u);
                let ray = Ray { origin, dir: some_dir(mesh, origin, &mut u) };
                let side = if u.next() < 0.5 { Side::Inside } else { Side::Outside };
                let all = mesh.brute_force(&ray, side, None, f64::INFINITY);
                assert_eq!(mesh.intersect(&ray, side, None, f64::INFINITY), all, "{name} {ray:?}");
                if side == Side::Outside {
                    assert_eq!(shape.occluded(&ray, None), all.is_some(), "{name} {ray:?}");
                }
                let Some(hit) = all else { continue };
                hits += 1;
                // A flight that ends at the hit finds it; one that ends before does not.
                assert_eq!(mesh.intersect(&ray, side, None, hit.t), all, "{name} {ray:?}");
                let before = hit.t.next_down();
                assert_eq!(mesh.intersect(&ray, side, None, before), None, "{name} {ray:?}");
                // And on from there.
                let on = Ray { origin: hit.point, dir: inward(hit.normal, &mut u) };
                let next = mesh.intersect(&on, Side::Inside, Some(hit.face), f64::INFINITY);
                if hits % 8 == 0 {
                    let all = mesh.brute_force(&on, Side::Inside, Some(hit.face), f64::INFINITY);
                    assert_eq!(next, all, "{name} {on:?}");
                }
                // A ray does not hit the face that it starts on.
                let beyond = mesh.intersect(&ray, side, Some(hit.face), f64::INFINITY);
                assert!(beyond.is_none_or(|b| b.face != hit.face && b.t >= hit.t), "{name} {ray:?}");
            }
        }
        assert!(hits > BRUTE_FORCE_RAYS / 3, "{hits}");
    }

    /// A walk that meets the surface at an edge continues from a point that rounding may have put
    /// outside of the neighbouring face: it leaves through that face at once, and is not lost.
    #[test]
    fn rays_from_edges_and_corners_leave() {
        let mut u = Uniform::named("rays_from_edges_and_corners_leave");
        for (name, shape) in bodies() {
            let Shape::Mesh(mesh) = &shape else { unreachable!("bodies are meshes") };
            for i in 0..40_000 {
                let slot = (u.next() * mesh.leaves.len() as f64) as usize;
                let Leaf { ref packed, triangle, .. } = mesh.leaves[slot];
                let [a, b, c] = packed.corners();
                // On an edge, within some roundings of it, or at a corner.
                let off = [0.0, 1e-17, 1e-16, 1e-15][i % 4];
                let s = if i % 8 < 4 { u.next() * (1.0 - off) } else { 0.0 };
                let origin = a * (1.0 - s - off) + b * s + c * off;
                let ray = Ray { origin, dir: inward(triangle::normal(&[a, b, c]), &mut u) };
                let hit = mesh.intersect(&ray, Side::Inside, Some(FaceId(triangle)), f64::INFINITY);
                assert!(hit.is_some_and(|hit| hit.t > 0.0), "{name} {i} {ray:?}");
            }
        }
    }

    #[test]
    fn the_nearest_triangle_is_that_of_all() {
        let mut u = Uniform::named("the_nearest_triangle_is_that_of_all");
        for (name, shape) in bodies() {
            let Shape::Mesh(mesh) = &shape else { unreachable!("bodies are meshes") };
            let sphere = mesh.bounds();
            for _ in 0..300 {
                let point = sphere.center + direction(&mut u) * (1.5 * u.next() * sphere.radius);
                let frame = &mesh.tree.frame;
                let place = frame.place(point);
                let distance2 = |slot: usize| mesh.leaves[slot].distance2(frame, place);
                let first = (u.next() * mesh.leaves.len() as f64) as usize;
                let (slot, found) = mesh.tree.nearest(place, first, distance2);
                let all = (0..mesh.leaves.len()).map(distance2).fold(f64::INFINITY, f64::min);
                assert_eq!((found, distance2(slot)), (all, all), "{name}: {point}");
            }
        }
    }

    /// A wrongly culled triangle is most likely in a thin wall of triangles that match the last bit of the padding: a
    /// ray through a plane of axis-parallel triangles, its components near and below 2^-23.
    #[test]
    fn nearly_axis_parallel_rays_are_not_culled() {
        let plate = procedural::drilled_box(DVec3::new(1.0, 1.0, 1e-7), [8, 8], 0.5).expect("closed");
        let mut u = Uniform::named("nearly_axis_parallel_rays_are_not_culled");
        for i in 0..100_000 {
            let tilt = 2.0f64.powi(-20 - (i % 8)) * (u.next() - 0.5);
            let dir = DVec3::new(1.0, tilt, -tilt * 1e-3).normalize();
            let corner = plate.some_corners(&mut u)[0];
            for origin in [corner - dir * u.next(), DVec3::new(-0.6, corner.y, 4e-8)] {
                let ray = Ray { origin, dir };
                for side in [Side::Inside, Side::Outside] {
                    let found = plate.search(&ray, side, None, f64::INFINITY);
                    if i % 50 == 0 {
                        let all = plate.brute_force(&ray, side, None, f64::INFINITY);
                        assert_eq!(found, all, "{ray:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn scaling_by_powers_of_two_scales_every_bit() {
        let original = creature();
        let radius = original.bounds().radius;
        for k in -20..20 {
            let scale = 2.0f64.powi(k);
            let vertices = original.vertices().iter().map(|&v| v * scale).collect();
            let mesh = Mesh::new(vertices, original.triangles().to_vec(), None, true);
            let mesh = mesh.expect("closed");
            let mut u = Uniform::named("scaling_by_powers_of_two_scales_every_bit");
            for _ in 0..1000 {
                let origin = some_origin(&original, &mut u);
                let ray = Ray { origin, dir: some_dir(&original, origin, &mut u) };
                let scaled = Ray { origin: origin * scale, dir: ray.dir };
                let t_max = if u.next() < 0.5 { f64::INFINITY } else { radius * u.next() };
                for side in [Side::Inside, Side::Outside] {
                    let expected = original.intersect(&ray, side, None, t_max).map(|hit| Hit {
                        t: hit.t * scale,
                        point: hit.point * scale,
                        ..hit
                    });
                    let found = mesh.intersect(&scaled, side, None, t_max * scale);
                    assert_eq!(found, expected, "2^{k} {ray:?}");
                }
                assert_eq!(mesh.contains(scaled.origin), original.contains(origin));
            }
        }
    }

    #[test]
    fn inside_is_between_the_spheres() {
        let mesh = procedural::cavity_sphere(5.0, 2.0, 4, false).expect("closed");
        let mut u = Uniform::named("inside_is_between_the_spheres");
        for _ in 0..20_000 {
            let r = 6.0 * u.next();
            // The polyhedra lie a little below their spheres.
            if (1.97..2.0).contains(&r) || (4.9..5.0).contains(&r) {
                continue;
            }
            assert_eq!(mesh.contains(direction(&mut u) * r), (2.0..4.95).contains(&r), "{r}");
        }
    }

    #[test]
    fn shading_normals_are_interpolated_only_if_asked() {
        let mut u = Uniform::named("shading_normals_are_interpolated_only_if_asked");
        for interpolated in [false, true] {
            let mesh = procedural::icosphere(1.0, 3, interpolated).expect("closed");
            for _ in 0..10_000 {
                let ray = Ray { origin: DVec3::ZERO, dir: direction(&mut u) };
                let hit = mesh.intersect(&ray, Side::Inside, None, f64::INFINITY).expect("inside");
                // Interpolated ones follow the sphere far closer than the facets (0.07 rad) do.
                let smooth = hit.shading_normal.distance(hit.point.normalize()) < 0.005;
                assert!(if interpolated { smooth } else { hit.shading_normal == hit.normal });
            }
        }
    }
}
