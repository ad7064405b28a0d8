//! The point-cloud method for BSSRDFs (Dal Corso & Frisvad 2018: direct Monte Carlo integration, two
//! phases).
//!
//! Phase one runs once per pass. It draws M points of the surface with density f per area and at each point
//! one direction to a light, and stores the flux Phi = E / f that enters there. Phase two, for each camera
//! path that is refracted into the body at x_o, computes
//!   L_r = 1/M sum_p S(x_p, x_o) Phi_p B_p / p(d_p),
//!   B_p = 1 with probability p(d_p), d_p = |x_o - x_p|,
//! which is the paper's V(xi, e^(-sigma_tr d)) e^(+sigma_tr d) for p(d) = e^(-sigma_tr d). Given the points
//! E[B_p / p] = 1, and over the points each term has mean int S E dA for every p > 0. The estimator is thus
//! unbiased with respect to the model, which does not include visibility inside the body. p determines the
//! variance: the second moment of a term is E[(S Phi)^2 / p], and where p falls faster than S^2, it grows
//! with the size of the body ([`AcceptanceRule`]).
//!
//! The camera path is refracted with probability T21, so the kernel leaves T21 out (`emergence.rs`). A light
//! is chosen by strength, and a shadow ray is traced. Pixels of a pass share the points: their errors are
//! correlated within a pass, and independent between passes, because each pass has its own points.

mod cloud;

use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use self::cloud::Cloud;
use super::bssrdf_single::score_single;
use super::emergence::{BssrdfScene, Emergence, Gather, PathStreams};
use super::{
    Anomaly, BandUse, Bodies, Cost, Estimator, EstimatorKind, HeavyTail, Scores, Serves, TransportClass,
    read_options,
};
use crate::error::{Error, Result};
use crate::geometry::{BodySampler, FaceChoice};
use crate::optics::bssrdf::Model;
use crate::sampling::stream::{PassKey, Stream};
use crate::sampling::thinning::{Accepted, ThinningForm, ThinningRule, ThinningWork, scan};
use crate::scene::Scene;

pub use crate::sampling::thinning::Search;

/// The probability p(d) with which a point at distance d is evaluated; its weight is 1/p.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum AcceptanceRule {
    /// 1: every point is evaluated.
    All {},
    /// e^(-sigma_tr d) of each band by itself.
    Band {},
    /// e^(-m d), m the mean of sigma_tr over the bands: as published for RGB.
    ///
    /// In a band with sigma_tr < m/2 the variance grows exponentially with the size of the body.
    Mean {},
    /// e^(-m d), m the smallest sigma_tr: bounded in every band, and accepts the most.
    Minimum {},
    /// The mean over the bands of e^(-sigma_tr d): bounded in every band, accepts fewer than the
    /// smallest does.
    MeanOfExponentials {},
    /// max(e^(-m d), this), m the mean of sigma_tr.
    Floor(#[schemars(extend("exclusiveMinimum" = 0), range(max = 1.0))] f64),
    /// Proportional to the kernel.
    ///
    /// More precisely, to the mean over the bands of kernel over integral, scaled to accept as many points as
    /// the mean of exponentials on a disc as wide as the body.
    Kernel {},
}

impl Default for AcceptanceRule {
    fn default() -> Self {
        AcceptanceRule::Kernel {}
    }
}

/// ln of the growth of the variance beyond which a mean is not judged.
const HEAVY: f64 = 3.0;

/// Options of `point_cloud`.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PointCloudOptions {
    /// BSSRDF model.
    pub model: Model,
    /// Points of the surface that a pass draws.
    #[serde(default = "ten_thousand")]
    #[schemars(range(min = 1, max = 1073741824))]
    pub samples: usize,
    /// How points are drawn: faces (triangles) by area, or by index as published.
    #[serde(default)]
    pub faces: FaceChoice,
    /// The probability p(d) with which a point at distance d is evaluated; its weight is 1/p.
    #[serde(default)]
    pub acceptance: AcceptanceRule,
    /// How accepted points are found; both choices have the same distribution.
    #[serde(default)]
    pub search: Search,
    /// Whether single scattering is added by sampling; by default where the model leaves it out.
    pub single: Option<bool>,
    /// Whether light that goes straight through the body is followed.
    #[serde(default = "crate::estimators::kind::on")]
    pub straight: bool,
}

