//! Lines through a body near a point of its surface, and the density of their crossings with the surface
//! (King, Kulla, Conty & Fajardo 2013).
//!
//! A line's axis is the point's normal (probability 1/2) or one of two tangents (1/4 each); it passes
//! the point at a distance r that a radial density draws, in a uniform azimuth. The expected number of
//! crossings per area at an offset from the point, where the surface has normal n, is
//!   sum over axes a of P(a) |n . a| times the mean over bands of sum over their densities of share
//!   pdf(r_a),
//! r_a being the distance of the offset from the axis a through the point: the disc's density, carried
//! from the disc across a to the surface. All axes, bands and densities that could have made a crossing
//! are in the sum, whichever made it.

use super::{Hit, Ray, Shape, Side};
use crate::math::{DVec3, Frame};
use crate::sampling::discrete::choose_share;
use crate::sampling::radial::Radial;
use crate::sampling::stream::Stream;

/// How lines are drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct Lines {
    /// Probabilities of tangent s, tangent t and normal.
    axes: [f64; 3],
    /// Per band, with their shares.
    techniques: Vec<Vec<(f64, Radial)>>,
}

/// A line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Where it passes the point that it was drawn about, mm.
    pub point: DVec3,
    /// Unit vector along it.
    pub axis: DVec3,
    /// Distance from the point that it was drawn about, mm.
    pub radius: f64,
}

/// Work of following a line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Met {
    /// Closest-hit queries.
    pub rays: u64,
    /// The line went into a finite body and did not come out.
    pub is_lost: bool,
}

impl Lines {
    /// For a body and the radial densities of each band with their shares, which sum to 1. On half-space
    /// and slab lines along tangents lie parallel to the surface and meet nothing: there the normal is
    /// always taken.
    pub fn new(shape: &Shape, techniques: Vec<Vec<(f64, Radial)>>) -> Lines {
        let axes = match shape {
            Shape::HalfSpace | Shape::Slab { .. } => [0.0, 0.0, 1.0],
            _ => [0.25, 0.25, 0.5],
        };
        Lines { axes, techniques }
    }

    /// A line about `point` with frame `frame`, by the densities of one of these bands.
    pub fn draw(&self, point: DVec3, frame: &Frame, bands: &[usize], stream: &mut Stream) -> Line {
        let [u_axis, u_band, u_technique] = stream.draw3();
        let u = stream.draw2();
        let [axis, across, along] = match choose_share(self.axes.into_iter(), u_axis) {
            Some((0, _)) => [frame.s, frame.t, frame.n],
            Some((1, _)) => [frame.t, frame.n, frame.s],
            _ => [frame.n, frame.s, frame.t],
        };
        let band = bands[((u_band * bands.len() as f64) as usize).min(bands.len() - 1)];
        let techniques = &self.techniques[band];
        let shares = techniques.iter().map(|(share, _)| *share);
        let index = choose_share(shares, u_technique).map_or(0, |(index, _)| index);
        let [x, y] = techniques[index].1.sample(u);
        Line { point: point + across * x + along * y, axis, radius: (x * x + y * y).sqrt() }
    }

    /// Expected number of crossings of one line per mm^2 of a surface with this normal at `offset` from
    /// the point.
    pub fn pdf_area(&self, bands: &[usize], frame: &Frame, offset: DVec3, normal: DVec3) -> f64 {
        let mut sum = 0.0;
        for (share, axis) in self.axes.into_iter().zip([frame.s, frame.t, frame.n]) {
            let cos = normal.dot(axis).abs();
            if share * cos == 0.0 {
                continue; // also where a density is infinite
            }
            let radius = (offset - axis * offset.dot(axis)).length();
            let radial: f64 = bands.iter().map(|&band| self.radial(band, radius)).sum();
            sum += share * cos * radial / bands.len() as f64;
        }
        sum
    }

    fn radial(&self, band: usize, radius: f64) -> f64 {
        self.techniques[band].iter().map(|(share, radial)| share * radial.pdf_area(radius)).sum()
    }
}

