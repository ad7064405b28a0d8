//! Importance-sampled BSSRDF integration on any surface, without a point cloud (King, Kulla, Conty &
//! Fajardo 2013).
//!
//! A probe is a line through the body: its axis is the exit's normal (probability 1/2) or one of two
//! tangents (1/4 each), it passes the exit at distance r, drawn from a technique of the model of one
//! band of the group, in a uniform azimuth. All crossings of the line with the surface, of front and
//! back faces, are entries. The expected number of entries per area at a point x_i is
//!   pdf_area = sum over axes a of P(a) |n_i . a| times the mean over bands of sum over techniques of
//!   share pdf(r_a),
//! r_a being the distance of x_i from the axis a through the exit: the disc's density, carried from the
//! disc across a to the surface. All axes, bands and techniques that could have made an entry are in the
//! sum, whichever made it (the balance heuristic), so that
//!   L_r = mean over probes of sum over their entries of K T12 L cos / (pdf_light pdf_area)
//! is unbiased for every surface: the line meets all sheets of it, and at least one axis has
//! |n_i . a| at least 1/sqrt 3. On half-space and slab lines along tangents lie parallel to the surface and meet
//! nothing; there the normal is always taken.
//!
//! Normals: the geometric one carries areas, the shading one the Fresnel factor and the cosine.

use std::sync::Arc;

use schemars::JsonSchema;
use serde::Deserialize;

use super::bssrdf_single::score_single;
use super::emergence::{BssrdfScene, Emergence, Gather, PathStreams};
use super::{Anomaly, BandUse, Bias, Cost, Estimator, EstimatorKind, Scores, Serves, read_options};
use crate::error::Result;
use crate::geometry::{Hit, Lines};
use crate::math::Frame;
use crate::optics::bssrdf::Model;
use crate::sampling::stream::PassKey;
use crate::scene::Scene;

/// Options of `bssrdf_probe`.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ProbeOptions {
    /// BSSRDF model.
    pub model: Model,
    /// Lines per refraction of a camera path.
    #[serde(default = "super::kind::one")]
    #[schemars(range(min = 1, max = 65536))]
    pub probes: usize,
    /// Whether single scattering is added by sampling; by default where the model leaves it out.
    pub single: Option<bool>,
    /// Whether light that goes straight through the body is followed.
    #[serde(default = "super::kind::on")]
    pub straight: bool,
    /// Light that enters farther from the exit than this is left out, mm; biased. By default none is left out.
    #[serde(rename = "reach_mm")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub reach: Option<f64>,
}

/// The estimator, for one scene.
#[derive(Debug)]
pub struct BssrdfProbe {
    bssrdf: BssrdfScene,
    lines: Lines,
    probes: usize,
    reach: Option<f64>,
}

impl BssrdfProbe {
    /// `bssrdf_probe` in experiment files.
    pub const KIND: EstimatorKind = EstimatorKind {
        kind: "bssrdf_probe",
        doc: "a BSSRDF integrated by lines through the body near the exit; unbiased for the model without `reach_mm`",
        serves: Serves::BSSRDF,
        options_schema: || schemars::schema_for!(ProbeOptions),
        build: |options, scene| Ok(Box::new(BssrdfProbe::new(scene, &read_options(options)?)?)),
    };

    /// For a scene.
    ///
    /// # Errors
    /// A scene that it does not serve; a medium that the model does not fit.
    pub fn new(scene: Arc<Scene>, options: &ProbeOptions) -> Result<BssrdfProbe> {
        BssrdfProbe::KIND.check(&scene)?;
        let bssrdf = BssrdfScene::new(scene, &options.model, options.straight, options.single)?;
        Ok(BssrdfProbe {
            lines: Lines::new(
                &bssrdf.scene.shape,
                bssrdf.models.iter().map(|model| model.techniques()).collect(),
            ),
            probes: options.probes,
            reach: options.reach,
            bssrdf,
        })
    }
}

impl Estimator for BssrdfProbe {
    fn pass(&self, bands: &[usize], key: &PassKey, scores: &mut Scores) {
        self.bssrdf.pass(bands, key, scores, |_| Probing { estimator: self, hits: Vec::new() });
    }

    fn band_use(&self) -> BandUse {
        BandUse::Shared
    }

    fn model(&self) -> Option<String> {
        Some(self.bssrdf.model.clone())
    }

    fn bias(&self) -> Bias {
        match self.reach {
            Some(reach) => Bias::Biased(format!("entries farther than {reach} mm are left out")),
            None => Bias::Unbiased,
        }
    }

    fn notes(&self) -> Vec<String> {
        self.bssrdf.notes()
    }
}

struct Probing<'a> {
    estimator: &'a BssrdfProbe,
    hits: Vec<Hit>,
}

impl Gather for Probing<'_> {
    fn gather(&mut self, emergence: &Emergence<'_>, streams: &mut PathStreams, scores: &mut Scores) {
        let BssrdfProbe { bssrdf, lines, probes, reach } = self.estimator;
        score_single(bssrdf, emergence, &mut streams.single, scores);
        let frame = Frame::about(emergence.exit.normal);
        let reach = reach.unwrap_or(f64::INFINITY);
        for _ in 0..*probes {
            let line = lines.draw(emergence.exit.point, &frame, emergence.bands, &mut streams.entries);
            if line.radius > reach {
                continue; // all its points are too far
            }
            self.hits.clear();
            let met = line.cross(&bssrdf.scene.shape, &mut self.hits);
            scores.count_many(Cost::Rays, met.rays);
            if met.is_lost {
                scores.note(Anomaly::LostRay);
            }
            for hit in &self.hits {
                let u = streams.lights.draw3();
                let offset = hit.point - emergence.exit.point;
                if offset.length() > reach {
                    continue;
                }
                let pdf_area = lines.pdf_area(emergence.bands, &frame, offset, hit.normal);
                bssrdf.enter(emergence, hit, *probes as f64 * pdf_area, u, scores);
            }
        }
    }
}

#[cfg(test)]
#[path = "bssrdf_probe_tests.rs"]
mod tests;
