//! Volume and surface area of bodies.

use std::f64::consts::PI;

use super::Shape;
use super::surface::triangles;

impl Shape {
    /// Volume, mm^3; none of the unbounded half-space and slab.
    pub fn volume(&self) -> Option<f64> {
        match self {
            Shape::HalfSpace | Shape::Slab { .. } => None,
            Shape::Box { half } => Some(8.0 * half.element_product()),
            Shape::Sphere { radius } => Some(4.0 / 3.0 * PI * radius * radius * radius),
            Shape::Mesh(mesh) => Some(mesh.volume()),
        }
    }

    /// Area of the whole boundary, walls of cavities included, mm^2; none of the unbounded half-space
    /// and slab.
    pub fn area(&self) -> Option<f64> {
        match self {
            Shape::HalfSpace | Shape::Slab { .. } => None,
            Shape::Box { half } => Some(8.0 * (half.x * half.y + half.y * half.z + half.z * half.x)),
            Shape::Sphere { radius } => Some(4.0 * PI * radius * radius),
            Shape::Mesh(mesh) => Some(triangles(mesh).map(|triangle| triangle.area()).sum()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Mesh, procedural};
    use super::*;
    use crate::math::{DVec3, sin};

    fn near(found: Option<f64>, expected: f64) {
        let found = found.expect("a finite body");
        assert!((found / expected - 1.0).abs() < 1e-12, "{found}, expected {expected}");
    }

    #[test]
    fn unbounded_bodies_have_neither() {
        for shape in [Shape::HalfSpace, Shape::Slab { thickness: 2.0 }] {
            assert_eq!((shape.volume(), shape.area()), (None, None));
        }
    }

    /// Closed forms, and the same bodies as meshes.
    #[test]
    fn exact_bodies() {
        let sphere = Shape::Sphere { radius: 0.5 };
        near(sphere.volume(), PI / 6.0);
        near(sphere.area(), PI);
        let half = DVec3::new(0.5, 1.0, 1.5);
        let cuboid = Shape::Box { half };
        near(cuboid.volume(), 6.0);
        near(cuboid.area(), 22.0);
        // One hole of half the box's width and depth through its height.
        let drilled = procedural::drilled_box(2.0 * half, [1, 1], 0.5).expect("closed");
        let pitch = (half.x * 2.0).min(half.y * 2.0) * 0.5;
        let (volume, area) = (6.0 - pitch * pitch * 3.0, 22.0 - 2.0 * pitch * pitch + 4.0 * pitch * 3.0);
        near(Shape::Mesh(drilled.clone()).volume(), volume);
        near(Shape::Mesh(drilled).area(), area);
    }

    /// A torus of m segments around its ring and n around its tube (Pappus, for polygons): the tube is
    /// a regular n-gon; the volume between two neighbouring sections is the wedge of a prism.
    #[test]
    fn torus() {
        let (major, minor, m, n) = (2.0, 0.7, 24u32, 12u32);
        let mesh = procedural::torus(major, minor, [m, n], false).expect("closed");
        let polygon = 0.5 * f64::from(n) * minor * minor * sin(2.0 * PI / f64::from(n));
        let ring = f64::from(m) * sin(2.0 * PI / f64::from(m)) * major;
        near(Shape::Mesh(mesh).volume(), polygon * ring);
    }

    /// The wall of a cavity adds to the area and takes from the volume; far from the origin both stay.
    #[test]
    fn cavities_and_places() {
        let body = |radius| procedural::icosphere(radius, 3, false).expect("closed");
        let [outer, inner] = [1.0, 0.4].map(|radius| Shape::Mesh(body(radius)));
        let hollow = Shape::Mesh(procedural::cavity_sphere(1.0, 0.4, 3, false).expect("closed"));
        let of = |f: fn(&Shape) -> Option<f64>| [&outer, &inner].map(|shape| f(shape).expect("finite"));
        let [volume, area] = [of(Shape::volume), of(Shape::area)];
        near(hollow.volume(), volume[0] - volume[1]);
        near(hollow.area(), area[0] + area[1]);
        let Shape::Mesh(mesh) = &outer else { unreachable!() };
        let far = mesh.vertices().iter().map(|v| *v + DVec3::splat(1024.0)).collect();
        let far = Mesh::new(far, mesh.triangles().to_vec(), None, false).expect("closed");
        let moved = Shape::Mesh(far).volume().expect("finite");
        assert!((moved / volume[0] - 1.0).abs() < 1e-11, "{moved} {}", volume[0]);
    }
}