impl Line {
    /// Appends all crossings with the surface. The line is followed from outside the body, by turns
    /// outside and inside, so that of neighbours along an edge exactly one is met.
    pub fn cross(&self, shape: &Shape, hits: &mut Vec<Hit>) -> Met {
        let mut met = Met::default();
        let Some(mut ray) = self.start(shape) else { return met };
        let (mut side, mut from) = (Side::Outside, None);
        loop {
            met.rays += 1;
            let Some(hit) = shape.intersect(&ray, side, from, f64::INFINITY) else {
                met.is_lost = side == Side::Inside && shape.bounds().is_some();
                return met;
            };
            ray.origin = hit.point;
            from = Some(hit.face);
            side = if side == Side::Outside { Side::Inside } else { Side::Outside };
            hits.push(hit);
        }
    }

    /// A ray along the line from outside; `None` where it passes beside the body.
    fn start(&self, shape: &Shape) -> Option<Ray> {
        match shape.bounds() {
            Some(bounds) => {
                let nearest = self.point + self.axis * (bounds.center - self.point).dot(self.axis);
                let meets = (nearest - bounds.center).length() <= bounds.radius;
                meets.then_some(Ray {
                    origin: nearest - self.axis * (2.0 * bounds.radius),
                    dir: self.axis,
                })
            }
            None => {
                let dir = if self.axis.z > 0.0 { -self.axis } else { self.axis };
                // Over the top face by any height.
                let height = self.radius.max(f64::MIN_POSITIVE);
                let origin = self.point + dir * ((height - self.point.z) / dir.z);
                (dir.z != 0.0).then_some(Ray { origin, dir })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Mesh, procedural};
    use crate::sampling::stream::{Purpose, StreamKey};
    use crate::sampling::warp::square_to_cap;

    fn brute_force_crossings(mesh: &Mesh, line: &Line) -> usize {
        let frame = Frame::about(line.axis);
        let flat = |i: u32| frame.to_local(mesh.vertices()[i as usize] - line.point);
        let crossed = |triangle: &&[u32; 3]| {
            let corners = triangle.map(flat);
            let turn = |a: DVec3, b: DVec3| a.x * b.y - a.y * b.x > 0.0;
            let turns = [0, 1, 2].map(|k| turn(corners[k], corners[(k + 1) % 3]));
            turns[0] == turns[1] && turns[1] == turns[2]
        };
        mesh.triangles().iter().filter(crossed).count()
    }

    /// A line meets every sheet of a mesh once: as many crossings as triangles over the line, in turns
    /// in and out.
    #[test]
    fn lines_cross_every_sheet_once() {
        let meshes = [
            procedural::torus(0.7, 0.3, [24, 12], true).expect("a torus"),
            procedural::cavity_sphere(1.0, 0.5, 3, false).expect("a shell"),
            procedural::drilled_box(DVec3::new(1.5, 1.0, 0.7), [3, 2], 0.4).expect("a plate"),
        ];
        let key = StreamKey::named("lines_cross_every_sheet_once");
        let mut stream = key.pass(0).stream(0, Purpose::Walk);
        for mesh in meshes {
            let shape = Shape::Mesh(mesh.clone());
            let mut counts = [0; 32];
            for _ in 0..3000 {
                let axis = square_to_cap(2.0, stream.draw2());
                let middle = DVec3::from_array(stream.draw3()) - DVec3::splat(0.5);
                let line = Line { point: middle, axis, radius: 0.0 };
                let mut hits = Vec::new();
                let met = line.cross(&shape, &mut hits);
                assert!(!met.is_lost && met.rays <= hits.len() as u64 + 1);
                for (k, hit) in hits.iter().enumerate() {
                    assert_eq!(hit.normal.dot(axis) < 0.0, k % 2 == 0);
                }
                assert_eq!(hits.len(), brute_force_crossings(&mesh, &line), "{line:?}");
                counts[hits.len()] += 1;
            }
            assert!(counts[2] > 100 && counts[4] > 100, "{counts:?}");
        }
    }
}
