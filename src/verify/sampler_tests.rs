//! What the records of samplers show.
