//! Vectors, frames, and every transcendental function that results use.
//! Doors for `glam` and `libm`: the C library chooses its sine by CPU, libm's is the same everywhere.

pub use glam::{DVec2, DVec3, Vec3};
