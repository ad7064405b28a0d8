//! Words for `snee` in an experiment file, and the two presets that they start from.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::estimators::RouletteOption;
use crate::error::{Error, Result};
use crate::estimators::snee::{Call, JointKind, LastVertex, ProbeShares, SneeOptions, Strategies};

/// Options of `snee`: a preset, and what differs from it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SneeWords {
    /// What the other options start from.
    #[serde(default)]
    pub preset: Preset,
    /// When a path is ended by chance.
    #[serde(default)]
    pub roulette: RouletteOption,
    /// What makes the paths whose last two medium vertices follow each other.
    ///
    /// All other paths are always the walk's own (and the light-guided last vertex's).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub strategies: Option<Vec<Strategy>>,
    /// How often an edge is subdivided.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub call: Option<CallWords>,
    /// The same where nothing else finds the path: parallel light through a smooth boundary.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub call_alone: Option<CallWords>,
    /// Where sampled distances end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub distances: Option<Distances>,
    /// How points of the boundary are probed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub probe: Option<ProbeWords>,
    /// How directions are drawn from the walk's end of an edge.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joint: Option<JointWords>,
    /// The light-guided last vertex; `most = 0` switches it off.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub last_vertex: Option<LastVertexWords>,
    /// Whether a smooth boundary's reflection of a concentrated light is scored by its expectation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub expected_reflection: Option<bool>,
    /// Lights of a smaller concentration, 4 pi int L^2 / (int L)^2, are left to the walk alone; 1 lets all pass.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1.0))]
    pub least_concentration: Option<f64>,
    /// Whether bands have walks of their own.
    #[serde(default)]
    pub bands: BandsWords,
}

/// A set of options with a name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Preset {
    /// As published: all strategies, uniform probes, truncated distances, a call at every vertex.
    Paper,
    /// Probes and a last vertex that know where light enters, calls that become rare with depth, a gate for
    /// lights that are not concentrated.
    #[default]
    Guided,
}

/// A technique.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Strategy {
    /// The walk, its exit by BSDF sampling.
    Bsdf,
    /// The walk, its exit by light sampling.
    Light,
    /// Subdivision from the light's end.
    TopToBottom,
    /// Subdivision from the walk's end.
    BottomToTop,
}

/// The probability of a call: most * exp(-decay * optical distance along the specular guess).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CallWords {
    /// At the boundary.
    #[schemars(extend("exclusiveMinimum" = 0), range(max = 1.0))]
    pub most: f64,
    /// Per mean free path.
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub decay: f64,
}

/// Where sampled distances end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Distances {
    /// At the boundary, which takes a ray for every density.
    Truncated,
    /// Nowhere; samples outside the body count as 0.
    Unbounded,
}

/// The least share of uniform directions among probes.
const LEAST_UNIFORM: f64 = 1e-3;

/// Shares of the lobes of probes; what is left to 1 is uniform in direction, at least 0.001.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ProbeWords {
    /// By area of the tangent plane at the specular guess.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub plane: f64,
    /// About the specular guess.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub guided: f64,
}

/// Directions from the walk's end of an edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum JointWords {
    /// Phase function times geometry, tabulated (exact where g is 0).
    Table,
    /// Phase function and geometry in turn, half each.
    Mixture,
}

/// The light-guided last vertex.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LastVertexWords {
    /// Probability of a call at the boundary; 0 switches it off.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub most: f64,
    /// How fast it falls per mean free path along the specular guess.
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub decay: f64,
    /// Share of the wider lobe.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub wide_share: f64,
    /// Least roughness of the wider lobe (at least twice the boundary's own); its width at a smooth boundary.
    #[serde(default = "wide")]
    #[schemars(extend("exclusiveMinimum" = 0), range(max = 1.0))]
    pub wide: f64,
}

fn wide() -> f64 {
    0.2
}

/// Who shares a walk.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum BandsWords {
    /// Every band has its own.
    #[default]
    Alone,
    /// One walk scores all bands, which may differ in their media alone.
    Shared,
}

impl Preset {
    fn options(self) -> SneeOptions {
        let all = Strategies { bsdf: true, light: true, top_to_bottom: true, bottom_to_top: true };
        match self {
            Preset::Paper => SneeOptions {
                roulette: RouletteOption::default().into(),
                strategies: all,
                call: Call { most: 1.0, decay: 0.0 },
                call_alone: Call { most: 1.0, decay: 0.0 },
                truncated: true,
                probe: ProbeShares { uniform: 1.0, plane: 0.0, guided: 0.0 },
                joint: JointKind::Table,
                last_vertex: None,
                expected_reflection: false,
                least_concentration: 1.0,
                share_bands: false,
            },
            Preset::Guided => SneeOptions {
                roulette: RouletteOption::default().into(),
                strategies: Strategies { bottom_to_top: false, ..all },
                call: Call { most: 0.15, decay: 0.75 },
                call_alone: Call { most: 1.0, decay: 0.25 },
                truncated: false,
                probe: ProbeShares { uniform: 0.2, plane: 0.4, guided: 0.4 },
                joint: JointKind::Table,
                last_vertex: Some(LastVertex {
                    call: Call { most: 1.0, decay: 0.75 },
                    wide_share: 0.25,
                    wide: 0.2,
                }),
                expected_reflection: true,
                least_concentration: 10.0,
                share_bands: false,
            },
        }
    }
}

