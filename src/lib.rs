//! scatterproof: a research testbed for light that enters a body through a refractive surface,
//! scatters inside it, and leaves again.
//!
//! One TOML file is one experiment. The program runs its estimators per wavelength band and writes a record; a
//! verification layer judges the claims of the record, and reports are made from the record alone.
//!
//! # Two sides that never import each other
//!
//! ```text
//! simulation   math -> sampling -> optics -> geometry -> scene -> estimators
//!                                                        scene -> samplers  (the catalogue of samplers)
//!              math -> optics -> reference          (closed forms; never sees the estimators)
//! bridge       experiment -> run                    (the only modules that see both sides)
//! evidence     math -> stats -> results -> verify -> report
//! ```
//!
//! Simulation turns random numbers into scores and knows no file, thread or p-value. Evidence turns
//! stored moments and counts into verdicts, tables and plots, and knows no ray. Data flows one way:
//! `experiments/x.toml` -> schema -> validated experiment -> scene + estimators -> blocks of passes
//! -> moments -> `results/x/` -> `verify` and `report`, which read only `results/`.
//! A module uses only what comes before it in this picture; `tests/layering.rs` reads the sources
//! and fails on any other edge.
//!
//! # Words
//!
//! One word has one meaning, in code, files, tables and messages.
//!
//! | word | meaning |
//! |---|---|
//! | band | one wavelength interval with scalar optical properties and scalar transport |
//! | `sigma_a`, `sigma_s`, `sigma_t` | absorption, scattering, extinction coefficient, 1/mm |
//! | `albedo` | `sigma_s / sigma_t` |
//! | `g` | mean cosine of the phase function; g > 0 is forward |
//! | `eta` | refractive index inside over outside |
//! | `mfp` | mean free path, `1 / sigma_t`, mm |
//! | `mu` | cosine between propagation directions (phase functions) or to an axis (named so) |
//! | `wo`, `wi` | unit directions, both away from the point: towards the sensor, towards the light |
//! | transmittance | `exp(-sigma_t d)` |
//! | `u` | uniform numbers in [0, 1) |
//! | `pdf` | density per solid angle; other measures are named: `pdf_area`, `pdf_distance` |
//! | weight | value over pdf of one sampling decision |
//! | throughput | product of the weights along a path |
//! | technique | one way of drawing a sample |
//! | sampler | a function from uniform numbers to samples, with the density that it claims |
//! | estimator | techniques plus weights |
//! | kind | type of an entry of an experiment file, a name in a registry: `path`, `henyey_greenstein` |
//! | skipped | of a light: not connected to by subdivision, and sampled by path tracing only |
//! | cell | one point of an experiment's sweep, and nothing else |
//! | observable | a pixel, the mean of a region or tile, a flux, each by transport class |
//! | pass | one independent realisation of all observables of a cell: the unit of independence |
//! | block | a fixed run of passes: the unit of scheduling and resuming; never enters a result |
//! | batch | passes whose moments a record keeps together; set by the number of passes alone |
//! | run | all passes of one estimator in one cell, and what the record keeps of them |
//! | arm | one of the runs that are compared by cost |
//! | interleaved | run by turns, A B .. B A, so that CPU times of the arms can be compared |
//! | campaign | all that one experiment plans and runs: cells with estimators, or samplers |
//! | record | what a campaign writes |
//! | re-run | to run a published experiment again and compare its record |
//! | claim | a statement in an experiment file that must hold |
//! | comparison | one test of a claim: one quantity against a value or another quantity |
//! | verdict | the outcome of a comparison: pass, fail, underpowered or invalid |
//! | look | one round of tests; what fails the first look is measured again for the second |
//! | bin | a set of samples whose count a chi-square test compares with its expected mass |
//! | gate | a check that a change must pass in continuous integration, and nothing else |

// What is `pub` is for estimators of your own and for readers of records; the compiler finds the rest unused.
#![deny(unreachable_pub)]
// Tests compare portable functions with std's; what ships is linted without them.
#![cfg_attr(test, allow(clippy::disallowed_methods))]

/// User-facing errors: what is wrong, where, and what to do.
pub mod error;

/// Files that are read as input.
pub(crate) mod input;

/// Vectors, frames, and every transcendental function that results use.
pub mod math;

/// Random streams, warps with their pdf twins, MIS.
pub mod sampling;

/// Fresnel, microfacets, boundaries, phase functions, media, spectra and materials.
pub mod optics;

/// Shapes, meshes, and intersection: culling in f32, hits in f64.
pub mod geometry;

/// The immutable scene: body, lights, sensors.
pub mod scene;

/// The catalogue of samplers: what each draws, and the density that it claims.
pub mod samplers;

/// The trait of estimators, and the estimators, one file each.
pub mod estimators;

/// Closed forms that tests compare with: a value and its stated error.
#[cfg(test)]
mod reference;

/// Moments, hypothesis tests, multiple testing.
pub mod stats;

/// Records, provenance, the atomic store, images.
pub mod results;

/// From claims and records to verdicts.
pub mod verify;

/// Tables and images for people.
mod report;

/// Experiment files: schema, validation, build.
pub mod experiment;

/// Blocks, threads, checkpoints, ordered merge.
mod run;

/// The command line, one file per subcommand.
pub mod cli;
