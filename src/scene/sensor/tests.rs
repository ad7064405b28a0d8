//! Sensors in closed form: what rays find and what light that leaves scores.

use std::f64::consts::PI;

use super::*;
use crate::geometry::BoundingSphere;
use crate::math::Frame;
use crate::sampling::warp::square_to_disc;

fn screen(width: usize, height: usize) -> Screen {
    Screen {
        width,
        height,
        right: DVec3::X * 0.1,
        down: -DVec3::Y * 0.1,
        view: -DVec3::Z,
        has_tiles: true,
    }
}

/// Without tiles an image has one region, and every pixel counts in it alone.
#[test]
fn tiles_can_be_left_out() {
    let image = |has_tiles| {
        let screen = Screen { has_tiles, ..screen(7, 5) };
        Sensor::Orthographic(Orthographic { screen, center: DVec3::Z * 5.0 })
    };
    let (with, without) = (image(true), image(false));
    assert_eq!((with.regions().len(), without.regions().len()), (17, 1));
    let regions = |sensor: &Sensor| -> Vec<(usize, f64)> { sensor.regions_of(9).into_iter().collect() };
    assert_eq!(regions(&with).len(), 2);
    assert_eq!(regions(&without), regions(&with)[..1]);
}

/// The weights of a flux integrate a radiance of 1 to pi per face and 4 pi * pi R^2 per body.
#[test]
fn flux_of_constant_radiance() {
    let face = |name| FluxFace { name, point: DVec3::ZERO, reach: 1.0, frame: Frame::about(DVec3::Z) };
    let slab =
        Sensor::FaceFlux(FaceFlux { faces: vec![face("top"), face("bottom")], bins: 3, paths: 2 });
    let body = Sensor::BodyFlux(BodyFlux {
        bounds: BoundingSphere { center: DVec3::X, radius: 2.0 },
        frame: Frame::about(DVec3::Y),
        bins: 5,
        paths: 4,
    });
    for (sensor, expected) in [(slab, 2.0 * PI), (body, 4.0 * PI * PI * 4.0)] {
        let rays = (0..sensor.rays_per_pass()).map(|i| sensor.ray(i, [0.4, 0.3, 0.2, 0.1]));
        let sum: f64 = rays.map(|r| r.weight).sum();
        assert!((sum / expected - 1.0).abs() < 1e-14);
    }
}

/// Directions fall into the bin that their slot names.
#[test]
fn directions_lie_in_their_bins() {
    let sensor = Sensor::BodyFlux(BodyFlux {
        bounds: BoundingSphere { center: DVec3::ZERO, radius: 1.0 },
        frame: Frame::about(DVec3::Y),
        bins: 4,
        paths: 1,
    });
    for i in 0..4 {
        for u in [0.0, 0.5, 0.999] {
            let ray = sensor.ray(i, [u, 0.3, 0.5, 0.5]);
            assert_eq!(((-ray.ray.dir.y + 1.0 + 1e-12) * 2.0) as usize, ray.slot);
        }
    }
}

fn accepting(height: f64) -> Sensor {
    // The screen is seen from below, turned, and stands in the body.
    let view = DVec3::new(0.36, -0.48, 0.8);
    let right = view.cross(DVec3::Z).normalize();
    let screen = Screen {
        width: 6,
        height: 4,
        right: 0.2 * right,
        down: 0.2 * view.cross(right),
        view,
        has_tiles: true,
    };
    let bounds = BoundingSphere { center: DVec3::new(0.0, 0.5, 0.0), radius: 1.5 };
    let center = DVec3::new(0.1, 0.2, -0.1);
    Sensor::Accepting(Accepting::new(screen, center, height, bounds))
}

/// Rings begin with their inner edge, end before their outer one, and count in `all` too; what none
/// holds counts there alone. Camera paths and photons are told apart from other slots by the same
/// distance.
#[test]
fn rings_by_distance_along_the_face() {
    let sensor = Sensor::Rings(Rings { reach: 1.0, edges: vec![0.5, 1.0, 5.0], paths: 3 });
    let names: Vec<String> = sensor.regions().into_iter().map(|region| region.name).collect();
    assert_eq!(names, ["all", "ring_0", "ring_1"]);
    let up = DVec3::new(0.6, 0.0, 0.8);
    for (r, regions) in [
        (0.0, vec![(0, 1.0)]),
        (0.4999, vec![(0, 1.0)]),
        (0.5, vec![(0, 1.0), (1, 1.0)]),
        (0.9999, vec![(0, 1.0), (1, 1.0)]),
        (1.0, vec![(0, 1.0), (2, 1.0)]),
        (4.9999, vec![(0, 1.0), (2, 1.0)]),
        (5.0, vec![(0, 1.0)]),
        (1e300, vec![(0, 1.0)]),
    ] {
        for depth in [0.0, 2.0] {
            let point = DVec3::new(r, 0.0, -depth);
            let slot = sensor.slot_of(0, point);
            assert_eq!(sensor.regions_of(slot).into_iter().collect::<Vec<_>>(), regions, "{r}");
            assert_eq!(sensor.receive(&Ray { origin: point, dir: up }), Some((slot, 1.0)));
            assert_eq!(sensor.receive(&Ray { origin: point, dir: -up }), None);
        }
    }
    let face = FluxFace { name: "top", point: DVec3::ZERO, reach: 1.0, frame: Frame::about(DVec3::Z) };
    let flux = Sensor::FaceFlux(FaceFlux { faces: vec![face], bins: 1, paths: 3 });
    assert_eq!(sensor.rays_per_pass(), 3);
    for u in [0.1, 0.7] {
        let u = [u, 0.3, 0.2, 0.9];
        let (ring, face) = (sensor.ray(2, u), flux.ray(2, u));
        assert!((ring.ray.dir - face.ray.dir).length() < 1e-15);
        assert!((ring.ray.origin - face.ray.origin).length() < 1e-15);
        assert_eq!(ring.weight, face.weight);
    }
}

