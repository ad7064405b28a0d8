//! Common to the tests of geometry: a small uniform source, directions, and test bodies.

use super::{Mesh, Shape, procedural};
use crate::math::DVec3;

/// SplitMix64 (Steele, Lea, Flood 2014): the tests' own source of uniform numbers in [0, 1).
#[derive(Clone)]
pub(crate) struct Uniform(u64);

impl Uniform {
    /// Seeded by a test's name (FNV-1a).
    pub(crate) fn named(name: &str) -> Uniform {
        let step = |h: u64, b: u8| (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3);
        Uniform(name.bytes().fold(0xcbf2_9ce4_8422_2325, step))
    }

    pub(crate) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 * f64::EPSILON * 0.5
    }
}

/// A uniform direction, by rejection from the ball.
pub(crate) fn direction(u: &mut Uniform) -> DVec3 {
    super::audit::direction(&mut || u.next())
}

/// A uniform direction with `dir . normal < 0`.
pub(crate) fn inward(normal: DVec3, u: &mut Uniform) -> DVec3 {
    super::audit::inward(normal, &mut || u.next())
}

/// One shape of every kind.
pub(crate) fn one_of_each() -> [Shape; 5] {
    let mesh = procedural::bumpy_sphere(1.0, 4, 0.2, 5.0, true).expect("closed");
    let half = DVec3::new(0.5, 0.8, 0.4);
    [
        Shape::HalfSpace,
        Shape::Slab { thickness: 0.7 },
        Shape::Box { half },
        Shape::Sphere { radius: 1.0 },
        Shape::Mesh(mesh),
    ]
}

/// The bodies of the watertightness tests, by name.
pub(crate) fn bodies() -> Vec<(&'static str, Shape)> {
    let bodies = [
        ("icosphere", procedural::icosphere(1.0, 4, false)),
        ("bumpy sphere", procedural::bumpy_sphere(3.0, 5, 0.2, 9.0, true)),
        ("torus", procedural::torus(2.0, 0.7, [48, 24], true)),
        ("cavity sphere", procedural::cavity_sphere(5.0, 2.0, 3, false)),
        ("drilled box", procedural::drilled_box(DVec3::new(3.0, 2.0, 0.5), [3, 2], 0.4)),
        ("creature", Ok(creature())),
    ];
    bodies.map(|(name, mesh)| (name, Shape::Mesh(mesh.expect(name)))).into()
}

/// An irregular body like a scanned animal: a sphere pulled into lobes, its vertices shaken, far
/// from the origin, with triangles of very different sizes.
pub(crate) fn creature() -> Mesh {
    let ball = procedural::icosphere(1.0, 4, false).expect("sphere");
    let mut u = Uniform(99); // a shape, not a sample
    let lobes: Vec<DVec3> = (0..5).map(|_| direction(&mut u)).collect();
    let pulled = ball.vertices().iter().map(|&n| {
        let reach: f64 = lobes.iter().map(|&lobe| n.dot(lobe).max(0.0).powi(8)).sum();
        let shaken = n + (DVec3::new(u.next(), u.next(), u.next()) - 0.5) * 0.02;
        shaken * (1.0 + 1.5 * reach) + DVec3::new(100.0, -30.0, 7.0)
    });
    Mesh::new(pulled.collect(), ball.triangles().to_vec(), None, true).expect("closed")
}
