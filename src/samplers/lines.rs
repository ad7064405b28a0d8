//! Crossings of lines with a sphere about a point of it: the entries of BSSRDF probes.
//!
//! A line meets a sphere twice or not at all. One of the two is the outcome, by a fair coin, so that the
//! density is half the expected number of crossings per area. The point is the pole at +z. Chart: x = l
//! / (l + d) with the distance d from the pole and a length l of the densities, azimuth in turns; in
//! distance from a point of it a sphere's area is dA = 2 pi d dd, and |dd/dx| = l / x^2.

use std::f64::consts::{SQRT_2, TAU};

use schemars::JsonSchema;
use serde::Deserialize;

use super::kind::{SamplerKind, sampler_kind};
use super::sampler::{Coordinate, Draw, Null, Piece, Sampler, turns};
use crate::geometry::{Lines, Shape};
use crate::math::{DVec3, Frame, sin_cos_turns};
use crate::sampling::radial::Radial;
use crate::sampling::stream::Stream;

/// `probe_crossings` in experiment files: Gaussians of variance 1/sigma^2, which have no pole.
pub const KIND: SamplerKind = sampler_kind!(
    "probe_crossings",
    "where a BSSRDF's probes through a sphere cross its surface",
    ProbedSphere => |o| {
        let gaussian =
            |sigma: &f64| Radial::Gaussian { variance: 1.0 / (sigma * sigma), r_max: f64::INFINITY };
        let densities = o.sigma_per_mm.iter().map(gaussian).collect();
        let mean = o.sigma_per_mm.iter().sum::<f64>() / o.sigma_per_mm.len() as f64;
        Ok(LineSampler::new(o.radius_mm, densities, 1.0 / mean))
    }
);

/// Options of `probe_crossings`.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct ProbedSphere {
    /// Radius of the sphere, mm.
    #[schemars(extend("exclusiveMinimum" = 0))]
    radius_mm: f64,
    /// A Gaussian per band: the density of the distance from the axis, of standard deviation 1/this mm.
    #[schemars(length(min = 1), inner(range(min = 0.001)))]
    sigma_per_mm: Vec<f64>,
}

/// Lines about the pole of a sphere.
pub struct LineSampler {
    code: Lines,
    shape: Shape,
    bands: Vec<usize>,
    radius: f64,
    length: f64,
}

impl LineSampler {
    /// A sphere of radius `radius` mm, a radial density a band, and a length of theirs, mm.
    pub fn new(radius: f64, densities: Vec<Radial>, length: f64) -> LineSampler {
        let shape = Shape::Sphere { radius };
        let bands = (0..densities.len()).collect();
        let techniques = densities.into_iter().map(|density| vec![(1.0, density)]).collect();
        LineSampler { code: Lines::new(&shape, techniques), shape, bands, radius, length }
    }

    fn pole(&self) -> (DVec3, Frame) {
        (DVec3::new(0.0, 0.0, self.radius), Frame::about(DVec3::Z))
    }

    fn chart(&self, d: f64) -> f64 {
        self.length / (self.length + d)
    }

    /// The density at a point of the sphere, per unit of the chart.
    fn per_chart(&self, point: DVec3, x: f64) -> f64 {
        let (pole, frame) = self.pole();
        let pdf_area = self.code.pdf_area(&self.bands, &frame, point - pole, point / self.radius);
        let d = self.length * (1.0 - x) / x;
        0.5 * pdf_area * TAU * d * self.length / (x * x)
    }
}

impl Sampler for LineSampler {
    fn draw(&self, stream: &mut Stream) -> Draw {
        let (pole, frame) = self.pole();
        let line = self.code.draw(pole, &frame, &self.bands, stream);
        let second = usize::from(stream.draw() < 0.5);
        let mut hits = Vec::new();
        let met = line.cross(&self.shape, &mut hits);
        match hits.get(second) {
            Some(hit) if !met.is_lost => {
                let x = self.chart((hit.point - pole).length());
                let at = [x, turns(hit.point.x, hit.point.y)];
                Draw::Point { piece: 0, at, density: self.per_chart(hit.point, x) }
            }
            _ => Draw::Null,
        }
    }

    /// The cosine between a surface's normal and an axis has kinks where it changes sign.
    fn pieces(&self) -> Vec<Piece> {
        let [far, equator] = [2.0, SQRT_2].map(|d| self.chart(d * self.radius));
        let distance = Coordinate { range: [far, 1.0], kinks: vec![equator], periodic: false };
        let azimuth = Coordinate { range: [0.0, 1.0], kinks: vec![0.25, 0.5, 0.75], periodic: true };
        vec![Piece::plane("crossings", [distance, azimuth])]
    }

    fn density(&self, _: usize, [x, turn]: [f64; 2]) -> f64 {
        let d = self.length * (1.0 - x) / x;
        let z = self.radius - d * d / (2.0 * self.radius);
        let (sin, cos) = sin_cos_turns(turn);
        let across = (self.radius * self.radius - z * z).max(0.0).sqrt();
        self.per_chart(DVec3::new(across * cos, across * sin, z), x)
    }

    fn null(&self) -> Null {
        Null::Remainder
    }
}
