//! Integration tests, one binary: the program as a user runs it, and the sources as a reader sees them.

// Tests compare portable functions with those of std.
#![allow(clippy::disallowed_methods)]

mod browser;
mod checks;
mod cli;
mod damage;
mod docs;
mod efficiency;
mod faults;
mod hostile;
mod interruption;
mod judging;
mod layering;
mod looks;
mod own_data;
mod pictures;
mod planted;
mod published;
mod reproducibility;
mod samplers;
mod shards;
mod tev;
mod work;
