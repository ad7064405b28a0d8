//! Options of `snee` and `two_bounce`, and the two presets that an experiment file starts from.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::end::Call;
use super::last_vertex::LastVertex;
use super::learned_calls::LearnedCalls;
use super::photons::Photons;
use super::probe::ProbeShares;
use super::specular::ConnectionCall;
use crate::error::{Error, Result};
use crate::estimators::{Roulette, WalkDraw};

/// How the estimator is set up.
#[derive(Clone, Debug, PartialEq)]
pub struct SneeOptions {
    /// Russian roulette of the walk.
    pub roulette: Roulette,
    /// How walks are drawn inside the body.
    pub walk: WalkDraw,
    /// Sampling techniques that take part.
    pub strategies: Strategies,
    /// How often an edge is subdivided.
    pub call: Call,
    /// The same where no other technique finds the path: parallel light through a smooth boundary.
    pub call_alone: Call,
    /// Whether distances end at the boundary (one more ray for every density) or run on and may fail.
    pub truncated: bool,
    /// Shares of the densities that directions of probes are drawn from.
    pub probe: ProbeShares,
    /// Directions from x_i, bottom to top.
    pub joint: JointKind,
    /// The light-guided last vertex.
    pub last_vertex: Option<LastVertex>,
    /// Connections of the last vertex through a smooth boundary.
    pub connection: Option<ConnectionCall>,
    /// Whether a smooth boundary's reflection of a light that is connected to is scored by its
    /// expectation, wherever a walk meets the boundary from outside, instead of by the walks that are
    /// reflected.
    pub expected_reflection: bool,
    /// The same for a light that is seen straight through the body.
    pub expected_passage: bool,
    /// Number of sensor rays per walk at which these expectations are scored.
    pub views: u32,
    /// Least concentration 4 pi int L^2 / (int L)^2 of a light that is connected to; with 1 none is
    /// skipped.
    pub least_concentration: f64,
    /// Whether all bands share a walk.
    pub share_bands: bool,
    /// The warm-up that chooses the probabilities of calls, if there is one.
    pub learned_calls: Option<LearnedCalls>,
    /// The photons that guide to light, if there are any.
    pub photons: Option<Photons>,
}

/// Which techniques make the paths whose last two medium vertices follow each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Strategies {
    /// The walk continues, its exit by BSDF sampling.
    pub bsdf: bool,
    /// The walk continues, its exit by light sampling.
    pub light: bool,
    /// Subdivision from the light's end.
    pub top_to_bottom: bool,
    /// Subdivision from the walk's end.
    pub bottom_to_top: bool,
}

impl Strategies {
    /// Whether edges are subdivided.
    pub(super) fn subdivides(&self) -> bool {
        self.top_to_bottom || self.bottom_to_top
    }
}

/// How directions are drawn from the walk's end of an edge, bottom to top.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum JointKind {
    /// Phase function times geometry, tabulated (exact where g is 0).
    Table,
    /// Phase function and geometry in turn, half each.
    Mixture,
}

