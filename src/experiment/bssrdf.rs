//! The words for BSSRDF models in a file.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::optics::bssrdf::{FittedDipole, Model, MomentKind, Outgoing, Scaling};

/// A BSSRDF model; its coefficients are those of the object's medium and boundary.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum ModelWords {
    /// The dipole of Jensen, Marschner, Levoy & Hanrahan 2001.
    Classical(ClassicalWords),
    /// The better dipole of d'Eon 2012: multiple scattering only.
    Better(MomentsWords),
    /// The directional dipole of Frisvad, Hachisuka & Kjeldsen 2014: not reciprocal, clamped at 0.
    Directional(MomentsWords),
    /// Normalized diffusion of Christensen & Burley 2015: a fit of all light.
    Normalized(NormalizedWords),
    /// Six Gaussians of skin, d'Eon & Luebke 2007, for bands red, green, blue; the medium is not used.
    Skin(SkinWords),
    /// A dipole's profile as a sum of Gaussians.
    Gaussians(GaussiansWords),
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

/// Options of the better and the directional dipole.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MomentsWords {
    /// Where the Fresnel moments come from.
    #[serde(default)]
    pub moments: MomentWords,
}

/// Options of normalized diffusion.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NormalizedWords {
    /// Which of the published fits gives the shape.
    #[serde(default)]
    pub scaling: ScalingWords,
    /// Diffuse reflectance of light that has entered, above 0 and at most 1: one number, or one per band.
    ///
    /// Without it that of the classical dipole.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(length(min = 1))]
    pub albedo: Option<Vec<f64>>,
}

/// Options of the Gaussians of skin.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SkinWords {
    /// Diffuse reflectance of red, green and blue light that has entered, above 0 and at most 1.
    pub reflectance: [f64; 3],
}

/// Options of a fit by Gaussians.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GaussiansWords {
    /// Whose profile is fitted.
    pub dipole: FittedWords,
    /// Where its Fresnel moments come from.
    #[serde(default)]
    pub moments: MomentWords,
    /// How many Gaussians.
    #[serde(default = "default_terms")]
    #[schemars(range(min = 1, max = 12))]
    pub terms: usize,
}

fn default_terms() -> usize {
    6
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

/// Which fit of normalized diffusion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ScalingWords {
    /// A beam along the normal; lengths in mean free paths.
    #[default]
    Searchlight,
    /// Diffuse light; lengths in mean free paths.
    Diffuse,
    /// Lengths in diffuse mean free paths, for media that absorb.
    Dmfp,
}

/// Profiles that are fitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FittedWords {
    /// The classical dipole's.
    Classical,
    /// The better dipole's.
    Better,
}

impl From<&ModelWords> for Model {
    fn from(words: &ModelWords) -> Model {
        match words {
            ModelWords::Classical(words) => {
                Model::Classical { moments: words.moments.into(), outgoing: words.outgoing.into() }
            }
            ModelWords::Better(words) => Model::Better { moments: words.moments.into() },
            ModelWords::Directional(words) => Model::Directional { moments: words.moments.into() },
            ModelWords::Normalized(words) => {
                Model::Normalized { scaling: words.scaling.into(), albedo: words.albedo.clone() }
            }
            ModelWords::Skin(words) => Model::Skin { reflectance: words.reflectance },
            ModelWords::Gaussians(words) => {
                let (dipole, moments) = (words.dipole.into(), words.moments.into());
                Model::Gaussians { dipole, moments, terms: words.terms }
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

impl From<ScalingWords> for Scaling {
    fn from(words: ScalingWords) -> Scaling {
        match words {
            ScalingWords::Searchlight => Scaling::Searchlight,
            ScalingWords::Diffuse => Scaling::Diffuse,
            ScalingWords::Dmfp => Scaling::DiffuseMeanFreePath,
        }
    }
}

impl From<FittedWords> for FittedDipole {
    fn from(words: FittedWords) -> FittedDipole {
        match words {
            FittedWords::Classical => FittedDipole::Classical,
            FittedWords::Better => FittedDipole::Better,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn model(text: &str) -> Result<Model, serde_json::Error> {
        serde_json::from_str::<ModelWords>(text).map(|words| Model::from(&words))
    }

    /// Every word means what it says, and what is left out is exact, plain, the searchlight, six terms.
    #[test]
    fn words_of_every_model() {
        let exact = MomentKind::Exact;
        let polynomial = MomentKind::Polynomial;
        for (text, expected) in [
            (r#"{"classical": {}}"#, Model::Classical { moments: exact, outgoing: Outgoing::Plain }),
            (
                r#"{"classical": {"moments": "polynomial", "outgoing": "normalised"}}"#,
                Model::Classical { moments: polynomial, outgoing: Outgoing::Normalised },
            ),
            (r#"{"better": {}}"#, Model::Better { moments: exact }),
            (r#"{"better": {"moments": "polynomial"}}"#, Model::Better { moments: polynomial }),
            (r#"{"directional": {}}"#, Model::Directional { moments: exact }),
            (r#"{"normalized": {}}"#, Model::Normalized { scaling: Scaling::Searchlight, albedo: None }),
            (
                r#"{"normalized": {"scaling": "diffuse", "albedo": [0.5]}}"#,
                Model::Normalized { scaling: Scaling::Diffuse, albedo: Some(vec![0.5]) },
            ),
            (
                r#"{"normalized": {"scaling": "dmfp"}}"#,
                Model::Normalized { scaling: Scaling::DiffuseMeanFreePath, albedo: None },
            ),
            (
                r#"{"skin": {"reflectance": [0.4, 0.2, 0.1]}}"#,
                Model::Skin { reflectance: [0.4, 0.2, 0.1] },
            ),
            (
                r#"{"gaussians": {"dipole": "better"}}"#,
                Model::Gaussians { dipole: FittedDipole::Better, moments: exact, terms: 6 },
            ),
            (
                r#"{"gaussians": {"dipole": "classical", "moments": "polynomial", "terms": 4}}"#,
                Model::Gaussians { dipole: FittedDipole::Classical, moments: polynomial, terms: 4 },
            ),
        ] {
            assert_eq!(model(text).unwrap(), expected, "{text}");
        }
        for text in [
            r#"{"better": {"outgoing": "plain"}}"#,
            r#"{"skin": {}}"#,
            r#"{"skin": {"reflectance": [0.4]}}"#,
            r#"{"gaussians": {}}"#,
            r#"{"quantized": {}}"#,
        ] {
            assert!(model(text).is_err(), "{text}");
        }
    }
}
