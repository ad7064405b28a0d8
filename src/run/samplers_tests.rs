//! What experiments on samplers find.