fn ten_thousand() -> usize {
    10_000
}

/// The estimator, for one scene.
#[derive(Debug)]
pub struct PointCloud {
    bssrdf: BssrdfScene,
    sampler: BodySampler,
    options: PointCloudOptions,
    /// Per group of the bssrdf: which bands accept by which rule.
    rules: Vec<(Vec<usize>, ThinningRule)>,
}

impl PointCloud {
    /// `point_cloud` in experiment files.
    pub const KIND: EstimatorKind = EstimatorKind {
        kind: "point_cloud",
        doc: "a BSSRDF summed over points of the surface, accepted by distance; unbiased for the model",
        serves: Serves { bodies: Bodies::Finite, emission: true, ..Serves::BSSRDF },
        options_schema: || schemars::schema_for!(PointCloudOptions),
        build: |options, scene| Ok(Box::new(PointCloud::new(scene, read_options(options)?)?)),
    };

    /// For a scene.
    ///
    /// # Errors
    /// A scene that it does not serve; a medium that the model does not fit.
    pub fn new(scene: Arc<Scene>, options: PointCloudOptions) -> Result<PointCloud> {
        PointCloud::KIND.check(&scene)?;
        let (Some(sampler), Some(bounds)) =
            (BodySampler::new(&scene.shape, options.faces), scene.shape.bounds())
        else {
            return Err(Error::input("point_cloud needs a finite body"));
        };
        let bssrdf = BssrdfScene::new(scene, &options.model, options.straight, options.single)?;
        let rules = rules(&bssrdf, options.acceptance, 2.0 * bounds.radius);
        Ok(PointCloud { bssrdf, sampler, options, rules })
    }
}

/// The bands that accept together, and their rule; all of them refract alike.
fn rules(
    bssrdf: &BssrdfScene,
    acceptance: AcceptanceRule,
    diameter: f64,
) -> Vec<(Vec<usize>, ThinningRule)> {
    let sigmas: Vec<f64> = bssrdf.models.iter().map(|model| model.sigma_tr).collect();
    let mean = sigmas.iter().sum::<f64>() / sigmas.len() as f64;
    let common = match acceptance {
        AcceptanceRule::All {} => ThinningForm::All,
        AcceptanceRule::Mean {} => ThinningForm::Exponential { sigma: mean },
        AcceptanceRule::Minimum {} | AcceptanceRule::Band {} => ThinningForm::Exponential {
            sigma: sigmas.iter().fold(f64::INFINITY, |least, &s| least.min(s)),
        },
        AcceptanceRule::MeanOfExponentials {} => {
            ThinningForm::MeanOfExponentials { sigmas: sigmas.clone() }
        }
        AcceptanceRule::Floor(least) => ThinningForm::Floor { sigma: mean, least },
        AcceptanceRule::Kernel {} => in_proportion(bssrdf, &sigmas, diameter),
    };
    if acceptance == (AcceptanceRule::Band {}) {
        let own = |band: usize| {
            (vec![band], ThinningRule::new(ThinningForm::Exponential { sigma: sigmas[band] }))
        };
        return bssrdf.groups.iter().flatten().map(|&band| own(band)).collect();
    }
    let rule = ThinningRule::new(common);
    bssrdf.groups.iter().map(|group| (group.clone(), rule.clone())).collect()
}

