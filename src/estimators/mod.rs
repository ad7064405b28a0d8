//! The trait of estimators, which is the only open trait, and the estimators, one file each, with their names
//! in the literature.
//!
//! An estimator is built for one cell and runs passes: it turns the random streams of a pass into scores,
//! and knows no file, thread or statistic. The runner accumulates scores, including zeros, into moments.
//! The file of an estimator also states its name and options in experiment files, and the scenes that it
//! serves (`EstimatorKind`); `KINDS` lists all estimators.

mod bands;
pub mod bssrdf_density;
pub mod bssrdf_probe;
pub mod bssrdf_rays;
mod bssrdf_single;
mod choice;
pub mod connection;
mod crossing;
mod emergence;
mod estimator;
mod field;
mod guidance;
mod history;
mod illumination;
mod kind;
mod lanes;
pub mod light_trace;
pub mod path;
mod plain_lanes;
pub mod point_cloud;
mod roulette;
mod scores;
mod serves;
pub mod snee;
mod steps;
mod vertices;
mod visibility;
mod walk;
mod warm_up;

pub use estimator::{BandUse, Bias, Estimator, HeavyTail};
pub use guidance::{GuideSlice, WalkDraw};
pub use history::{History, TransportClass};
pub use kind::{BuildEstimator, EstimatorKind, read_options};
pub use roulette::Roulette;
pub use scores::{Anomaly, Cost, Layout, ObservableName, Scores};
pub use serves::{Bodies, BoundaryKind, Sensors, Serves};

/// Every estimator of this crate, in the order in which they are listed.
pub const KINDS: &[EstimatorKind] = &[
    path::PathTracer::KIND,
    snee::Snee::KIND,
    snee::Snee::CONNECT_KIND,
    snee::TwoBounce::KIND,
    snee::Bidirectional::KIND,
    connection::SpecularConnection::KIND,
    light_trace::LightTracer::KIND,
    point_cloud::PointCloud::KIND,
    bssrdf_probe::BssrdfProbe::KIND,
    bssrdf_rays::BssrdfRays::KIND,
    bssrdf_density::BssrdfDensity::KIND,
];

#[cfg(test)]
mod emission_tests;
#[cfg(test)]
mod path_length_tests;
#[cfg(test)]
mod rings_tests;
#[cfg(test)]
mod streams_tests;
#[cfg(test)]
mod testing;
