//! Points of the boundary: the first hit along a sampled direction from a medium vertex.
//!
//! Three lobes, mixed: uniform directions; directions to the tangent plane of the specular guess, by
//! area about the vertex's foot; directions about the guess itself, with density falling as 1 / sin of
//! the angle, which is how a vertex near the refracted ray of a boundary point sees that point.

use super::guess::Guess;
use crate::math::DVec3;
use crate::sampling::discrete::choose;
use crate::sampling::plane::PlaneLobe;
use crate::sampling::towards::TowardsPoint;
use crate::sampling::warp::{pdf_cap, square_to_cap};

/// 1 - cos of the angle that the whole sphere reaches.
const WHOLE: f64 = 2.0;

/// Shares of the lobes; they sum to 1, and the uniform one is positive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProbeShares {
    /// Share of uniform directions.
    pub uniform: f64,
    /// The tangent plane of the specular guess.
    pub plane: f64,
    /// About the specular guess.
    pub guided: f64,
}

impl ProbeShares {
    /// Whether the lobes need a specular guess.
    pub(super) fn needs_guess(&self) -> bool {
        self.uniform < 1.0
    }
}

/// The mixture at one vertex.
pub(super) struct ProbeMixture {
    shares: ProbeShares,
    plane: Option<PlaneLobe>,
    guided: Option<TowardsPoint>,
}

impl ProbeMixture {
    /// At a vertex; lobes that its guess does not allow give their share to the uniform one.
    pub(super) fn new(shares: ProbeShares, guess: Option<&Guess>, mfp: f64) -> ProbeMixture {
        let plane = guess.filter(|_| shares.plane > 0.0).and_then(|guess| {
            let height = guess.distance * guess.dir.dot(guess.normal);
            (height > 0.0).then(|| PlaneLobe::new(guess.normal, height, mfp))
        });
        let guided =
            guess.filter(|_| shares.guided > 0.0).and_then(|guess| TowardsPoint::new(guess.dir));
        let shares = ProbeShares {
            plane: if plane.is_some() { shares.plane } else { 0.0 },
            guided: if guided.is_some() { shares.guided } else { 0.0 },
            ..shares
        };
        let shares = ProbeShares { uniform: 1.0 - shares.plane - shares.guided, ..shares };
        ProbeMixture { shares, plane, guided }
    }

    /// A direction from the vertex.
    pub(super) fn sample(&self, [u, v]: [f64; 2]) -> DVec3 {
        let (is_guided, u) = choose(u, self.shares.guided);
        if let (true, Some(guided)) = (is_guided, &self.guided) {
            return guided.sample([u, v]);
        }
        let (is_plane, u) = choose(u, self.shares.plane / (1.0 - self.shares.guided));
        match &self.plane {
            Some(plane) if is_plane => plane.sample([u, v]),
            _ => square_to_cap(WHOLE, [u, v]),
        }
    }

    /// Density of [`Self::sample`] per solid angle.
    pub(super) fn pdf(&self, dir: DVec3) -> f64 {
        self.shares.uniform * pdf_cap(WHOLE)
            + self.guided.as_ref().map_or(0.0, |lobe| self.shares.guided * lobe.pdf(dir))
            + self.plane.as_ref().map_or(0.0, |lobe| self.shares.plane * lobe.pdf(dir))
    }
}