fn receiving() -> Vec<Sensor> {
    let face = |name, n| FluxFace { name, point: DVec3::ZERO, reach: 1.0, frame: Frame::about(n) };
    let faces = vec![face("top", DVec3::Z), face("bottom", -DVec3::Z)];
    let bounds = BoundingSphere { center: DVec3::X, radius: 2.0 };
    let frame = Frame::about(DVec3::new(0.6, 0.0, -0.8));
    vec![
        Sensor::FaceFlux(FaceFlux { faces, bins: 3, paths: 2 }),
        Sensor::BodyFlux(BodyFlux { bounds, frame, bins: 5, paths: 2 }),
        accepting(1e-4),
        accepting(0.9),
    ]
}

/// Light that goes back along any of a sensor's rays is received by the ray's slot, wherever on the
/// line it left the body.
#[test]
fn light_along_a_ray_is_received_by_its_slot() {
    for sensor in receiving() {
        for index in 0..sensor.rays_per_pass() {
            for k in 0..200u32 {
                let step = [0.819_172_513, 0.671_043_607, 0.549_700_478, 0.450_333_124];
                let u = step.map(|step: f64| ((f64::from(k) + 0.5) * step).fract());
                let SensorRay { ray, slot, .. } = sensor.ray(index, u);
                let out = Ray { origin: ray.at(f64::from(k) * 0.02), dir: -ray.dir };
                let received = sensor.receive(&out).map(|(slot, _)| slot);
                assert_eq!(received, Some(slot), "{sensor:?} {index} {u:?}");
            }
        }
    }
}

/// Rays of pixels start outside the body's sphere and before it.
#[test]
fn rays_of_caps_start_before_the_body() {
    for height in [1e-4, 0.9] {
        let sensor = accepting(height);
        let Sensor::Accepting(accepting) = &sensor else { unreachable!() };
        let bounds = accepting.bounds;
        for index in 0..sensor.rays_per_pass() {
            for v in [0.0, 0.5, 0.999] {
                let SensorRay { ray, weight, .. } = sensor.ray(index, [0.3, 0.7, v, 0.9]);
                let to_middle = bounds.center - ray.origin;
                assert!(to_middle.dot(ray.dir) > 1.999 * bounds.radius);
                assert!(weight == 1.0 && (ray.dir.length() - 1.0).abs() < 1e-15);
            }
        }
    }
}

/// What a sensor receives from light of radiance 1 in all directions, by a sum over a grid of lines
/// through the body's sphere: radiance 1 in every pixel, 2 pi dmu * pi R^2 in every bin. Lines are
/// even in direction and in place across it, each worth 4 pi * pi R^2 over their number.
#[test]
fn uniform_light_is_received_as_radiance_one() {
    for (sensor, value, tolerance) in [
        (accepting(0.9), 1.0, 0.02),
        (accepting(0.2), 1.0, 0.05),
        (receiving().swap_remove(1), 2.0 * PI * 0.4 * PI * 4.0, 0.001),
    ] {
        let bounds = match &sensor {
            Sensor::Accepting(accepting) => accepting.bounds,
            Sensor::BodyFlux(flux) => flux.bounds,
            _ => unreachable!(),
        };
        let n = 4_000_000u32;
        let power = 4.0 * PI * PI * bounds.radius * bounds.radius / f64::from(n);
        let slots = sensor.regions().len().max(sensor.pixels().map_or(0, |(w, h)| w * h));
        let mut sums = vec![0.0; slots];
        // Inverse powers of the real root of x^5 = x + 1: Roberts' sequence in four dimensions.
        let root = 1.167_303_978_261_418_7_f64;
        for k in 0..n {
            let u: [f64; 4] =
                std::array::from_fn(|i| (f64::from(k) * root.powi(-(i as i32) - 1)).fract());
            let (sin, cos) = crate::math::sin_cos_turns(u[1]);
            let z = 1.0 - 2.0 * u[0];
            let r = (1.0 - z * z).sqrt();
            let dir = DVec3::new(r * cos, r * sin, z);
            let across = Frame::about(dir);
            let [x, y] = square_to_disc([u[2], u[3]]);
            let origin = bounds.center + bounds.radius * (x * across.s + y * across.t);
            if let Some((slot, factor)) = sensor.receive(&Ray { origin, dir }) {
                sums[slot] += power * factor;
            }
        }
        let slots = sensor.pixels().map_or(5, |(w, h)| w * h);
        for (slot, sum) in sums[..slots].iter().enumerate() {
            assert!((sum / value - 1.0).abs() < tolerance, "{slot}: {sum} of {value}");
        }
    }
}
