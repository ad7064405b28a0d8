//! Directions in experiment files.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::math::{DVec3, cos, sin};

/// A direction: a vector of any length, or its cosine to +z and its azimuth about it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Direction {
    /// x, y, z; normalised when read.
    Vector([f64; 3]),
    /// Spherical coordinates.
    Polar(Polar),
}

/// A direction by its cosine to +z.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Polar {
    /// Cosine to the +z axis.
    #[schemars(range(min = -1.0, max = 1.0))]
    pub cos_z: f64,
    /// Angle from +x towards +y, degrees.
    pub azimuth_deg: f64,
}

impl Direction {
    /// The unit vector; not finite for a vector of length 0.
    pub fn unit(&self) -> DVec3 {
        match self {
            Direction::Vector(v) => unit(*v),
            Direction::Polar(polar) => {
                let sin_z = (1.0 - polar.cos_z * polar.cos_z).max(0.0).sqrt();
                let azimuth = polar.azimuth_deg * (std::f64::consts::PI / 180.0);
                DVec3::new(sin_z * cos(azimuth), sin_z * sin(azimuth), polar.cos_z)
            }
        }
    }
}

/// The unit vector along `v`; not finite for length 0. Scaled first, so that no square overflows.
pub(super) fn unit(v: [f64; 3]) -> DVec3 {
    let v = DVec3::from_array(v);
    let v = v / v.abs().max_element();
    v / v.dot(v).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_have_unit_length() {
        let polar = Direction::Polar(Polar { cos_z: 0.6, azimuth_deg: 90.0 });
        assert!((polar.unit() - DVec3::new(0.0, 0.8, 0.6)).abs().max_element() < 1e-15);
        assert_eq!(unit([0.0, 3e200, 4e200]), DVec3::new(0.0, 0.6, 0.8));
        assert!(!unit([0.0; 3]).is_finite());
    }
}
