//! Conditions for triangles to be the boundary of a body: closed, consistently oriented, a 2-manifold,
//! and not inside out.

use super::triangle::{PackedTriangle, Sheared};
use super::{Ray, Side, extent};
use crate::error::{Diagnostic, Error, Result};
use crate::math::DVec3;

/// How many places a finding names.
const NAMED: usize = 3;

/// Checks everything that [`super::Mesh::new`] promises.
///
/// # Errors
/// Findings with counts and the first few positions. Later checks need what earlier ones assure, so
/// they run in stages: data, then edges and vertices, then orientation of whole components.
pub(super) fn check(vertices: &[DVec3], triangles: &[[u32; 3]]) -> Result<()> {
    let mesh = TriangleSoup { vertices, triangles };
    report(mesh.data())?;
    let edges = mesh.edges();
    report(mesh.edge_findings(&edges))?;
    report(mesh.fans(&edges))?;
    report(mesh.inside_out(&edges))
}

fn report(findings: Vec<Diagnostic>) -> Result<()> {
    if findings.is_empty() { Ok(()) } else { Err(Error::Input(findings)) }
}

struct TriangleSoup<'a> {
    vertices: &'a [DVec3],
    triangles: &'a [[u32; 3]],
}

/// A triangle's side as it runs around it.
#[derive(Clone, Copy)]
struct Edge {
    from: u32,
    to: u32,
    triangle: u32,
}

impl Edge {
    /// The same for both directions.
    fn key(&self) -> (u32, u32) {
        (self.from.min(self.to), self.from.max(self.to))
    }
}

