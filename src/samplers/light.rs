//! Lights at infinity.

use std::f64::consts::{PI, TAU};

use schemars::JsonSchema;
use serde::Deserialize;

use super::chart::{Charted, Directions, Grade, Measure, Technique};
use super::kind::{SamplerKind, sampler_kind};
use super::sampler::{Contrast, Coordinate, Draw, Piece, Sampler, turns};
use crate::math::{DVec3, Frame, acos, cos, sin, sin_cos_turns};
use crate::sampling::stream::Stream;
use crate::scene::{Emission, LatLong, Light};

/// `solid_angle_light` in experiment files.
pub const CAP: SamplerKind = sampler_kind!(
    "solid_angle_light",
    "directions to a cap of uniform radiance, up to the whole sphere",
    CapOptions => |o| {
        // The whole sphere is asked for by name: 2 to the last bit.
        let is_sphere = (o.solid_angle_sr / (2.0 * TAU) - 1.0).abs() < 1e-9;
        let height = if is_sphere { 2.0 } else { o.solid_angle_sr / TAU };
        let chart = Directions::graded(CapGrade { height });
        let emission = Emission::Cap { frame: chart.frame, height, radiance: vec![3.0] };
        Ok(Charted::new(CapLight(Light { name: "cap".into(), emission }), chart))
    }
);

/// Options of `solid_angle_light`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct CapOptions {
    /// Solid angle; 12.566370614359172 is the whole sphere.
    #[schemars(extend("exclusiveMinimum" = 0), range(max = 12.566370614359174))]
    solid_angle_sr: f64,
}

/// (1 - cos) / height, of solid angle 2 pi height per unit and turn (Archimedes). Height 1 is the
/// hemisphere, 2 a constant environment.
struct CapGrade {
    height: f64,
}

impl Grade for CapGrade {
    fn coordinate(&self, frame: &Frame, dir: DVec3) -> (f64, Measure) {
        // |wi - n|^2 / 2 = 1 - cos, with all its digits in a small cap.
        let below = 0.5 * (dir - frame.n).length_squared();
        let x = below / self.height;
        // A direction within rounding of the rim is inside, one farther out is not.
        (if x < 1.0 + 1e-11 { x.min(1.0) } else { x }, Measure([TAU, self.height, 1.0]))
    }

    fn local(&self, x: f64, (s, c): (f64, f64)) -> (DVec3, Measure) {
        let below = self.height * x;
        let r = (below * (2.0 - below)).max(0.0).sqrt();
        (DVec3::new(r * c, r * s, 1.0 - below), Measure([TAU, self.height, 1.0]))
    }
}

/// A cap of directions of uniform radiance.
struct CapLight(Light);

impl Technique<Directions<CapGrade>> for CapLight {
    fn sample(&self, stream: &mut Stream) -> (DVec3, Option<f64>) {
        let sample = self.0.sample(0, stream.draw2());
        (sample.wi, Some(sample.pdf.unwrap_or(0.0)))
    }

    fn pdf(&self, wi: DVec3) -> f64 {
        self.0.eval(0, wi).1
    }

    fn contrasts(&self, _chart: &Directions<CapGrade>) -> Vec<Contrast> {
        vec![Contrast::of("mean depth in the cap", Some(0.5), |[x, _]| x), Contrast::azimuth()]
    }
}

/// `lat_long_light` in experiment files.
pub const LAT_LONG: SamplerKind = sampler_kind!(
    "lat_long_light",
    "directions to a latitude-longitude map with a bright spot and a black part",
    LatLongOptions => |LatLongOptions { resolution: [width, height] }| {
        Ok(LatLongSampler::new(width as usize, height as usize))
    }
);

/// Options of `lat_long_light`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct LatLongOptions {
    /// Columns and rows.
    #[schemars(inner(range(min = 4, max = 1024)))]
    resolution: [u32; 2],
}

/// A latitude-longitude map, charted by its image: columns over [0, 1] from the left, rows over [0, 1]
/// from the top. A row coordinate y is the angle pi y from +z, a column coordinate x the azimuth of half
/// a turn less x turns, so d omega = 2 pi^2 sin(pi y) dx dy. The density jumps at the edges of texels,
/// which are kinks of both axes.
pub struct LatLongSampler {
    light: Light,
    size: [usize; 2],
}

impl LatLongSampler {
    /// A sky of `width` x `height` texels: a gradient that is brightest at the poles' rows, a black
    /// quarter, and a spot of 1000 times the rest near a corner of the map.
    pub fn new(width: usize, height: usize) -> LatLongSampler {
        let texel = |row: usize, column: usize| {
            let is_black = row >= height / 2 && column >= width / 2 && row + 1 < height;
            let is_spot = row == 1 && column == width - 1;
            let is_polar = row == 0 || row + 1 == height;
            match () {
                _ if is_spot => 1000.0,
                _ if is_black => 0.0,
                _ => 1.0 + (row + column % 3) as f64 + if is_polar { 20.0 } else { 0.0 },
            }
        };
        let plane = (0..width * height).map(|k| texel(k / width, k % width)).collect();
        let map = LatLong::new(width, height, vec![plane]);
        let light = Light { name: "map".into(), emission: Emission::Map(std::sync::Arc::new(map)) };
        LatLongSampler { light, size: [width, height] }
    }

    fn solid_angle(y: f64) -> f64 {
        TAU * PI * sin(PI * y)
    }
}

impl Sampler for LatLongSampler {
    fn draw(&self, stream: &mut Stream) -> Draw {
        let sample = self.light.sample(0, stream.draw2());
        let wi = sample.wi;
        let at = [(0.5 - turns(wi.x, wi.y)).rem_euclid(1.0), acos(wi.z.clamp(-1.0, 1.0)) / PI];
        let density = sample.pdf.unwrap_or(0.0) * LatLongSampler::solid_angle(at[1]);
        Draw::Point { piece: 0, at, density }
    }

    fn pieces(&self) -> Vec<Piece> {
        let axis = |count: usize| Coordinate {
            kinks: (1..count).map(|k| k as f64 / count as f64).collect(),
            ..Coordinate::over(0.0, 1.0)
        };
        vec![Piece::plane("map", self.size.map(axis))]
    }

    fn density(&self, _piece: usize, [x, y]: [f64; 2]) -> f64 {
        let (s, c) = sin_cos_turns(0.5 - x);
        let r = sin(PI * y);
        self.light.eval(0, DVec3::new(r * c, r * s, cos(PI * y))).1 * LatLongSampler::solid_angle(y)
    }

    fn contrasts(&self) -> Vec<Contrast> {
        vec![
            Contrast::of("mean height", None, |[_, y]| cos(PI * y)),
            Contrast::of("mean x", None, |[x, y]| sin_cos_turns(0.5 - x).1 * sin(PI * y)),
        ]
    }
}
