//! Options of the samplers of surfaces of bodies and of points of a cloud.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::point_cloud::{FacesWords, SearchWords};
use crate::geometry::FaceChoice;
use crate::math::exp;
use crate::samplers::body::BodySurfaceSampler;
use crate::samplers::lines::LineSampler;
use crate::samplers::thinning::{ThinningSampler, View};
use crate::sampling::radial::Radial;
use crate::sampling::thinning::{ThinningForm, ThinningRule};

/// Options of `body_surface`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Body {
    /// The body.
    pub shape: BodyShape,
    /// How a side of a box is chosen.
    #[serde(default)]
    pub faces: FacesWords,
}

/// Bodies with exact surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum BodyShape {
    /// A sphere of this radius, mm.
    Sphere(#[schemars(extend("exclusiveMinimum" = 0))] f64),
    /// A box with these edges, mm.
    Box([f64; 3]),
}

impl Body {
    /// The sampler.
    pub fn sampler(self) -> BodySurfaceSampler {
        match self.shape {
            BodyShape::Sphere(radius) => BodySurfaceSampler::sphere(radius),
            BodyShape::Box(edges) => BodySurfaceSampler::cuboid(
                edges,
                match self.faces {
                    FacesWords::ByArea => FaceChoice::Area,
                    FacesWords::ByIndex => FaceChoice::Index,
                },
            ),
        }
    }
}

/// Options of `thinning`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Thinning {
    /// The probability of acceptance by distance.
    pub rule: RuleWords,
    /// How accepted points are found.
    #[serde(default)]
    pub search: SearchWords,
    /// What of a query is looked at.
    pub view: ViewWords,
    /// Points of the cloud, on a sphere.
    #[schemars(range(min = 2, max = 1048576))]
    pub points: usize,
    /// Its radius, mm.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub radius_mm: f64,
}

/// Rules with the coefficients in numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum RuleWords {
    /// e^(-this d), 1/mm.
    Exponential(#[schemars(range(min = 0.0))] f64),
    /// The mean of e^(-s d) over these, 1/mm.
    MeanOfExponentials(Vec<f64>),
    /// max(e^(-s d), least): [s in 1/mm, least].
    Floor([f64; 2]),
    /// In proportion to e^(-s d) / (1 + d^2): [s in 1/mm, mean over a disc as wide as the sphere].
    Proportional([f64; 2]),
}

/// What of a query is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ViewWords {
    /// A single point, by its distance.
    Distance,
    /// Two neighbours.
    Pair,
    /// How many points.
    Number,
}

impl Thinning {
    /// The sampler.
    pub fn sampler(&self) -> ThinningSampler {
        let form = match &self.rule {
            RuleWords::Exponential(sigma) => ThinningForm::Exponential { sigma: *sigma },
            RuleWords::MeanOfExponentials(sigmas) => {
                ThinningForm::MeanOfExponentials { sigmas: sigmas.clone() }
            }
            RuleWords::Floor([sigma, least]) => ThinningForm::Floor { sigma: *sigma, least: *least },
            RuleWords::Proportional([sigma, mean]) => {
                let falloff = |d: f64| exp(-sigma * d) / (1.0 + d * d);
                ThinningForm::proportional(falloff, 2.0 * self.radius_mm, *mean)
            }
        };
        let view = match self.view {
            ViewWords::Distance => View::Distance,
            ViewWords::Pair => View::Pair,
            ViewWords::Number => View::Number,
        };
        let by_tree = self.search == SearchWords::Hierarchy;
        ThinningSampler::new(ThinningRule::new(form), by_tree, view, self.points, self.radius_mm)
    }
}

/// Options of `probe_crossings`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ProbedSphere {
    /// Radius of the sphere, mm.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub radius_mm: f64,
    /// A band each: a Gaussian density of the distance from the axis, of standard deviation 1 over this, mm.
    #[schemars(length(min = 1), inner(range(min = 0.001)))]
    pub sigma_per_mm: Vec<f64>,
}

impl ProbedSphere {
    /// The sampler: Gaussians of variance 1/sigma^2, which have no pole.
    pub fn sampler(&self) -> LineSampler {
        let gaussian =
            |sigma: &f64| Radial::Gaussian { variance: 1.0 / (sigma * sigma), r_max: f64::INFINITY };
        let densities: Vec<Radial> = self.sigma_per_mm.iter().map(gaussian).collect();
        let mean = self.sigma_per_mm.iter().sum::<f64>() / self.sigma_per_mm.len() as f64;
        LineSampler::new(self.radius_mm, densities, 1.0 / mean)
    }
}
