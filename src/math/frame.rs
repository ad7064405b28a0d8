//! Orthonormal frames.

use super::DVec3;

/// An orthonormal, right-handed frame whose third axis is a normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// First tangent.
    pub s: DVec3,
    /// Second tangent.
    pub t: DVec3,
    /// Normal.
    pub n: DVec3,
}

impl Frame {
    /// A frame about the unit vector `n` (Duff et al. 2017, "Building an Orthonormal Basis,
    /// Revisited": no branch except the sign of n.z, accurate for every n).
    #[inline]
    pub fn about(n: DVec3) -> Frame {
        let sign = 1f64.copysign(n.z);
        let a = -1.0 / (sign + n.z);
        let b = n.x * n.y * a;
        Frame {
            s: DVec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x),
            t: DVec3::new(b, sign + n.y * n.y * a, -n.y),
            n,
        }
    }

    /// Components of a world vector in this frame.
    #[inline]
    pub fn to_local(&self, v: DVec3) -> DVec3 {
        DVec3::new(self.s.dot(v), self.t.dot(v), self.n.dot(v))
    }

    /// The world vector with components `v`.
    #[inline]
    pub fn to_world(&self, v: DVec3) -> DVec3 {
        self.s * v.x + self.t * v.y + self.n * v.z
    }
}

/// A vector whose length is nearly 1 at length 1, by one Newton step: an error e of the length becomes 1.5 e^2.
#[inline]
pub fn renormalized(v: DVec3) -> DVec3 {
    v * (1.5 - 0.5 * v.length_squared())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_orthonormal_and_right_handed() {
        for n in [DVec3::Z, -DVec3::Z, DVec3::X, DVec3::new(0.3, -0.4, -0.866).normalize()] {
            let f = Frame::about(n);
            assert!((f.s.cross(f.t) - f.n).length() < 1e-15);
            assert!(f.s.dot(f.t).abs() < 1e-16 && (f.s.length() - 1.0).abs() < 1e-15);
            let v = DVec3::new(0.1, 2.0, -0.7);
            assert!((f.to_world(f.to_local(v)) - v).length() < 1e-15);
            let rounded = n.as_vec3().as_dvec3();
            assert!((renormalized(rounded).length() - 1.0).abs() < 1e-14, "{rounded}");
        }
    }
}
