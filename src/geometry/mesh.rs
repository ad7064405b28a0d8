//! Closed triangle meshes: f64 geometry behind an f32 tree.

use super::clearance::Clearance;
use super::normals::Normals;
use super::tree::{Frame, Tree};
use super::triangle::{self, Crossing, Sheared};
use super::{BoundingSphere, FaceId, Hit, Ray, Side, topology};
use crate::error::Result;
use crate::math::DVec3;

/// A closed, consistently oriented triangle mesh with outward normals. Several components may
/// enclose volumes of their own, or cavities with normals into them.
#[derive(Clone, Debug)]
pub struct Mesh {
    vertices: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    /// What shading normals are interpolated from; none for flat shading.
    normals: Option<Normals>,
    bounds: BoundingSphere,
    tree: Tree,
    /// The triangles in the tree's order, their corners at hand.
    leaves: Vec<Leaf>,
    clearance: Clearance,
}

#[derive(Clone, Debug)]
struct Leaf {
    corners: [DVec3; 3],
    triangle: u32,
}

/// The nearest crossing so far. Equal distances (a hit on an edge) go to the smaller index, so that
/// the order of visits does not show.
struct Nearest {
    t: f64,
    triangle: u32,
    found: Option<(Crossing, usize)>,
}

impl Nearest {
    fn offer(&mut self, crossing: Crossing, triangle: u32, slot: usize) {
        if (crossing.t, triangle) < (self.t, self.triangle) {
            *self = Nearest { t: crossing.t, triangle, found: Some((crossing, slot)) };
        }
    }
}

impl Mesh {
    /// A mesh from vertices (mm) and triangles whose corners turn counter-clockwise seen from
    /// outside. `interpolated` gives it shading normals: `normals`, or else angle-weighted ones.
    ///
    /// # Errors
    /// Everything that keeps it from bounding a body: no triangles, indices out of range, vertices
    /// that are not finite, triangles without area, edges and vertices where it is not a closed,
    /// consistently oriented 2-manifold, components that are inside out.
    pub fn new(
        vertices: Vec<DVec3>,
        triangles: Vec<[u32; 3]>,
        normals: Option<Normals>,
        interpolated: bool,
    ) -> Result<Mesh> {
        topology::check(&vertices, &triangles)?;
        let normals = interpolated
            .then(|| normals.unwrap_or_else(|| Normals::angle_weighted(&vertices, &triangles)));
        let corners = |t: &[u32; 3]| t.map(|i| vertices[i as usize]);
        let extent = extent(vertices.iter().copied());
        let frame = Frame::new(extent.0, extent.1);
        let tree = Tree::new(frame, triangles.iter().map(|t| self::extent(corners(t).into_iter())));
        let leaves: Vec<Leaf> = tree
            .order()
            .iter()
            .map(|&i| Leaf { corners: corners(&triangles[i as usize]), triangle: i })
            .collect();
        let clearance = Clearance::new(&frame, extent, leaves.iter().map(|leaf| &leaf.corners));
        let bounds = bounding_sphere(extent, &vertices);
        Ok(Mesh { vertices, triangles, normals, bounds, tree, leaves, clearance })
    }

    /// The vertices, mm.
    pub fn vertices(&self) -> &[DVec3] {
        &self.vertices
    }

    /// Indices of the triangles' corners.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// What shading normals are interpolated from; none for flat shading.
    pub fn normals(&self) -> Option<&Normals> {
        self.normals.as_ref()
    }

    /// A sphere that holds all vertices.
    pub fn bounds(&self) -> BoundingSphere {
        self.bounds
    }

    /// See [`super::Shape::intersect`].
    pub fn intersect(&self, ray: &Ray, side: Side, from: Option<FaceId>, t_max: f64) -> Option<Hit> {
        if t_max <= self.clearance(ray.origin) {
            return None;
        }
        self.search(ray, side, from, t_max)
    }

    /// A lower bound of the distance from a point to the surface, mm.
    pub(super) fn clearance(&self, point: DVec3) -> f64 {
        let frame = &self.tree.frame;
        self.clearance.at(frame.place(point)) / frame.scale
    }

    /// [`Mesh::intersect`] by the tree alone.
    pub(super) fn search(&self, ray: &Ray, side: Side, from: Option<FaceId>, t_max: f64) -> Option<Hit> {
        let sheared = Sheared::new(ray, side);
        // The index after all triangles: a crossing at t_max itself comes before it.
        let mut nearest = Nearest { t: t_max, triangle: u32::MAX, found: None };
        self.tree.closest(ray, t_max, |slot| {
            if let Some((crossing, triangle)) = self.meet(&sheared, slot, from) {
                nearest.offer(crossing, triangle, slot);
            }
            nearest.t
        });
        nearest.found.map(|(crossing, slot)| self.hit(crossing, slot))
    }

    /// See [`super::Shape::occluded`].
    pub fn occluded(&self, ray: &Ray, from: Option<FaceId>) -> bool {
        let sheared = Sheared::new(ray, Side::Outside);
        self.tree.any(ray, |slot| self.meet(&sheared, slot, from).is_some())
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

    /// Memory behind the mesh, bytes.
    pub fn heap_bytes(&self) -> usize {
        size_of_val(&*self.vertices)
            + size_of_val(&*self.triangles)
            + self.normals.as_ref().map_or(0, Normals::heap_bytes)
            + self.tree.heap_bytes()
            + size_of_val(&*self.leaves)
            + self.clearance.heap_bytes()
    }

    #[inline]
    fn meet(&self, ray: &Sheared, slot: usize, from: Option<FaceId>) -> Option<(Crossing, u32)> {
        let Leaf { corners, triangle } = &self.leaves[slot];
        if from == Some(FaceId(*triangle)) {
            return None;
        }
        ray.meet(corners).map(|crossing| (crossing, *triangle))
    }

    fn hit(&self, Crossing { t, weights }: Crossing, slot: usize) -> Hit {
        let Leaf { corners, triangle } = &self.leaves[slot];
        let [a, b, c] = *corners;
        let point = a * weights[0] + b * weights[1] + c * weights[2];
        let normal = triangle::normal(corners);
        let smooth = self.normals.as_ref().and_then(|n| n.at(*triangle as usize, weights));
        let shading_normal = smooth.unwrap_or(normal);
        Hit { t, point, normal, shading_normal, face: FaceId(*triangle) }
    }
}

/// Least and greatest coordinates of points.
pub fn extent(points: impl Iterator<Item = DVec3>) -> (DVec3, DVec3) {
    let empty = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    points.fold(empty, |(min, max), point| (min.min(point), max.max(point)))
}

/// About the middle of the box; the radius is rounded up so that it holds every vertex.
fn bounding_sphere((min, max): (DVec3, DVec3), vertices: &[DVec3]) -> BoundingSphere {
    let center = (min + max) * 0.5;
    let reach = vertices.iter().map(|v| v.distance(center)).fold(0.0, f64::max);
    BoundingSphere { center, radius: reach * (1.0 + 4.0 * f64::EPSILON) }
}