/// Accepts in proportion to the kernels, on average over a disc of radius `reach` as many as the mean of
/// exponentials: int_0^R e^(-s d) 2 d dd / R^2 = 2 (1 - (1 + a) e^(-a)) / a^2 with a = s R.
fn in_proportion(bssrdf: &BssrdfScene, sigmas: &[f64], reach: f64) -> ThinningForm {
    use crate::math::{exp, integrate};
    let mean_of = |sigma: f64| {
        let a = sigma * reach;
        if a < 1e-3 { 1.0 - 2.0 / 3.0 * a } else { 2.0 * (1.0 - (1.0 + a) * exp(-a)) / (a * a) }
    };
    let mean = sigmas.iter().map(|&sigma| mean_of(sigma)).sum::<f64>() / sigmas.len() as f64;
    let whole: Vec<f64> = bssrdf
        .models
        .iter()
        // In x = sqrt(d / R) the profile is smooth at 0 too: d = R x^2, d dd = 2 R^2 x^3 dx.
        .map(|model| integrate(|x| model.falloff(reach * x * x) * x * x * x, 0.0, 1.0, 1e-12).value)
        .collect();
    let falloff = |d: f64| {
        let d = d.max(1e-6 * reach); // some profiles have a pole
        bssrdf.models.iter().zip(&whole).map(|(model, whole)| model.falloff(d) / whole).sum::<f64>()
    };
    ThinningForm::proportional(falloff, reach, mean.min(1.0))
}

impl Estimator for PointCloud {
    fn pass(&self, bands: &[usize], key: &PassKey, scores: &mut Scores) {
        let cloud = Cloud::new(&self.bssrdf, &self.sampler, self.options.samples, key);
        scores.count_many(Cost::CloudPoints, cloud.len() as u64);
        scores.count_many(Cost::ShadowRays, cloud.shadow_rays);
        scores.anomalies[Anomaly::WrongSide as usize] += cloud.wrong_side;
        self.bssrdf.pass(bands, key, scores, |_| CloudSum { estimator: self, cloud: &cloud });
    }

    fn band_use(&self) -> BandUse {
        BandUse::Shared
    }

    fn model(&self) -> Option<String> {
        Some(self.bssrdf.model.clone())
    }

    /// Under p = e^(-m d) an accepted term of a band with effective transport s has weights like e^((m -
    /// s) d), with a Pareto tail of index m / (m - s) on an unbounded surface: of infinite variance
    /// where m exceeds 2 s. A finite body cuts the tail off at its diameter D; the variance has then
    /// grown by about e^((m - 2 s) D).
    fn heavy_tails(&self) -> Vec<HeavyTail> {
        if self.options.acceptance != (AcceptanceRule::Mean {}) {
            return Vec::new(); // weights of all other rules are bounded by what the kernel loses, or by their floor
        }
        let diameter =
            self.bssrdf.scene.shape.bounds().map_or(f64::INFINITY, |bounds| 2.0 * bounds.radius);
        let sigmas = || self.bssrdf.models.iter().map(|model| model.sigma_tr);
        let mean = sigmas().sum::<f64>() / sigmas().count() as f64;
        let heavy = sigmas().enumerate().filter(|(_, s)| (mean - 2.0 * s) * diameter > HEAVY);
        heavy
            .map(|(band, s)| HeavyTail {
                band,
                class: TransportClass::Multiple,
                reason: format!(
                    "accepted by the mean of sigma_tr, {mean:.3}/mm, a band of {s:.3}/mm has tail index {:.2} on \
                     a body {diameter:.3} mm wide",
                    mean / (mean - s)
                ),
            })
            .collect()
    }

    fn notes(&self) -> Vec<String> {
        self.bssrdf.notes()
    }

    fn working_bytes(&self) -> usize {
        Cloud::bytes(&self.bssrdf, self.options.samples)
    }
}

/// L_r of one camera path.
struct CloudSum<'a> {
    estimator: &'a PointCloud,
    cloud: &'a Cloud,
}

