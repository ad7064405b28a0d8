//! Oracles: a value and its stated error, from closed forms and quadrature. They never use estimators.

/// Semi-infinite, index-matched, isotropically scattering media.
pub(crate) mod chandrasekhar;