impl TriangleSoup<'_> {
    fn corners(&self, triangle: usize) -> [DVec3; 3] {
        self.triangles[triangle].map(|i| self.vertices[i as usize])
    }

    fn data(&self) -> Vec<Diagnostic> {
        if self.triangles.is_empty() {
            return vec![finding("the mesh has no triangles", "it needs faces that close a volume")];
        }
        let count = self.vertices.len();
        let beyond = |t: &&[u32; 3]| t.iter().any(|&i| i as usize >= count);
        if let Some(triangle) = self.triangles.iter().find(beyond) {
            let rule = format!("triangle {triangle:?} points beyond the mesh's {count} vertices");
            return vec![finding(rule, "export the mesh again")];
        }
        let wild: Vec<String> = (self.vertices.iter().enumerate())
            .filter(|(_, v)| !v.is_finite())
            .map(|(i, v)| format!("vertex {i}, {}", place(*v)))
            .collect();
        if !wild.is_empty() {
            return vec![finding(
                counted(&wild, "vertex is not finite", "vertices are not finite"),
                "remove NaN and infinite coordinates",
            )];
        }
        let (min, max) = extent(self.vertices.iter().copied());
        let side = (max - min).max_element();
        if !(1e-60..=1e60).contains(&side) {
            let rule = format!("the mesh's longest side is {side:e} mm");
            return vec![finding(rule, "scale it into 1e-60 to 1e60 mm")];
        }
        let flat: Vec<String> = (0..self.triangles.len())
            .filter(|&i| has_no_area(self.corners(i)))
            .map(|i| format!("triangle {i}, {}", place(self.corners(i)[0])))
            .collect();
        if flat.is_empty() {
            return Vec::new();
        }
        vec![finding(
            counted(&flat, "triangle has no area", "triangles have no area"),
            "remove degenerate faces (in Blender: Mesh > Clean Up > Degenerate Dissolve)",
        )]
    }

    /// All sides, those of one edge next to each other, in order of vertices and triangles.
    ///
    /// Each is put to those of its lesser vertex, of which a vertex has a few: in time proportional to the triangles.
    fn edges(&self) -> Vec<Edge> {
        let sides = || {
            let triangles = self.triangles.iter().zip(0..);
            triangles.flat_map(|(&[a, b, c], triangle)| {
                [(a, b), (b, c), (c, a)].into_iter().map(move |(from, to)| Edge { from, to, triangle })
            })
        };
        let mut starts = vec![0; self.vertices.len() + 1];
        sides().for_each(|edge| starts[edge.key().0 as usize + 1] += 1);
        (0..self.vertices.len()).for_each(|vertex| starts[vertex + 1] += starts[vertex]);
        let mut next = starts.clone();
        let mut edges = vec![Edge { from: 0, to: 0, triangle: 0 }; 3 * self.triangles.len()];
        for edge in sides() {
            let place = &mut next[edge.key().0 as usize];
            edges[*place] = edge;
            *place += 1;
        }
        for range in starts.windows(2) {
            edges[range[0]..range[1]].sort_unstable_by_key(|edge| (edge.key().1, edge.triangle));
        }
        edges
    }

    fn edge_findings(&self, edges: &[Edge]) -> Vec<Diagnostic> {
        let (mut boundary, mut crowded, mut reversed) = (Vec::new(), Vec::new(), Vec::new());
        for sides in edges.chunk_by(|a, b| a.key() == b.key()) {
            let name = || {
                let (a, b) = sides[0].key();
                let [a, b] = [a, b].map(|i| place(self.vertices[i as usize]));
                format!("{a} to {b}")
            };
            match sides {
                [_] => boundary.push(name()),
                [a, b] if a.from == b.from => reversed.push(name()),
                [_, _] => {}
                _ => crowded.push(name()),
            }
        }
        let kinds = [
            (
                boundary,
                ["boundary edge: the mesh has a hole", "boundary edges: the mesh has holes"],
                "close the mesh (in Blender: select by Non Manifold, then fill)",
            ),
            (
                crowded,
                [
                    "non-manifold edge with more than two triangles",
                    "non-manifold edges with more than two triangles",
                ],
                "remove inner faces so that each edge has two triangles",
            ),
            (
                reversed,
                [
                    "edge between triangles of opposite orientation",
                    "edges between triangles of opposite orientation",
                ],
                "recalculate the normals outside",
            ),
        ];
        kinds
            .into_iter()
            .filter(|(places, ..)| !places.is_empty())
            .map(|(places, [one, many], help)| finding(counted(&places, one, many), help))
            .collect()
    }

    /// Vertices at which more than one fan of triangles meets. Neighbours across an edge share a
    /// fan at both its ends; where every edge has two triangles, corners joined so form the fans.
    fn fans(&self, edges: &[Edge]) -> Vec<Diagnostic> {
        let corner_at = |triangle: u32, vertex: u32| {
            let corner = self.triangles[triangle as usize].iter().position(|&i| i == vertex);
            3 * triangle + corner.unwrap_or(0) as u32
        };
        let mut corners = Sets::new(3 * self.triangles.len());
        for pair in edges.chunks_exact(2) {
            for vertex in [pair[0].from, pair[0].to] {
                let [a, b] = [0, 1].map(|i| corner_at(pair[i].triangle, vertex));
                corners.join(a, b);
            }
        }
        let mut fan_of = vec![u32::MAX; self.vertices.len()];
        let mut pinched = Vec::new();
        for (corner, &vertex) in self.triangles.as_flattened().iter().enumerate() {
            let fan = corners.find(corner as u32);
            let known = &mut fan_of[vertex as usize];
            if *known == u32::MAX {
                *known = fan;
            } else if *known != fan {
                pinched.push(vertex);
            }
        }
        pinched.sort_unstable();
        pinched.dedup();
        if pinched.is_empty() {
            return Vec::new();
        }
        let places: Vec<String> = pinched.iter().map(|&i| place(self.vertices[i as usize])).collect();
        let one = "non-manifold vertex: parts touch in a single point";
        let many = "non-manifold vertices: parts touch in single points";
        vec![finding(counted(&places, one, many), "separate the parts there")]
    }

    /// Components of negative volume that are not cavities: a cavity's vertex lies within the other
    /// components.
    fn inside_out(&self, edges: &[Edge]) -> Vec<Diagnostic> {
        let mut parts = Sets::new(self.triangles.len());
        for pair in edges.chunks_exact(2) {
            parts.join(pair[0].triangle, pair[1].triangle);
        }
        let part_of: Vec<u32> = (0..self.triangles.len() as u32).map(|i| parts.find(i)).collect();
        let mut volume = vec![0.0; self.triangles.len()];
        for (i, &part) in part_of.iter().enumerate() {
            // Tetrahedra to a vertex of the part: six times its signed volume.
            let apex = self.corners(part as usize)[0];
            let [a, b, c] = self.corners(i).map(|vertex| vertex - apex);
            volume[part as usize] += a.dot(b.cross(c));
        }
        let places: Vec<String> = (0..self.triangles.len() as u32)
            .filter(|&part| volume[part as usize] < 0.0 && !self.within_others(part, &part_of))
            .map(|part| place(self.corners(part as usize)[0]))
            .collect();
        if places.is_empty() {
            return Vec::new();
        }
        vec![finding(
            counted(&places, "part of the mesh is inside out", "parts of the mesh are inside out"),
            "flip its faces: corners must turn counter-clockwise seen from outside",
        )]
    }

    /// Crossings that leave less those that enter, along a ray from a vertex of the part: how often
    /// the other parts enclose it.
    fn within_others(&self, part: u32, part_of: &[u32]) -> bool {
        let ray = Ray { origin: self.corners(part as usize)[0], dir: DVec3::new(0.36, 0.48, 0.8) };
        let crossings = |side| {
            let ray = Sheared::new(&ray, side);
            (0..self.triangles.len())
                .filter(|&i| part_of[i] != part)
                .filter(|&i| ray.meet(&PackedTriangle::new(&self.corners(i)), 0.0).is_some())
                .count()
        };
        crossings(Side::Inside) > crossings(Side::Outside)
    }
}

