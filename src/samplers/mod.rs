//! The sampler catalogue: every way of drawing a sample, beside the density that it claims.
//!
//! A sampler's outcomes fall apart into nothing at all (`Null`), discrete outcomes (`Delta`), and points
//! of continuous pieces. A piece has a *chart*: one or two coordinates over a box, in which the density
//! is smooth except at its stated kinks, graded so that a narrow lobe is as wide as the box. Densities
//! here are per unit of the chart (the code's density times the chart's Jacobian, which is written down
//! beside the chart and not taken from the sampler). What a sampler draws and the density that it claims
//! come from different functions of the code under test, so that each is checked by the other.
//!
//! Samplers of directions, of distances along a line and of points of a plane need no chart of their
//! own: `chart` has one for each of these domains. A sampler's file also states under which name and
//! with which options an experiment asks for it (`SamplerKind`); `KINDS` lists them all.

pub mod body;
pub mod boundary;
pub mod chart;
pub mod discrete;
pub mod distance;
pub mod facets;
pub mod guided;
pub mod joint;
mod kind;
pub mod light;
pub mod lines;
pub mod lobe;
pub mod phase;
pub mod radial;
mod sampler;
pub mod surface;
pub mod thinning;
pub mod towards;

pub use chart::{Chart, Charted, Measure, Technique};
pub use kind::{SamplerKind, read_options};
pub use sampler::{Contrast, Coordinate, Discrete, Draw, Null, Piece, Sampler, turns};

/// Every sampler of this crate, in the order in which they are listed.
pub const KINDS: &[SamplerKind] = &[
    phase::KIND,
    surface::TRIANGLE,
    surface::MESH,
    body::KIND,
    lines::KIND,
    thinning::KIND,
    distance::EXPONENTIAL,
    distance::TRUNCATED_EXPONENTIAL,
    distance::EQUIANGULAR,
    distance::MIXTURE,
    towards::DIRECTION,
    towards::DIRECTION_AND_DISTANCE,
    joint::TABLE,
    joint::MIXTURE,
    guided::TURN,
    guided::STEP,
    lobe::POWER,
    lobe::PLANE,
    facets::NORMALS,
    facets::VISIBLE_NORMALS,
    boundary::ROUGH,
    boundary::ROUGH_REFRACTION,
    boundary::SMOOTH,
    boundary::MATCHED,
    light::CAP,
    light::LAT_LONG,
    radial::KIND,
    discrete::BAND,
    discrete::HERO_FLIGHT,
];

#[cfg(test)]
mod tests;
