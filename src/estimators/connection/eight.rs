//! [`Bounds`] of eight parts, tested all at once: the compiler vectorises the loop to the width that the target features of the
//! caller allow.

use super::bounds::{Bounds, PreparedQuery};

/// Bounds of up to eight parts.
#[derive(Clone, Debug)]
pub(super) struct EightBounds {
    center: [[f64; 8]; 3],
    radius: [f64; 8],
    axis: [[f64; 8]; 3],
    cos: [f64; 8],
    /// Eight.
    lanes: usize,
    /// A bit for every part.
    parts: u8,
}

impl EightBounds {
    /// # Panics
    /// With more than eight parts.
    pub(super) fn new(parts: &[Bounds]) -> EightBounds {
        assert!(parts.len() <= 8, "eight lanes");
        let of = |part: &dyn Fn(&Bounds) -> f64| {
            let mut lanes = [0.0; 8];
            lanes.iter_mut().zip(parts).for_each(|(lane, bounds)| *lane = part(bounds));
            lanes
        };
        EightBounds {
            center: [0, 1, 2].map(|axis| of(&|bounds| bounds.center[axis])),
            radius: of(&|bounds| bounds.radius),
            axis: [0, 1, 2].map(|axis| of(&|bounds| bounds.axis[axis])),
            cos: of(&|bounds| bounds.cos),
            lanes: 8,
            parts: ((1u32 << parts.len()) - 1) as u8,
        }
    }

    /// A bit for every part that may hold a root.
    #[inline(always)]
    pub(super) fn may_hold(&self, asked: &PreparedQuery) -> u8 {
        let EightBounds { center: [x, y, z], radius, axis: [u, v, w], cos, .. } = self;
        let mut holds = [0; 8];
        // A length that the compiler does not know: of eight it would make eight copies first.
        let lanes = self.lanes.min(8);
        for i in 0..lanes {
            let may = asked.may_hold([x[i], y[i], z[i]], radius[i], [u[i], v[i], w[i]], cos[i]);
            holds[i] = u64::from(may) << i;
        }
        holds.into_iter().fold(0, |all, bit| all | bit) as u8 & self.parts
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimators::connection::testing::{direction, stream};
    use crate::estimators::connection::throughput::Query;
    use crate::math::{DVec2, DVec3};

    /// Eight at once and one by one agree on every part: narrow and wide cones, far, near and around the point, both sides of
    /// refraction, smooth and tilted.
    #[test]
    fn lanes_are_the_bounds_one_by_one() {
        let mut stream = stream("lanes_are_the_bounds_one_by_one");
        let (mut held, mut ruled_out) = (0, 0);
        for round in 0..20_000 {
            let size = [1e-3, 0.1, 0.7][round % 3];
            let count = 1 + round % 8;
            let bounds: Vec<Bounds> = (0..count)
                .map(|_| {
                    let normal = direction(&mut stream);
                    let spread = size * [0.1, 3.0][round / 3 % 2];
                    let mut points = [DVec3::ZERO; 3];
                    let mut normals = [DVec3::ZERO; 3];
                    for i in 0..3 {
                        points[i] = normal + direction(&mut stream) * size;
                        normals[i] = (normal + direction(&mut stream) * spread).normalize();
                    }
                    Bounds::new(points.into_iter(), normals.into_iter())
                })
                .collect();
            let slopes = if round % 5 == 0 { DVec2::new(0.2, -0.1) } else { DVec2::ZERO };
            let x = direction(&mut stream) * stream.draw();
            let eta = [1.4, 0.7][round / 7 % 2];
            let query = Query { x, w_l: direction(&mut stream), eta, slopes };
            let eight = EightBounds::new(&bounds).may_hold(&PreparedQuery::new(&query));
            for (lane, bounds) in bounds.iter().enumerate() {
                let one = bounds.may_hold(&query);
                assert_eq!(eight >> lane & 1 == 1, one, "{round} {lane}");
                *(if one { &mut held } else { &mut ruled_out }) += 1;
            }
            assert_eq!(u32::from(eight) >> count, 0, "no part beyond the last");
        }
        assert!(held > 1000 && ruled_out > 1000, "{held} {ruled_out}");
    }
}
