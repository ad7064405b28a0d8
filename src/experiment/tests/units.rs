//! Units and directions from the file to the scene: what a light gives and what a pixel sees, against
//! numbers by hand. Estimators share both, so that no comparison of two of them sees an error here.

use std::f64::consts::PI;

use super::*;
use crate::experiment::build::{Builder, Shapes};
use crate::geometry::Ray;
use crate::math::{DVec3, Frame, cos, sin};
use crate::scene::{Light, Scene, Sensor};

const SENSOR: &str = "sensor.probe = { point_mm = [0, 0, 3], toward = [0, 0, -1] }";
const LIGHT: &str = "directional = { toward = [1, 1, 1], irradiance = 1.0 }";

/// The scene of the good experiment with one part replaced.
fn scene(old: &str, new: &str) -> Scene {
    assert!(GOOD.contains(old));
    let experiment = good(&GOOD.replace(old, new));
    Builder::new(&experiment, &Shapes::new()).scene(0).unwrap_or_else(|error| panic!("{error}"))
}

/// Irradiance of band 1 on a plane with this normal, int L(w) cos dw: midpoints in cosine and azimuth.
fn irradiance(light: &Light, normal: DVec3) -> f64 {
    const N: usize = 1000;
    let frame = Frame::about(normal);
    let step = 1.0 / N as f64;
    let mut sum = 0.0;
    for i in 0..N {
        let mu = (i as f64 + 0.5) * step;
        let across = (1.0 - mu * mu).sqrt();
        for j in 0..N {
            let phi = 2.0 * PI * (j as f64 + 0.5) * step;
            let wi = frame.to_world(DVec3::new(across * cos(phi), across * sin(phi), mu));
            sum += light.eval(1, wi).0 * mu;
        }
    }
    sum * 2.0 * PI * step * step
}

/// A disc's irradiance is that of the plane that faces it, for small discs and for wide ones, where it
/// is not radiance times solid angle: a disc of half angle t gives pi L sin^2 t, and has 2 pi (1 - cos
/// t) sr. By hand for t = 60 degrees: pi sr and 0.75 pi L.
#[test]
fn lights_have_the_irradiance_that_they_state() {
    let light = |words: &str| scene(LIGHT, words).lights.remove(0);
    let toward = DVec3::new(2.0, -1.0, 2.0) / 3.0;
    for solid_angle in [0.2, 1.5, PI, 6.0] {
        let disc = format!("solid_angle = {{ toward = [2, -1, 2], solid_angle_sr = {solid_angle}");
        let found = irradiance(&light(&format!("{disc}, irradiance = [1, 5, 7] }}")), toward);
        assert!((found / 5.0 - 1.0).abs() < 0.02, "{solid_angle} sr: {found}");
        let found = irradiance(&light(&format!("{disc}, radiance = [1, 5, 7] }}")), toward);
        let sin2 = 1.0 - (1.0 - solid_angle / (2.0 * PI)) * (1.0 - solid_angle / (2.0 * PI));
        assert!((found / (5.0 * PI * sin2) - 1.0).abs() < 0.02, "{solid_angle} sr: {found}");
    }
    let wide = irradiance(
        &light(&format!("solid_angle = {{ toward = [2, -1, 2], solid_angle_sr = {PI}, radiance = 1 }}")),
        toward,
    );
    assert!((wide / (0.75 * PI) - 1.0).abs() < 2e-3, "{wide}");
    // A sky gives pi L to every plane, half of one to a plane that faces its middle, and half as much
    // to a plane that stands on its edge.
    let sky = light("environment = { radiance = [1, 5, 7] }");
    let half = light("environment = { radiance = [1, 5, 7], hemisphere = [0, 0, 1] }");
    for (light, normal, expected) in [
        (&sky, toward, 5.0 * PI),
        (&half, DVec3::Z, 5.0 * PI),
        (&half, DVec3::X, 2.5 * PI),
        (&half, -DVec3::Z, 0.0),
    ] {
        let found = irradiance(light, normal);
        assert!((found - expected).abs() < 2e-3 * 5.0 * PI, "{normal}: {found} {expected}");
    }
    let sun = light("directional = { toward = [2, -1, 2], irradiance = [1, 5, 7] }");
    let sample = sun.sample(1, [0.3, 0.4]);
    assert!((sample.wi - toward).length() < 1e-15);
    assert_eq!((sample.radiance, sample.pdf), (5.0, None));
}

fn sensor(words: &str) -> Sensor {
    scene(SENSOR, words).sensor
}

/// Pixel, position in it from its upper left corner, and the direction that it looks in, not normalised.
/// 4 x 2 pixels with a vertical opening of 90 degrees: at unit distance the image is 2 high and 4 wide,
/// and pixels are squares of side 1.
#[test]
fn pixels_of_a_pinhole_look_where_they_have_to() {
    let down = sensor(
        "sensor.perspective = { resolution = [4, 2], position_mm = [0, 0, 5], look_at_mm = [0, 0, 0], \
         up = [0, 1, 0], fov_deg = 90 }",
    );
    // From +x, with an `up` that is not perpendicular to the view: right is +y, down is -z.
    let tilted = sensor(
        "sensor.perspective = { resolution = [4, 2], position_mm = [7, 0, 0], look_at_mm = [-1, 0, 0], \
         up = [1, 0, 1], fov_deg = 90 }",
    );
    for (pixel, at, right, below) in [
        (0, [0.0, 0.0], -2.0, -1.0),
        (0, [0.5, 0.5], -1.5, -0.5),
        (3, [1.0, 0.0], 2.0, -1.0),
        (4, [0.0, 1.0], -2.0, 1.0),
        (5, [0.25, 0.75], -0.75, 0.75),
        (6, [0.0, 0.0], 0.0, 0.0),
        (7, [1.0, 1.0], 2.0, 1.0),
    ] {
        for (sensor, pinhole, dir) in [
            (&down, DVec3::new(0.0, 0.0, 5.0), DVec3::new(right, -below, -1.0)),
            (&tilted, DVec3::new(7.0, 0.0, 0.0), DVec3::new(-1.0, right, -below)),
        ] {
            let found = sensor.ray(pixel, [at[0], at[1], 0.3, 0.6]);
            assert_eq!((found.slot, found.weight, found.ray.origin), (pixel, 1.0, pinhole));
            assert!((found.ray.dir - dir.normalize()).length() < 1e-14, "{pixel} {at:?}: {found:?}");
        }
    }
}

