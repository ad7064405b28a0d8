//! History of a path, and the transport class that follows from it.

/// Classes of light transport, told apart by a path's history, the same for every estimator.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum TransportClass {
    /// Reflected at the surface, or through the body without scattering.
    Surface,
    /// Paths with one medium vertex.
    Single,
    /// One medium vertex and an internal reflection.
    SingleInternal,
    /// Two or more medium vertices.
    Multiple,
    /// Two or more medium vertices and an internal reflection.
    MultipleInternal,
}

impl TransportClass {
    /// All classes, in the order of observables.
    pub const ALL: [TransportClass; 5] = [
        TransportClass::Surface,
        TransportClass::Single,
        TransportClass::SingleInternal,
        TransportClass::Multiple,
        TransportClass::MultipleInternal,
    ];

    /// Its name in records and claims.
    pub fn name(self) -> &'static str {
        match self {
            TransportClass::Surface => "surface",
            TransportClass::Single => "single",
            TransportClass::SingleInternal => "single_internal",
            TransportClass::Multiple => "multiple",
            TransportClass::MultipleInternal => "multiple_internal",
        }
    }
}

/// Events along a path so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct History {
    medium_vertices: u32,
    internal_reflection: bool,
}

impl History {
    /// The path scattered in the medium.
    #[inline]
    pub fn scatter(&mut self) {
        self.medium_vertices = self.medium_vertices.saturating_add(1);
    }

    /// The path scattered as often in the medium.
    #[inline]
    pub(super) fn scatter_often(&mut self, times: u64) {
        self.medium_vertices = self.medium_vertices.saturating_add(times.min(u32::MAX.into()) as u32);
    }

    /// The path was reflected at the boundary from inside.
    #[inline]
    pub fn reflect_internally(&mut self) {
        self.internal_reflection = true;
    }

    /// The class of a path with this history.
    #[inline]
    pub fn class(&self) -> TransportClass {
        match (self.medium_vertices, self.internal_reflection) {
            (0, _) => TransportClass::Surface,
            (1, false) => TransportClass::Single,
            (1, true) => TransportClass::SingleInternal,
            (_, false) => TransportClass::Multiple,
            (_, true) => TransportClass::MultipleInternal,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn classes_follow_the_history() {
        let mut history = History::default();
        history.reflect_internally();
        assert_eq!(history.class(), TransportClass::Surface);
        history.scatter();
        assert_eq!(history.class(), TransportClass::SingleInternal);
        let mut direct = History::default();
        direct.scatter();
        assert_eq!(direct.class(), TransportClass::Single);
        direct.scatter();
        assert_eq!(direct.class(), TransportClass::Multiple);
        direct.reflect_internally();
        assert_eq!(direct.class(), TransportClass::MultipleInternal);
    }
}
