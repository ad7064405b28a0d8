//! Importance-sampled BSSRDF integration on any surface, without a point cloud (King, Kulla, Conty & Fajardo 2013).
//!
//! A probe is a line through the body: its axis is the exit's normal (probability 1/2) or one of two tangents (1/4 each),
//! it passes the exit at distance r, drawn from a technique of the model of one band of the group, in a uniform
//! azimuth. All crossings of the line with the surface, of front and back faces, are entries. The expected number of
//! entries per area at a point x_i is
//!   pdf_area = sum over axes a of P(a) |n_i . a| times the mean over bands of sum over techniques of share pdf(r_a),
//! r_a being the distance of x_i from the axis a through the exit: the disc's density, carried from the disc across a to
//! the surface. All axes, bands and techniques that could have made an entry are in the sum, whichever made it (the
//! balance heuristic), so that
//!   L_r = mean over probes of sum over their entries of K T12 L cos / (pdf_light pdf_area)
//! is unbiased for every surface: the line meets all sheets of it, and at least one axis has |n_i . a| >= 1/sqrt 3.
//! On half-space and slab lines along tangents lie parallel to the surface and meet nothing; there the normal is
//! always taken.
//!
//! Normals: the geometric one carries areas, the shading one the Fresnel factor and the cosine.

use std::sync::Arc;

use super::bssrdf_single::score_single;
use super::crossing::other;
use super::emergence::{Emergence, Gather, Skin};
use super::illumination::{Illumination, PathStreams, groups_among};
use super::{Anomaly, BandUse, Bias, Cost, Estimator, Scores};
use crate::error::Result;
use crate::geometry::{Hit, Ray, Shape, Side};
use crate::math::{DVec3, Frame};
use crate::optics::bssrdf::Model;
use crate::sampling::radial::Radial;
use crate::sampling::stream::{PassKey, Stream};
use crate::scene::Scene;

/// What the estimator is built with.
#[derive(Clone, Debug, PartialEq)]
pub struct ProbeOptions {
    /// The model.
    pub model: Model,
    /// Lines per emergence, positive.
    pub probes: usize,
    /// Whether the single-scattering term is added; `None`: where the model leaves it out.
    pub single: Option<bool>,
    /// Whether light that goes straight through is followed.
    pub straight: bool,
    /// Entries farther from the exit than this are left out, mm.
    pub reach: Option<f64>,
}

/// The estimator, for one scene.
#[derive(Debug)]
pub struct BssrdfProbe {
    skin: Skin,
    lines: Lines,
    illumination: Illumination,
    probes: usize,
    single: bool,
    model: String,
    reach: Option<f64>,
}

impl BssrdfProbe {
    /// For a scene.
    ///
    /// # Errors
    /// A rough boundary; a medium that the model does not fit.
    pub fn new(scene: Arc<Scene>, options: &ProbeOptions) -> Result<BssrdfProbe> {
        let skin = Skin::new(scene, &options.model, options.straight)?;
        Ok(BssrdfProbe {
            lines: Lines::new(&skin),
            illumination: Illumination::new(&skin.scene),
            probes: options.probes,
            single: adds_single(&skin, options.single),
            model: options.model.to_string(),
            reach: options.reach,
            skin,
        })
    }
}

/// Whether single scattering is added to a model.
pub(super) fn adds_single(skin: &Skin, wanted: Option<bool>) -> bool {
    wanted.unwrap_or_else(|| skin.models.iter().any(|model| model.leaves_out_single))
}

impl Estimator for BssrdfProbe {
    fn pass(&self, bands: &[usize], key: &PassKey, scores: &mut Scores) {
        for group in groups_among(&self.skin, bands) {
            for index in 0..self.skin.scene.sensor.rays_per_pass() {
                let streams = PathStreams::new(&self.skin, key, index, &group);
                let mut gather = Probing { estimator: self, streams, hits: Vec::new() };
                self.skin.play(&group, index, key, scores, &mut gather);
            }
        }
    }

    fn band_use(&self) -> BandUse {
        BandUse::Shared
    }

    fn model(&self) -> Option<String> {
        Some(self.model.clone())
    }

    fn bias(&self) -> Bias {
        match self.reach {
            Some(reach) => Bias::Biased(format!("entries farther than {reach} mm are left out")),
            None => Bias::Unbiased,
        }
    }

