//! Words for `point_cloud` in an experiment file.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::bssrdf::ModelWords;
use crate::estimators::point_cloud::{Acceptance, PointCloudOptions, Search};
use crate::geometry::FaceChoice;

/// Options of `point_cloud`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PointCloudWords {
    /// The BSSRDF.
    pub model: ModelWords,
    /// Points of the surface that a pass draws.
    #[serde(default = "samples")]
    #[schemars(range(min = 1, max = 1073741824))]
    pub samples: usize,
    /// How points are drawn: faces (triangles) by area, or by index as published.
    #[serde(default)]
    pub faces: FacesWords,
    /// The probability p(d) with which a point at distance d is evaluated, and weighs 1/p.
    #[serde(default)]
    pub acceptance: AcceptanceWords,
    /// How accepted points are found; both have the same law.
    #[serde(default)]
    pub search: SearchWords,
    /// Whether single scattering is added by sampling; without it where the model leaves it out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub single: Option<bool>,
    /// Whether light that goes straight through the body is followed.
    #[serde(default = "yes")]
    pub straight: bool,
}

fn samples() -> usize {
    10_000
}

fn yes() -> bool {
    true
}

/// How faces are chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FacesWords {
    /// In proportion to their areas.
    #[default]
    ByArea,
    /// Each as likely as any other.
    ByIndex,
}

/// Rules of acceptance.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum AcceptanceWords {
    /// 1: every point is evaluated.
    All {},
    /// e^(-sigma_tr d) of each band by itself.
    Band {},
    /// e^(-m d), m the mean of sigma_tr over the bands: as published for RGB.
    Mean {},
    /// e^(-m d), m the smallest sigma_tr.
    Minimum {},
    /// The mean over the bands of e^(-sigma_tr d).
    MeanOfExponentials {},
    /// max(e^(-m d), this), m the mean of sigma_tr.
    Floor(#[schemars(extend("exclusiveMinimum" = 0), range(max = 1.0))] f64),
    /// In proportion to the kernel.
    Kernel {},
}

impl Default for AcceptanceWords {
    fn default() -> Self {
        AcceptanceWords::Kernel {}
    }
}

/// How accepted points are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SearchWords {
    /// By a hierarchy over the points.
    #[default]
    Hierarchy,
    /// By asking every point.
    Scan,
}

impl From<AcceptanceWords> for Acceptance {
    fn from(words: AcceptanceWords) -> Acceptance {
        match words {
            AcceptanceWords::All {} => Acceptance::All,
            AcceptanceWords::Band {} => Acceptance::Band,
            AcceptanceWords::Mean {} => Acceptance::Mean,
            AcceptanceWords::Minimum {} => Acceptance::Minimum,
            AcceptanceWords::MeanOfExponentials {} => Acceptance::MeanOfExponentials,
            AcceptanceWords::Floor(least) => Acceptance::Floor(least),
            AcceptanceWords::Kernel {} => Acceptance::Kernel,
        }
    }
}

impl From<&PointCloudWords> for PointCloudOptions {
    fn from(words: &PointCloudWords) -> PointCloudOptions {
        PointCloudOptions {
            model: (&words.model).into(),
            samples: words.samples,
            faces: match words.faces {
                FacesWords::ByArea => FaceChoice::Area,
                FacesWords::ByIndex => FaceChoice::Index,
            },
            acceptance: words.acceptance.into(),
            search: match words.search {
                SearchWords::Hierarchy => Search::Hierarchy,
                SearchWords::Scan => Search::Scan,
            },
            single: words.single,
            straight: words.straight,
        }
    }
}