/// Options of `snee` and `two_bounce` in an experiment file: a preset, and what differs from it.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SneeChoices {
    /// Preset that the other options change.
    #[serde(default)]
    pub preset: SneePreset,
    /// Russian roulette.
    #[serde(default)]
    pub roulette: Roulette,
    /// How walks are drawn inside the body; all ways are unbiased.
    #[serde(default)]
    pub walk: WalkDraw,
    /// Techniques for paths whose last two medium vertices are consecutive.
    ///
    /// All other paths are always sampled by the walk (and by the light-guided last vertex).
    pub strategies: Option<Vec<EdgeTechnique>>,
    /// How often an edge is subdivided.
    pub call: Option<Call>,
    /// The same where no other technique finds the path: parallel light through a smooth boundary.
    pub call_alone: Option<Call>,
    /// Where sampled distances end.
    pub distances: Option<DistanceEnd>,
    /// How points of the boundary are probed.
    pub probe: Option<ProbeLobes>,
    /// How directions are drawn from the walk's end of an edge.
    pub joint: Option<JointKind>,
    /// The light-guided last vertex; `most = 0` switches it off.
    pub last_vertex: Option<LastVertex>,
    /// Connections of the last vertex through a smooth boundary; `most = 0` switches them off.
    ///
    /// Without it `snee` has none, and `snee_connect` has one with `most = 1, decay = 1, later = 0.5` and no
    /// `last_vertex`.
    pub connection: Option<ConnectionCall>,
    /// Whether a smooth boundary's reflection of a concentrated light is scored by its expectation.
    pub expected_reflection: Option<bool>,
    /// Whether a concentrated light that is seen straight through a smooth boundary and the body is scored by its
    /// expectation.
    ///
    /// By default `snee` leaves it to the walk, and `snee_connect` does not.
    pub expected_passage: Option<bool>,
    /// Number of sensor rays per walk, its first ray included, at which these two expectations are scored.
    ///
    /// By default 1 for `snee`, and 8 for `snee_connect`. Where no expectation is scored, 1 is used.
    #[schemars(range(min = 1, max = 1024))]
    pub views: Option<u32>,
    /// Lights of a smaller concentration are skipped: sampled by path tracing only.
    ///
    /// The concentration is 4 pi int L^2 / (int L)^2; 1 skips none.
    #[schemars(range(min = 1.0))]
    pub least_concentration: Option<f64>,
    /// Whether each band has separate walks or all bands share them.
    #[serde(default)]
    pub bands: BandWalks,
    /// A warm-up that chooses how often `call`, `call_alone`, `last_vertex`, `connection` and `photons` are called (`most`), and
    /// `views` where there are several, from the variance and the cost that it predicts.
    ///
    /// Without it, the given numbers are used.
    pub learned_calls: Option<LearnedCalls>,
    /// Photons that are traced before the passes, and guide to light where nothing else finds it: behind the facets of a scan, and
    /// where it comes through internal reflections or another part of the body.
    pub photons: Option<Photons>,
}

/// A set of options with a name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SneePreset {
    /// As published: all strategies, uniform probes, truncated distances, a call at every vertex.
    Paper,
    /// Tuned: probes and a last vertex that are guided by the light, and calls whose probability falls with
    /// depth; lights that are not concentrated are skipped.
    #[default]
    Guided,
}

/// One technique that samples the last two segments of a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum EdgeTechnique {
    /// The walk, its exit by BSDF sampling.
    Bsdf,
    /// The walk, its exit by light sampling.
    Light,
    /// Subdivision from the light's end.
    TopToBottom,
    /// Subdivision from the walk's end.
    BottomToTop,
}

/// Where sampled distances end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum DistanceEnd {
    /// At the boundary, which takes a ray for every density.
    Truncated,
    /// Nowhere; samples outside the body count as 0.
    Unbounded,
}

/// Views of `snee_connect`: in pixels in which a small light is seen, whether a ray sees it causes most of the variance.
const CONNECTED_VIEWS: u32 = 8;

/// The least share of uniform directions among probes.
const LEAST_UNIFORM: f64 = 1e-3;

/// Shares of the lobes of probes; the rest, at least 0.001, is uniform in direction.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ProbeLobes {
    /// By area of the tangent plane at the specular guess.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub plane: f64,
    /// About the specular guess.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub guided: f64,
}

/// Which bands share a walk.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum BandWalks {
    /// Every band has separate walks.
    #[default]
    Alone,
    /// One walk scores all bands, which may differ only in their media.
    Shared,
}