    fn notes(&self) -> Vec<String> {
        self.skin.notes()
    }
}

struct Probing<'a> {
    estimator: &'a BssrdfProbe,
    streams: PathStreams,
    hits: Vec<Hit>,
}

impl Gather for Probing<'_> {
    fn gather(&mut self, emergence: &Emergence<'_>, scores: &mut Scores) {
        let BssrdfProbe { skin, lines, illumination, probes, single, reach, .. } = self.estimator;
        if *single {
            score_single(skin, illumination, emergence, &mut self.streams.single, scores);
        }
        let frame = Frame::about(emergence.exit.normal);
        let reach = reach.unwrap_or(f64::INFINITY);
        for _ in 0..*probes {
            let line = lines.draw(emergence, &frame, &mut self.streams.entries);
            if line.radius > reach {
                continue; // all its points are too far
            }
            self.hits.clear();
            line.cross(&skin.scene.shape, &mut self.hits, scores);
            for hit in &self.hits {
                let u = self.streams.lights.draw3();
                let offset = hit.point - emergence.exit.point;
                if offset.length() > reach {
                    continue;
                }
                let pdf_area = lines.pdf_area(emergence.bands, &frame, offset, hit.normal);
                illumination.enter(skin, emergence, hit, *probes as f64 * pdf_area, u, scores);
            }
        }
    }
}

/// How lines are drawn.
#[derive(Debug)]
struct Lines {
    /// Probabilities of tangent s, tangent t and normal.
    axes: [f64; 3],
    /// Per band, with their shares.
    techniques: Vec<Vec<(f64, Radial)>>,
}

/// A line along an axis, `radius` from the exit.
#[derive(Clone, Copy, Debug)]
struct Line {
    point: DVec3,
    axis: DVec3,
    radius: f64,
}

impl Lines {
    fn new(skin: &Skin) -> Lines {
        let axes = match *skin.scene.shape {
            Shape::HalfSpace | Shape::Slab { .. } => [0.0, 0.0, 1.0],
            _ => [0.25, 0.25, 0.5],
        };
        Lines { axes, techniques: skin.models.iter().map(|model| model.techniques()).collect() }
    }

    fn draw(&self, emergence: &Emergence<'_>, frame: &Frame, stream: &mut Stream) -> Line {
        let [u_axis, u_band, u_technique] = stream.draw3();
        let u = stream.draw2();
        let bands = emergence.bands;
        let axis = super::choice::choose_share(self.axes.into_iter(), u_axis);
        let [axis, across, along] = match axis {
            Some((0, _)) => [frame.s, frame.t, frame.n],
            Some((1, _)) => [frame.t, frame.n, frame.s],
            _ => [frame.n, frame.s, frame.t],
        };
        let band = bands[((u_band * bands.len() as f64) as usize).min(bands.len() - 1)];
        let techniques = &self.techniques[band];
        let shares = techniques.iter().map(|(share, _)| *share);
        let index = super::choice::choose_share(shares, u_technique).map_or(0, |(index, _)| index);
        let [x, y] = techniques[index].1.sample(u);
        let radius = (x * x + y * y).sqrt();
        Line { point: emergence.exit.point + across * x + along * y, axis, radius }
    }

    /// Expected number of entries of one line per mm^2 of a surface with this normal at `offset` from the exit.
    fn pdf_area(&self, bands: &[usize], frame: &Frame, offset: DVec3, normal: DVec3) -> f64 {
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
    /// All crossings with the surface. The line is followed from outside the body, by turns outside and inside, so
    /// that of neighbours along an edge exactly one is met.
    fn cross(&self, shape: &Shape, hits: &mut Vec<Hit>, scores: &mut Scores) {
        let Some(mut ray) = self.start(shape) else { return };
        let (mut side, mut from) = (Side::Outside, None);
        loop {
            scores.count(Cost::Rays);
            let Some(hit) = shape.intersect(&ray, side, from, f64::INFINITY) else {
                if side == Side::Inside && shape.bounds().is_some() {
                    scores.note(Anomaly::LostRay);
                }
                return;
            };
            ray.origin = hit.point;
            from = Some(hit.face);
            side = other(side);
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
#[path = "bssrdf_probe_tests.rs"]
mod tests;
