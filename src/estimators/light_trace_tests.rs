//! Energy, scaling and closed forms for the light tracer.