impl SneePreset {
    /// Options that the preset denotes.
    pub fn options(self) -> SneeOptions {
        let all = Strategies { bsdf: true, light: true, top_to_bottom: true, bottom_to_top: true };
        match self {
            SneePreset::Paper => SneeOptions {
                roulette: Roulette::default(),
                walk: WalkDraw::Plain {},
                strategies: all,
                call: Call { most: 1.0, decay: 0.0 },
                call_alone: Call { most: 1.0, decay: 0.0 },
                truncated: true,
                probe: ProbeShares { uniform: 1.0, plane: 0.0, guided: 0.0 },
                joint: JointKind::Table,
                last_vertex: None,
                connection: None,
                expected_reflection: false,
                expected_passage: false,
                views: 1,
                least_concentration: 1.0,
                share_bands: false,
                learned_calls: None,
                photons: None,
            },
            SneePreset::Guided => SneeOptions {
                roulette: Roulette::default(),
                walk: WalkDraw::Plain {},
                strategies: Strategies { bottom_to_top: false, ..all },
                call: Call { most: 0.15, decay: 0.75 },
                call_alone: Call { most: 1.0, decay: 0.25 },
                truncated: false,
                probe: ProbeShares { uniform: 0.2, plane: 0.4, guided: 0.4 },
                joint: JointKind::Table,
                last_vertex: Some(LastVertex { most: 1.0, decay: 0.75, wide_share: 0.25, wide: 0.2 }),
                connection: None,
                expected_reflection: true,
                expected_passage: false,
                views: 1,
                least_concentration: 10.0,
                share_bands: false,
                learned_calls: None,
                photons: None,
            },
        }
    }
}

impl SneeChoices {
    /// The preset with the options that differ from it.
    ///
    /// # Errors
    /// No technique, one that loses lights, or shares of probes that leave nothing to uniform
    /// directions.
    pub fn options(&self) -> Result<SneeOptions> {
        let preset = self.preset.options();
        let mut options = SneeOptions {
            roulette: self.roulette,
            walk: self.walk,
            call: self.call.unwrap_or(preset.call),
            call_alone: self.call_alone.or(self.call).unwrap_or(preset.call_alone),
            joint: self.joint.unwrap_or(preset.joint),
            last_vertex: self.last_vertex.or(preset.last_vertex).filter(|last| last.most > 0.0),
            connection: self.connection.filter(|call| call.most > 0.0),
            expected_reflection: self.expected_reflection.unwrap_or(preset.expected_reflection),
            expected_passage: self.expected_passage.unwrap_or(preset.expected_passage),
            views: self.views.unwrap_or(preset.views),
            least_concentration: self.least_concentration.unwrap_or(preset.least_concentration),
            share_bands: self.bands == BandWalks::Shared,
            learned_calls: self.learned_calls,
            photons: self.photons.filter(|photons| photons.most > 0.0),
            ..preset
        };
        if let Some(strategies) = &self.strategies {
            let has = |technique| strategies.contains(&technique);
            options.strategies = Strategies {
                bsdf: has(EdgeTechnique::Bsdf),
                light: has(EdgeTechnique::Light),
                top_to_bottom: has(EdgeTechnique::TopToBottom),
                bottom_to_top: has(EdgeTechnique::BottomToTop),
            };
        }
        if let Some(distances) = self.distances {
            options.truncated = distances == DistanceEnd::Truncated;
        }
        if let Some(ProbeLobes { plane, guided }) = self.probe {
            let uniform = 1.0 - plane - guided;
            if uniform < LEAST_UNIFORM {
                return Err(Error::input_help(
                    format!(
                        "snee: the shares of `probe` are {plane} and {guided}, which leaves less than \
                         {LEAST_UNIFORM} to uniform directions"
                    ),
                    "let them sum to less, or parts of the boundary are never probed, or with huge weights",
                ));
            }
            options.probe = ProbeShares { uniform, plane, guided };
        }
        if options.share_bands && options.walk != (WalkDraw::Plain {}) {
            return Err(Error::input_help(
                "snee: bands that share walks share plain ones: what guides a walk differs from band to band",
                "leave out `walk`, or use `bands = \"alone\"`",
            ));
        }
        if options.share_bands && options.photons.is_some() {
            return Err(Error::input_help(
                "snee: photons guide the walks of one band; bands that share walks have none",
                "leave out `photons`, or use `bands = \"alone\"`",
            ));
        }
        let Strategies { bsdf, light, .. } = options.strategies;
        let is_guided = options.last_vertex.is_some() || options.connection.is_some();
        if !(bsdf || light || options.strategies.subdivides() || is_guided) {
            return Err(Error::input(
                "snee: nothing takes part; name one of bsdf, light, top_to_bottom, bottom_to_top in `strategies`",
            ));
        }
        if !(bsdf && light) && options.least_concentration > 1.0 {
            return Err(Error::input_help(
                "snee: `strategies` leaves out bsdf or light; without both, lights below `least_concentration` \
                 are never sampled",
                "set `least_concentration = 1`, or name both",
            ));
        }
        Ok(options)
    }