impl Gather for CloudSum<'_> {
    fn gather(&mut self, emergence: &Emergence<'_>, streams: &mut PathStreams, scores: &mut Scores) {
        let PointCloud { bssrdf, rules, .. } = self.estimator;
        for (bands, rule) in rules {
            let is_here = |band: &usize| emergence.bands.contains(band);
            let bands: Vec<usize> = bands.iter().copied().filter(is_here).collect();
            if !bands.is_empty() {
                self.sum(&bands, rule, emergence, &mut streams.entries, scores);
            }
        }
        score_single(bssrdf, emergence, &mut streams.single, scores);
    }
}

impl CloudSum<'_> {
    /// The sum over accepted points in bands that accept together.
    fn sum(
        &self,
        bands: &[usize],
        rule: &ThinningRule,
        emergence: &Emergence<'_>,
        stream: &mut Stream,
        scores: &mut Scores,
    ) {
        let PointCloud { bssrdf, options, .. } = self.estimator;
        let search = options.search;
        let (cloud, models, at) = (self.cloud, &bssrdf.models, emergence.exit.point);
        let lights = bssrdf.scene.lights.len();
        let mut sums = vec![0.0; bands.len() * lights];
        let mut work = ThinningWork::default();
        let mut batch = Batch::none();
        let mut add = |batch: &mut Batch| {
            let Batch { count, places, distances, weights } = &*batch;
            let (count, mut kernels) = (*count, [0.0; BATCH]);
            for (k, &band) in bands.iter().enumerate() {
                let (model, kernels) = (&models[band], &mut kernels[..count]);
                if model.needs_directions() {
                    for (kernel, &place) in kernels.iter_mut().zip(places) {
                        *kernel = model.kernel(&cloud.entry(place, emergence.eta), &emergence.exit);
                    }
                } else {
                    model.kernels(&distances[..count], kernels);
                }
                for ((kernel, &place), weight) in kernels.iter().zip(places).zip(weights) {
                    sums[k * lights + cloud.light(place)] += kernel * cloud.flux(place, band) * weight;
                }
            }
            batch.count = 0;
        };
        let accept = |accepted: Accepted| {
            batch.push(accepted);
            if batch.count == BATCH {
                add(&mut batch);
            }
        };
        match search {
            Search::Hierarchy => cloud.tree.thin(at, rule, stream, &mut work, accept),
            Search::Scan => scan(cloud.tree.axes(), 0..cloud.len(), at, rule, stream, &mut work, accept),
        }
        add(&mut batch);
        count(scores, search, &work, bands.len());
        for (k, sum) in sums.into_iter().enumerate() {
            let (band, light) = (bands[k / lights], k % lights);
            let value = emergence.throughput_of(band) * sum;
            scores.add(emergence.slot, band, TransportClass::Multiple, light, value);
        }
    }
}

/// Accepted points whose kernels are evaluated together.
struct Batch {
    count: usize,
    places: [usize; BATCH],
    distances: [f64; BATCH],
    weights: [f64; BATCH],
}

const BATCH: usize = 128;

impl Batch {
    fn none() -> Batch {
        Batch { count: 0, places: [0; BATCH], distances: [0.0; BATCH], weights: [0.0; BATCH] }
    }

    #[inline]
    fn push(&mut self, Accepted { index, distance, weight }: Accepted) {
        let at = self.count;
        (self.places[at], self.distances[at], self.weights[at]) = (index, distance, weight);
        self.count += 1;
    }
}

fn count(scores: &mut Scores, search: Search, work: &ThinningWork, bands: usize) {
    let asked = match search {
        Search::Hierarchy => Cost::Candidates,
        Search::Scan => Cost::Scanned,
    };
    scores.count_many(asked, work.candidates);
    scores.count_many(Cost::Nodes, work.nodes);
    scores.count_many(Cost::Evaluations, work.accepted * bands as u64);
}

#[cfg(test)]
mod tests;
