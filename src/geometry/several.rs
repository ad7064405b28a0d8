//! Questions about several points or flights at once, which vector instructions answer together, with the bits of one by one.

use super::{Cone, Shape, analytic};
use crate::math::{DVec3, Vectorized, vectorized};

/// Several flights, component by component.
#[derive(Clone, Copy, Debug)]
pub struct Flights<'a, const N: usize> {
    /// Where they begin, mm.
    pub origins: &'a [[f64; N]; 3],
    /// Where they end, mm.
    pub ends: &'a [[f64; N]; 3],
    /// How long they are, mm.
    pub lengths: &'a [f64; N],
}

/// [`Shape::are_clear`].
struct AreClear<'a, const N: usize> {
    shape: &'a Shape,
    flights: Flights<'a, N>,
}

impl<const N: usize> Vectorized for AreClear<'_, N> {
    type Output = [bool; N];

    #[inline(always)]
    fn call(self) -> [bool; N] {
        let AreClear { shape, flights: Flights { origins, ends, lengths } } = self;
        match *shape {
            Shape::HalfSpace => each(|i| {
                let (origin, end) = (point_of(origins, i), point_of(ends, i));
                analytic::ends_in_half_space(origin, end, lengths[i])
            }),
            Shape::Slab { thickness } => each(|i| analytic::ends_in_slab(thickness, point_of(ends, i))),
            Shape::Box { half } => each(|i| analytic::ends_in_cuboid(half, point_of(ends, i))),
            Shape::Sphere { radius } => each(|i| analytic::ends_in_sphere(radius, point_of(ends, i))),
            Shape::Mesh(ref mesh) => each(|i| mesh.is_clear(point_of(origins, i), point_of(ends, i))),
        }
    }
}

/// [`Shape::clearances_within`].
struct ClearancesWithin<'a, const N: usize> {
    shape: &'a Shape,
    points: &'a [[f64; N]; 3],
    cone: &'a Cone,
}

impl<const N: usize> Vectorized for ClearancesWithin<'_, N> {
    type Output = [f64; N];

    #[inline(always)]
    fn call(self) -> [f64; N] {
        let ClearancesWithin { shape, points, cone } = self;
        let point = |i: usize| point_of(points, i);
        match *shape {
            Shape::HalfSpace => each(|i| cone.through_half_space(point(i))),
            Shape::Slab { thickness } => each(|i| cone.through_slab(thickness, point(i))),
            Shape::Box { half } => each(|i| cone.through_cuboid(half, point(i))),
            Shape::Sphere { radius } => each(|i| cone.through_sphere(radius, point(i))),
            Shape::Mesh(ref mesh) => each(|i| mesh.clearance_within(point(i), cone)),
        }
    }
}

/// `f` of each index. A loop, since `array::from_fn` is not inlined here.
#[inline(always)]
fn each<T: Copy + Default, const N: usize>(f: impl Fn(usize) -> T) -> [T; N] {
    let mut values = [T::default(); N];
    for (i, value) in values.iter_mut().enumerate() {
        *value = f(i);
    }
    values
}

#[inline(always)]
fn point_of<const N: usize>([x, y, z]: &[[f64; N]; 3], i: usize) -> DVec3 {
    DVec3::new(x[i], y[i], z[i])
}

impl Shape {
    /// [`Self::is_clear`] of several flights.
    #[inline]
    pub(crate) fn are_clear<const N: usize>(&self, flights: Flights<'_, N>) -> [bool; N] {
        vectorized(AreClear { shape: self, flights })
    }

    /// [`Self::clearance_within`] of several points, component by component.
    #[inline]
    pub(crate) fn clearances_within<const N: usize>(
        &self,
        points: &[[f64; N]; 3],
        cone: &Cone,
    ) -> [f64; N] {
        vectorized(ClearancesWithin { shape: self, points, cone })
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{Uniform, direction, one_of_each};
    use super::super::{Cone, Ray};
    use super::{Flights, point_of};

    #[test]
    fn several_are_as_one_by_one() {
        const N: usize = 8;
        let mut u = Uniform::named("several_are_as_one_by_one");
        for shape in &one_of_each() {
            let [mut clear, mut inside] = [0; 2];
            for _ in 0..2000 {
                let mut origins = [[0.0; N]; 3];
                let mut dirs = origins;
                let mut lengths = [0.0; N];
                for i in 0..N {
                    let [origin, dir] = [direction(&mut u) * u.next(), direction(&mut u)];
                    for axis in 0..3 {
                        (origins[axis][i], dirs[axis][i]) = (origin[axis], dir[axis]);
                    }
                    // Some end nowhere, or where they begin.
                    lengths[i] = [u.next(), 0.3 * u.next(), 0.0, f64::INFINITY][(i + 1) % 4];
                }
                let ray = |i| Ray { origin: point_of(&origins, i), dir: point_of(&dirs, i) };
                let mut ends = origins;
                for i in 0..N {
                    let end = ray(i).at(lengths[i]);
                    (ends[0][i], ends[1][i], ends[2][i]) = (end.x, end.y, end.z);
                }
                let cone = Cone::new(direction(&mut u), u.next());
                let flights = Flights { origins: &origins, ends: &ends, lengths: &lengths };
                let (are_clear, bounds) =
                    (shape.are_clear(flights), shape.clearances_within(&origins, &cone));
                for i in 0..N {
                    let Ray { origin, .. } = ray(i);
                    let is_clear = shape.is_clear(&ray(i), point_of(&ends, i), lengths[i]);
                    assert_eq!(are_clear[i], is_clear, "{:?} {}", ray(i), lengths[i]);
                    let bound = shape.clearance_within(origin, &cone);
                    // Outside the body bounds have no meaning, and may be no numbers.
                    assert_eq!(bounds[i].to_bits(), bound.to_bits(), "{origin} {cone:?}");
                    clear += u32::from(is_clear);
                    inside += u32::from(bound > 0.0);
                }
            }
            assert!(clear > 1000 && inside > 1000, "{clear} clear, {inside} inside");
        }
    }
}
