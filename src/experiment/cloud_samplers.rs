//! Options of the samplers of surfaces of bodies and of points of a cloud.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::point_cloud::{FacesWords, SearchWords};
use crate::geometry::FaceChoice;
use crate::math::exp;
use crate::samplers::body::BodySurfaceSampler;
use crate::samplers::thinning::{ThinningSampler, View};
use crate::sampling::thinning::{Form, Rule};

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
            RuleWords::Exponential(sigma) => Form::Exponential { sigma: *sigma },
            RuleWords::MeanOfExponentials(sigmas) => Form::MeanOfExponentials { sigmas: sigmas.clone() },
            RuleWords::Floor([sigma, least]) => Form::Floor { sigma: *sigma, least: *least },
            RuleWords::Proportional([sigma, mean]) => {
                let falloff = |d: f64| exp(-sigma * d) / (1.0 + d * d);
                Form::proportional(falloff, 2.0 * self.radius_mm, *mean)
            }
        };
        let view = match self.view {
            ViewWords::Distance => View::Distance,
            ViewWords::Pair => View::Pair,
            ViewWords::Number => View::Number,
        };
        let by_tree = self.search == SearchWords::Hierarchy;
        ThinningSampler::new(Rule::new(form), by_tree, view, self.points, self.radius_mm)
    }
}
