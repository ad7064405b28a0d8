//! Cones of directions: how soon they lead from a point of an analytic shape to its surface.

use crate::math::DVec3;

/// What is left of a distance when a part of it covers rounding.
const LESS: f64 = 1.0 - 1e-9;

/// Directions about an axis.
#[derive(Clone, Copy, Debug)]
pub struct Cone {
    /// Unit.
    axis: DVec3,
    /// Cosine and sine of the largest angle to the axis.
    cosine: f64,
    sine: f64,
}

impl Cone {
    /// About a unit axis, with this least cosine.
    pub fn new(axis: DVec3, least_cosine: f64) -> Cone {
        let sine = (1.0 - least_cosine * least_cosine).max(0.0).sqrt();
        Cone { axis, cosine: least_cosine, sine }
    }

    /// The largest component of a direction of the cone along a vector, times the vector's length, of which this is the square;
    /// `along` is the same of the axis. With the angle a between axis and vector and w that of the cone: the length where
    /// a <= w, else cos(a - w) times the length. w is below a right angle.
    #[inline(always)]
    fn most_along(&self, squared: f64, along: f64) -> f64 {
        let is_inside = along > 0.0 && along * along >= self.cosine * self.cosine * squared;
        let across = (squared - along * along).max(0.0).sqrt();
        // Both are computed, as in vectors.
        let at_rim = along * self.cosine + across * self.sine;
        if is_inside { squared.sqrt() } else { at_rim }
    }

    /// The distance to a plane whose height above the point is `height`, and whose unit normal has the component `along` on
    /// the axis.
    #[inline(always)]
    fn reach_plane(&self, height: f64, along: f64) -> f64 {
        let most = self.most_along(1.0, along);
        if most > 0.0 { height / most * LESS } else { f64::INFINITY }
    }

    #[inline(always)]
    pub(super) fn through_half_space(&self, point: DVec3) -> f64 {
        self.reach_plane(-point.z, self.axis.z)
    }

    #[inline(always)]
    pub(super) fn through_slab(&self, thickness: f64, point: DVec3) -> f64 {
        let down = self.reach_plane(thickness + point.z, -self.axis.z);
        self.through_half_space(point).min(down)
    }

    #[inline(always)]
    pub(super) fn through_cuboid(&self, half: DVec3, point: DVec3) -> f64 {
        let along = |axis: usize| {
            let up = self.reach_plane(half[axis] - point[axis], self.axis[axis]);
            up.min(self.reach_plane(half[axis] + point[axis], -self.axis[axis]))
        };
        along(0).min(along(1)).min(along(2))
    }

    /// The distance along w from x to the sphere is sqrt(R^2 - x^2 + (x.w)^2) - x.w, which falls with x.w.
    #[inline(always)]
    pub(super) fn through_sphere(&self, radius: f64, point: DVec3) -> f64 {
        let squared = point.length_squared();
        let most = self.most_along(squared, point.dot(self.axis));
        ((radius * radius - squared + most * most).max(0.0).sqrt() - most) * LESS
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{Uniform, direction, one_of_each};
    use super::super::{Ray, Side};
    use super::*;
    use crate::math::Frame;

    /// No direction of a cone leads to the surface sooner than the bound says, and in an analytic shape some direction of the
    /// rim leads there that soon, unless one inside the cone does sooner.
    #[test]
    fn clearance_within_a_cone_bounds_distances() {
        let mut u = Uniform::named("clearance_within_a_cone_bounds_distances");
        for shape in one_of_each() {
            // A mesh would be megabytes of text.
            let name = if shape.is_convex() { format!("{shape:?}") } else { "mesh".into() };
            let (mut bounded, mut exact) = (0, 0);
            for _ in 0..400 {
                let point = DVec3::new(u.next() - 0.5, u.next() - 0.5, 0.0);
                let point = point.with_z(if shape.contains(point) { u.next() - 0.5 } else { -u.next() });
                if !shape.contains(point) {
                    continue;
                }
                let (axis, width) = (direction(&mut u), 1e-3 + 1.5 * u.next());
                let bound = shape.clearance_within(point, &Cone::new(axis, width.cos()));
                assert!(bound >= shape.clearance(point) * (1.0 - 1e-8), "{name} {point}");
                let frame = Frame::about(axis);
                // The rim in small steps, and the inside of the cone.
                let distances = (0..400).map(|step| {
                    let (sin, cos) = (width * if step < 200 { 1.0 } else { u.next() }).sin_cos();
                    let (y, x) = (f64::from(step) * 0.01 * std::f64::consts::PI).sin_cos();
                    let dir = frame.to_world(DVec3::new(sin * x, sin * y, cos));
                    let hit =
                        shape.intersect(&Ray { origin: point, dir }, Side::Inside, None, f64::INFINITY);
                    hit.map_or(f64::INFINITY, |hit| hit.t)
                });
                let distances: Vec<f64> = distances.collect();
                let least = |of: &[f64]| of.iter().copied().fold(f64::INFINITY, f64::min);
                let (nearest, on_rim) = (least(&distances), least(&distances[..200]));
                assert!(bound <= nearest, "{name} {point} {axis}: {bound} and {nearest}");
                bounded += u32::from(nearest < f64::INFINITY);
                if shape.is_convex() && on_rim == nearest && nearest < 1e3 {
                    assert!(bound > 0.98 * nearest - 1e-3, "{name} {point}: {bound} and {nearest}");
                    exact += 1;
                }
            }
            assert!(bounded > 100, "{name}");
            assert!(exact > 100 || !shape.is_convex(), "{name}: {exact}");
        }
    }
}
