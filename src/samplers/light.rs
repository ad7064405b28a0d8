//! Lights at infinity.

use std::f64::consts::{PI, TAU};

use super::{Axis, Contrast, Draw, Piece, Sampler, turns};
use crate::math::{DVec3, Frame, acos, cos, sin, sin_cos_turns};
use crate::sampling::stream::Stream;
use crate::scene::{Emission, LatLong, Light};

/// A cap of directions of uniform radiance: chart (1 - cos) / height and azimuth, of solid angle
/// 2 pi height per unit of both (Archimedes). Height 1 is the hemisphere, 2 a constant environment.
pub struct CapSampler {
    light: Light,
    frame: Frame,
    height: f64,
}

impl CapSampler {
    /// For this solid angle, sr.
    pub fn new(solid_angle: f64) -> CapSampler {
        // The whole sphere is asked for by name: 2 to the last bit.
        let height =
            if (solid_angle / (2.0 * TAU) - 1.0).abs() < 1e-9 { 2.0 } else { solid_angle / TAU };
        let frame = Frame::about(DVec3::new(0.48, -0.6, 0.64));
        let emission = Emission::Cap { frame, height, radiance: vec![3.0] };
        CapSampler { light: Light { name: "cap".into(), emission }, frame, height }
    }
}

impl Sampler for CapSampler {
    fn draw(&self, stream: &mut Stream) -> Draw {
        let sample = self.light.sample(0, stream.draw2());
        // |wi - n|^2 / 2 = 1 - cos, with all its digits in a small cap.
        let below = 0.5 * (sample.wi - self.frame.n).length_squared();
        let local = self.frame.to_local(sample.wi);
        let x = below / self.height;
        // A direction within rounding of the rim is inside, one farther out is not.
        let x = if x < 1.0 + 1e-11 { x.min(1.0) } else { x };
        let at = [x, turns(local.x, local.y)];
        let density = sample.pdf.unwrap_or(0.0) * TAU * self.height;
        Draw::Point { piece: 0, at, density }
    }

    fn pieces(&self) -> Vec<Piece> {
        vec![Piece::plane("directions", [Axis::over(0.0, 1.0), Axis::turns()])]
    }

    fn density(&self, _piece: usize, [x, turns]: [f64; 2]) -> f64 {
        let below = self.height * x;
        let (s, c) = sin_cos_turns(turns);
        let r = (below * (2.0 - below)).max(0.0).sqrt();
        let wi = self.frame.to_world(DVec3::new(r * c, r * s, 1.0 - below));
        self.light.eval(0, wi).1 * TAU * self.height
    }

    fn contrasts(&self) -> Vec<Contrast> {
        vec![Contrast::of("mean depth in the cap", Some(0.5), |[x, _]| x), Contrast::azimuth()]
    }
}

/// A latitude-longitude map, charted by its image: columns over [0, 1] from the left, rows over [0, 1] from
/// the top. A row coordinate y is the angle pi y from +z, a column coordinate x the azimuth of half a turn
/// less x turns, so d omega = 2 pi^2 sin(pi y) dx dy. The density jumps at the edges of texels, which are
/// kinks of both axes.
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
        let axis = |count: usize| Axis {
            kinks: (1..count).map(|k| k as f64 / count as f64).collect(),
            ..Axis::over(0.0, 1.0)
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