impl SneeWords {
    /// The preset with what differs from it.
    ///
    /// # Errors
    /// No technique, one that loses lights, or shares of probes that leave nothing to uniform directions.
    pub fn options(&self) -> Result<SneeOptions> {
        let mut options = self.preset.options();
        options.roulette = self.roulette.into();
        if let Some(strategies) = &self.strategies {
            let has = |strategy| strategies.contains(&strategy);
            options.strategies = Strategies {
                bsdf: has(Strategy::Bsdf),
                light: has(Strategy::Light),
                top_to_bottom: has(Strategy::TopToBottom),
                bottom_to_top: has(Strategy::BottomToTop),
            };
        }
        if let Some(call) = self.call {
            options.call = Call { most: call.most, decay: call.decay };
        }
        if let Some(call) = self.call_alone.or(self.call) {
            options.call_alone = Call { most: call.most, decay: call.decay };
        }
        if let Some(distances) = self.distances {
            options.truncated = distances == Distances::Truncated;
        }
        if let Some(probe) = self.probe {
            let uniform = 1.0 - probe.plane - probe.guided;
            if uniform < LEAST_UNIFORM {
                return Err(Error::input_help(
                    format!(
                        "snee: the shares of `probe` are {} and {}, which leaves less than {LEAST_UNIFORM} to uniform \
                         directions",
                        probe.plane, probe.guided
                    ),
                    "let them sum to less, or parts of the boundary are never probed, or with huge weights",
                ));
            }
            options.probe = ProbeShares { uniform, plane: probe.plane, guided: probe.guided };
        }
        if let Some(joint) = self.joint {
            options.joint = match joint {
                JointWords::Table => JointKind::Table,
                JointWords::Mixture => JointKind::Mixture,
            };
        }
        if let Some(last) = self.last_vertex {
            options.last_vertex = (last.most > 0.0).then_some(LastVertex {
                call: Call { most: last.most, decay: last.decay },
                wide_share: last.wide_share,
                wide: last.wide,
            });
        }
        let Strategies { bsdf, light, top_to_bottom, bottom_to_top } = options.strategies;
        if !(bsdf || light || top_to_bottom || bottom_to_top || options.last_vertex.is_some()) {
            return Err(Error::input(
                "snee: nothing takes part; name one of bsdf, light, top_to_bottom, bottom_to_top in `strategies`",
            ));
        }
        if let Some(least) = self.least_concentration {
            options.least_concentration = least;
        }
        if !(bsdf && light) && options.least_concentration > 1.0 {
            return Err(Error::input_help(
                "snee: `strategies` leaves out bsdf or light, which are all that finds a light behind the gate",
                "set `least_concentration = 1`, or name both",
            ));
        }
        if let Some(expected) = self.expected_reflection {
            options.expected_reflection = expected;
        }
        options.share_bands = self.bands == BandsWords::Shared;
        Ok(options)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(text: &str) -> SneeWords {
        toml::from_str(text).expect("words")
    }

    #[test]
    fn options_differ_from_the_preset_where_they_are_named() {
        let paper = words("preset = \"paper\"").options().expect("a preset");
        assert_eq!(paper, Preset::Paper.options());
        let fewer = words("preset = \"paper\"\ncall = { most = 0.3 }\nlast_vertex = { most = 0.5 }");
        let fewer = fewer.options().expect("options");
        assert_eq!((fewer.call.most, fewer.call_alone.most), (0.3, 0.3));
        assert_eq!(fewer.last_vertex.map(|last| last.call.most), Some(0.5));
        assert!(fewer.truncated && fewer.strategies.bottom_to_top);
        let guided = words("last_vertex = { most = 0 }").options().expect("options");
        assert_eq!(SneeOptions { last_vertex: None, ..Preset::Guided.options() }, guided);
    }

    #[test]
    fn what_samples_nothing_is_refused() {
        let message = |text| words(text).options().expect_err("nothing").to_string();
        let probe = message("probe = { plane = 0.7, guided = 0.3 }");
        assert!(probe.contains("0.7 and 0.3") && probe.contains("uniform"), "{probe}");
        let none = message("preset = \"paper\"\nstrategies = []");
        assert!(none.contains("nothing takes part"), "{none}");
        let gated = message("strategies = [\"top_to_bottom\"]");
        assert!(gated.contains("behind the gate"), "{gated}");
        let last_alone = words("strategies = []\nleast_concentration = 1").options();
        assert!(last_alone.is_ok(), "the last vertex is left");
    }
}
