//! scatterproof: a research testbed for light that enters a body through a refractive surface,
//! scatters inside it, and leaves again.
//!
//! One TOML file is one experiment. It runs estimators per wavelength band and writes a record;
//! a verification layer judges the record's claims, and reports are made from the record alone.
//!
//! # Two sides that never import each other
//!
//! ```text
//! simulation   math -> sampling -> optics -> geometry -> scene -> estimators
//!                                                        scene -> samplers     (the catalogue of samplers)
//!              math -> optics -> reference          (closed forms; never sees the estimators)
//! bridge       experiment -> run                    (the only modules that see both sides)
//! evidence     math -> stats -> results -> verify -> report
//! ```
//!
//! Simulation turns random numbers into scores and knows no file, thread or p-value. Evidence turns
//! stored moments and counts into verdicts, tables and plots, and knows no ray. Data flows one way:
//! `experiments/x.toml` -> schema -> validated experiment -> scene + estimators -> blocks of passes
//! -> moments -> `results/x/` -> `verify` and `report`, which read only `results/`.
//! A module uses only what stands before it in this picture; `tests/layering.rs` reads the sources
//! and fails on any other edge.
//!
//! # Words
//!
//! | word | meaning |
//! |---|---|
//! | band | one wavelength interval with scalar optical properties; transport is scalar inside one band |
//! | `sigma_a`, `sigma_s`, `sigma_t` | absorption, scattering, extinction coefficient, 1/mm |
//! | `albedo` | `sigma_s / sigma_t` |
//! | `g` | mean cosine of the phase function; g > 0 is forward |
//! | `eta` | refractive index inside over outside |
//! | `mfp` | mean free path, `1 / sigma_t`, mm |
//! | `mu` | cosine between propagation directions (phase functions) or to an axis (named so) |
//! | `wo`, `wi` | unit directions, both away from the point: towards the sensor, towards the light |
//! | `pdf` | density per solid angle; other measures are named: `pdf_area`, `pdf_distance` |
//! | weight | value over pdf of one sampling decision |
//! | throughput | product of the weights along a path |
//! | transmittance | `exp(-sigma_t d)` |
//! | `u` | uniform numbers in [0, 1) |
//! | technique | one way of drawing a sample |
//! | estimator | techniques plus weights |
//! | pass | one independent realisation of all observables of a cell: the unit of independence |
//! | block | a fixed run of passes: the unit of scheduling and resuming; never enters a result |
//! | batch | passes whose moments a record keeps together; set by the number of passes alone |
//! | observable | a pixel, a region's or tile's mean, a flux, a transport class |
//! | cell | one point of an experiment's sweep |
//! | record | what a run writes |
//! | claim | what an experiment file says must hold |
//! | verdict | what verification says of a claim: pass, fail, underpowered or invalid |

// Tests compare portable functions with std's; what ships is linted without them.
#![cfg_attr(test, allow(clippy::disallowed_methods))]

/// User-facing errors: what is wrong, where, and what to do.
pub mod error;

/// Vectors, frames, and every transcendental function that results use.
pub mod math;

/// Random streams, warps with their pdf twins, MIS.
pub mod sampling;

/// Fresnel, microfacets, boundaries, phase functions, media, spectra and materials.
pub mod optics;

/// Shapes, meshes and the border between f32 culling and f64 intersection.
pub mod geometry;

/// The immutable scene: body, lights, sensors.
pub mod scene;

/// The catalogue of samplers: what each draws, and the density that it claims to draw from.
pub mod samplers;

/// The one open trait and the estimators, one file each.
pub mod estimators;

/// Oracles: a value and its stated error.
pub mod reference;

/// Moments, tests, multiplicity.
pub mod stats;

/// Records, provenance, the atomic store, images.
pub mod results;

/// Claims and records in, verdicts out.
pub mod verify;

/// Tables and images for people.
pub mod report;

/// Experiment files: schema, validation, build.
pub mod experiment;

/// Blocks, threads, checkpoints, ordered merge.
pub mod run;

/// The command line, one file a subcommand.
pub mod cli;