/// The cross product of two sides is rounding only. Sides of no length count as well.
fn has_no_area([a, b, c]: [DVec3; 3]) -> bool {
    let (ab, ac) = (b - a, c - a);
    ab.cross(ac).length() <= 4.0 * f64::EPSILON * ab.length() * ac.length() || b == c
}

fn finding(rule: impl Into<String>, help: &str) -> Diagnostic {
    Diagnostic { rule: rule.into(), place: None, help: Some(help.into()) }
}

/// `4 boundary edges: the mesh has holes; at (0, 0, 0) to (1, 0, 0); ...`.
fn counted(places: &[String], one: &str, many: &str) -> String {
    let what = if places.len() == 1 { one } else { many };
    let named = places.iter().take(NAMED).cloned().collect::<Vec<_>>().join("; ");
    let more = if places.len() > NAMED { "; ..." } else { "" };
    format!("{} {what}; at {named}{more}", places.len())
}

fn place(point: DVec3) -> String {
    format!("({}, {}, {})", point.x, point.y, point.z)
}

/// Disjoint sets with path halving; a set's name is its least member.
struct Sets(Vec<u32>);

impl Sets {
    fn new(n: usize) -> Sets {
        Sets((0..n as u32).collect())
    }

    fn find(&mut self, mut i: u32) -> u32 {
        while self.0[i as usize] != i {
            let up = self.0[self.0[i as usize] as usize];
            self.0[i as usize] = up;
            i = up;
        }
        i
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.find(a), self.find(b));
        self.0[a.max(b) as usize] = a.min(b);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(vertices: &[DVec3], triangles: &[[u32; 3]]) -> String {
        check(vertices, triangles).expect_err("refused").to_string()
    }

    #[test]
    fn indices_out_of_range_are_refused() {
        let error = message(&[DVec3::ZERO, DVec3::X, DVec3::Y], &[[0, 1, 3]]);
        assert!(error.contains("[0, 1, 3] points beyond the mesh's 3 vertices"), "{error}");
    }

    #[test]
    fn slivers_of_rounding_are_without_area() {
        let tip = DVec3::new(1.0, 3.0, 7.0) / 10.0;
        assert!(has_no_area([DVec3::ZERO, tip, tip * 3.0]));
        assert!(!has_no_area([DVec3::ZERO, tip, tip * 3.0 + DVec3::X * 1e-12]));
    }

    #[test]
    fn only_the_first_places_are_named() {
        let vertices: Vec<DVec3> = (0..6).map(|i| DVec3::new(f64::NAN, i as f64, 0.0)).collect();
        let error = message(&vertices, &[[0, 1, 2]]);
        assert!(error.contains("6 vertices are not finite"), "{error}");
        assert!(error.contains("vertex 2") && !error.contains("vertex 3"), "{error}");
    }
}