    /// The same with the connection, and without the last vertex unless it is named.
    ///
    /// # Errors
    /// As [`SneeChoices::options`].
    pub fn connected(&self) -> Result<SneeOptions> {
        let connection = Some(self.connection.unwrap_or_default());
        let options = SneeChoices { connection, ..self.clone() }.options()?;
        let last_vertex = options.last_vertex.filter(|_| self.last_vertex.is_some());
        let expected_passage = self.expected_passage.unwrap_or(true);
        let views = self.views.unwrap_or(CONNECTED_VIEWS);
        Ok(SneeOptions { last_vertex, expected_passage, views, ..options })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(text: &str) -> SneeChoices {
        toml::from_str(text).expect("words")
    }

    #[test]
    fn options_differ_from_the_preset_where_they_are_named() {
        let paper = words("preset = \"paper\"").options().expect("a preset");
        assert_eq!(paper, SneePreset::Paper.options());
        let fewer = words("preset = \"paper\"\ncall = { most = 0.3 }\nlast_vertex = { most = 0.5 }");
        let fewer = fewer.options().expect("options");
        assert_eq!((fewer.call.most, fewer.call_alone.most), (0.3, 0.3));
        assert_eq!(fewer.last_vertex.map(|last| last.most), Some(0.5));
        assert!(fewer.truncated && fewer.strategies.bottom_to_top);
        let guided = words("last_vertex = { most = 0 }").options().expect("options");
        assert_eq!(SneeOptions { last_vertex: None, ..SneePreset::Guided.options() }, guided);
    }

    #[test]
    fn connections_take_part_where_the_kind_or_the_file_asks() {
        assert_eq!(words("").options().expect("options").connection, None);
        let connected = |text| words(text).connected().expect("options");
        let default = connected("");
        assert_eq!((default.connection, default.last_vertex), (Some(ConnectionCall::default()), None));
        let both = connected("connection = { most = 0.5 }\nlast_vertex = { most = 0.25 }");
        assert_eq!(both.connection, Some(ConnectionCall { most: 0.5, decay: 0.0, later: 1.0 }));
        assert_eq!(both.last_vertex.map(|last| last.most), Some(0.25));
        assert_eq!(connected("connection = { most = 0 }").connection, None, "which the kind refuses");
        let alone = words("strategies = []\nconnection = { most = 1 }\nleast_concentration = 1");
        assert!(alone.options().is_ok(), "the connection is left");
    }

    #[test]
    fn what_samples_nothing_is_refused() {
        let message = |text| words(text).options().expect_err("nothing").to_string();
        let probe = message("probe = { plane = 0.7, guided = 0.3 }");
        assert!(probe.contains("0.7 and 0.3") && probe.contains("uniform"), "{probe}");
        let none = message("preset = \"paper\"\nstrategies = []");
        assert!(none.contains("nothing takes part"), "{none}");
        let partial = message("strategies = [\"top_to_bottom\"]");
        assert!(partial.contains("never sampled"), "{partial}");
        let shared = message("walk = { guided = {} }\nbands = \"shared\"");
        assert!(shared.contains("differs from band to band") && shared.contains("alone"), "{shared}");
        let last_alone = words("strategies = []\nleast_concentration = 1").options();
        assert!(last_alone.is_ok(), "the last vertex is left");
    }
}
