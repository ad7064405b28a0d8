//! Chi-square tests of samplers: bins chosen by the density, their masses by quadrature, counts of draws.

pub mod bins;
pub mod count;
pub mod quadrature;