/// Where the line of a ray crosses the plane z = `z`.
fn at_height(ray: &Ray, z: f64) -> DVec3 {
    ray.at((z - ray.origin.z) / ray.dir.z)
}

/// 4 x 2 pixels on 8 mm: squares of side 2 about (1, 2). With `acceptance_sr` the image is sharp in its
/// own plane, and rays are tilted: u2 is the share of the cap's squared sine.
#[test]
fn pixels_of_parallel_rays_look_where_they_have_to() {
    let words = "resolution = [4, 2], center_mm = [1, 2, 0.25], toward = [0, 0, -1], up = [0, 1, 0], width_mm = 8";
    let parallel = sensor(&format!("sensor.orthographic = {{ {words} }}"));
    let accepting = sensor(&format!("sensor.orthographic = {{ {words}, acceptance_sr = {PI} }}"));
    for (pixel, at, x, y) in [
        (0, [0.0, 0.0], -3.0, 4.0),
        (0, [0.5, 0.5], -2.0, 3.0),
        (3, [1.0, 0.0], 5.0, 4.0),
        (5, [0.25, 0.75], -0.5, 0.5),
        (6, [0.0, 0.0], 1.0, 2.0),
        (7, [1.0, 1.0], 5.0, 0.0),
    ] {
        let found = parallel.ray(pixel, [at[0], at[1], 0.3, 0.6]);
        assert_eq!((found.slot, found.weight, found.ray.dir), (pixel, 1.0, -DVec3::Z));
        assert!((at_height(&found.ray, 0.25) - DVec3::new(x, y, 0.25)).length() < 1e-13, "{found:?}");
        assert!(found.ray.origin.z > 1.0, "before the body");
        for share in [0.0, 0.5] {
            let found = accepting.ray(pixel, [at[0], at[1], share, 0.6]);
            assert_eq!((found.slot, found.weight), (pixel, 1.0));
            let place = at_height(&found.ray, 0.25);
            assert!((place - DVec3::new(x, y, 0.25)).length() < 1e-12, "{found:?}");
            // A cap of pi sr has a half angle of 60 degrees.
            let sin2 = 1.0 - found.ray.dir.z * found.ray.dir.z;
            assert!((sin2 - 0.75 * share).abs() < 1e-12, "{share}: {found:?}");
        }
    }
}

/// A sky whose only bright column is that of azimuths from 0 to 90 degrees: turned by a quarter
/// counter-clockwise it shines from 90 to 180 degrees; upsampled, in the band of its colour alone.
#[test]
fn skies_are_turned_and_upsampled() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("sky.hdr");
    let mut bytes = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 4\n".to_vec();
    for pixel in 0..8 {
        bytes.extend(if pixel % 4 == 1 { [128, 0, 0, 129] } else { [0, 0, 0, 0u8] });
    }
    std::fs::write(&path, bytes).expect("a sky");
    let lit = |more: &str, bands: &str| {
        let light =
            format!("environment = {{ map = {:?}, scale = 2.0{more} }}", path.display().to_string());
        let text = GOOD.replace(LIGHT, &light).replace("bands = { rgb = {} }", bands);
        let experiment = good(&text);
        Builder::new(&experiment, &Shapes::new()).scene(0).unwrap_or_else(|error| panic!("{error}"))
    };
    let at = |scene: &Scene, band: usize, degrees: f64| {
        let azimuth = degrees.to_radians();
        let toward = DVec3::new(cos(azimuth), sin(azimuth), 0.3).normalize();
        scene.lights[0].eval(band, toward).0
    };
    let of = |scene: &Scene, band: usize| [45.0, 135.0, 225.0, 315.0].map(|d| at(scene, band, d));
    let rgb = "bands = { rgb = {} }";
    assert_eq!(of(&lit("", rgb), 0), [2.0, 0.0, 0.0, 0.0]);
    assert_eq!(of(&lit(", rotate_deg = 90", rgb), 0), [0.0, 2.0, 0.0, 0.0]);
    assert_eq!(of(&lit(", rotate_deg = -90", rgb), 0), [0.0, 0.0, 0.0, 2.0]);
    assert_eq!(of(&lit(", rotate_deg = 100", rgb), 0), [0.0, 2.0, 0.0, 0.0], "the nearest column");
    assert_eq!(of(&lit("", rgb), 1), [0.0; 4]);
    let spectral = "bands = { spectral = { from_nm = 400, to_nm = 700, count = 3 } }";
    let upsampled = lit(", upsampling = \"smooth\"", spectral);
    let [blue, green, red] = [0, 1, 2].map(|band| at(&upsampled, band, 45.0));
    assert!(red > 1.8 && blue < 0.1 && green < 0.6, "{blue} {green} {red}");
    assert_eq!(at(&upsampled, 2, 135.0), 0.0);
}
