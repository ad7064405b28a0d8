//! Integration tests, one binary: the program as a user runs it, and the sources as a reader sees them.

mod browser;
mod cli;
mod damage;
mod docs;
mod efficiency;
mod interruption;
mod judging;
mod layering;
mod looks;
mod own_estimator;
mod pictures;
mod published;
mod reproducibility;
mod samplers;
mod tev;
mod tokens;
mod work;
