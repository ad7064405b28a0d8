//! The words for BSSRDF models in a file.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::optics::bssrdf::{Model, MomentKind, Outgoing};

/// A BSSRDF model; its coefficients are those of the object's medium and boundary.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum ModelWords {
    /// The dipole of Jensen, Marschner, Levoy & Hanrahan 2001.
    Classical(ClassicalWords),
}

/// Options of the classical dipole.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ClassicalWords {
    /// Where the Fresnel moments come from.
    #[serde(default)]
    pub moments: MomentWords,
    /// What happens to the exitance on its way out.
    #[serde(default)]
    pub outgoing: OutgoingWords,
}

/// Where Fresnel moments come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MomentWords {
    /// Quadrature of the Fresnel equations.
    #[default]
    Exact,
    /// The polynomials of the model's source.
    Polynomial,
}

/// What happens to the exitance on its way out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OutgoingWords {
    /// As published: radiance is exitance over pi times the outgoing transmittance.
    #[default]
    Plain,
    /// Divided by what the outgoing transmittance leaves of a diffuse exitance, so that none is lost.
    Normalised,
}

impl From<&ModelWords> for Model {
    fn from(words: &ModelWords) -> Model {
        match words {
            ModelWords::Classical(words) => {
                Model::Classical { moments: words.moments.into(), outgoing: words.outgoing.into() }
            }
        }
    }
}

impl From<MomentWords> for MomentKind {
    fn from(words: MomentWords) -> MomentKind {
        match words {
            MomentWords::Exact => MomentKind::Exact,
            MomentWords::Polynomial => MomentKind::Polynomial,
        }
    }
}

impl From<OutgoingWords> for Outgoing {
    fn from(words: OutgoingWords) -> Outgoing {
        match words {
            OutgoingWords::Plain => Outgoing::Plain,
            OutgoingWords::Normalised => Outgoing::Normalised,
        }
    }
}
