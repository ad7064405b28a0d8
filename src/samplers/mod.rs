//! The sampler catalogue: every technique of drawing a sample, with the density that it claims.
//!
//! The outcome of a draw is no sample (`Null`), a discrete outcome (`Delta`), or a point of a continuous
//! piece. A piece has a *chart*: one or two coordinates over a box, in which the density is smooth except at
//! its stated kinks, graded so that a narrow lobe fills the box. Densities here are per unit of the chart:
//! the density of the code times the Jacobian of the chart, which is defined with the chart and not taken
//! from the sampler. The draws of a sampler and the density that it claims come from different functions of
//! the code under test, so that each checks the other.
//!
//! `chart` has charts for directions, for distances along a line and for points in a plane, so that samplers
//! of these need no chart of their own. The file of a sampler also states its name and options in
//! experiment files (`SamplerKind`); `KINDS` lists all samplers.

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
