//! Growth of importance that is learned from walks, per cell of the body: path guiding with one lobe per cell, multiplied by the
//! phase function, and with guided distances (both as in Herholz et al. 2019, "Volume path guiding based on zero-variance random
//! walk theory"), for comparison with the diffusion solution.
//!
//! A turn that scores points, on average over the walks that come by, along the gradient of importance. Let m be its mean
//! cosine. In the diffusion limit importance is 1 + s / (1 - a g) w.n in angle, whose mean cosine is s / (3 (1 - a g)); for
//! isotropic scattering and any s, 1 / (1 - s w.n) has the mean cosine
//!   1 / s - 2 / ln((1 + s) / (1 - s)),
//! s / 3 for small s. So s is that function's inverse at m (1 - a g). How walks learn is in `warm_up`.

use super::WalkDraw;
use super::importance::extent;
use crate::geometry::Shape;
use crate::math::{DVec3, bracketed_root, ln_1p};
use crate::optics::guided::{MOST, Pull};
use crate::optics::medium::Medium;
use crate::scene::Scene;

/// A cell where fewer turns have scored is not guided: their mean direction would be noise.
const FEWEST: u32 = 32;

/// Cubic cells of a body; what is outside belongs to the cell that is nearest along every axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::estimators) struct LearningCells {
    low: DVec3,
    per_side: f64,
    counts: [usize; 3],
}

impl LearningCells {
    /// `cells` along the longest side of a finite body, or through a slab; in a half-space down to ten transport mean free
    /// paths of a band.
    pub(in crate::estimators) fn new(scene: &Scene, band: usize, cells: u32) -> LearningCells {
        let layered = |depth: f64| LearningCells {
            low: DVec3::new(0.0, 0.0, -depth),
            per_side: f64::from(cells) / depth,
            counts: [1, 1, cells as usize],
        };
        match *scene.shape {
            Shape::HalfSpace => {
                let medium = &scene.medium[band];
                layered(10.0 / (medium.sigma_t * (1.0 - medium.phase.g)))
            }
            Shape::Slab { thickness } => layered(thickness),
            _ => {
                let [low, high] = extent(&scene.shape).expect("any other body is finite");
                let size = high - low;
                let per_side = f64::from(cells) / size.max_element();
                let counts = [0, 1, 2].map(|axis| ((size[axis] * per_side).ceil() as usize).max(1));
                LearningCells { low, per_side, counts }
            }
        }
    }

    /// How many there are.
    pub(in crate::estimators) fn count(&self) -> usize {
        self.counts.iter().product()
    }

    /// The cell of a point.
    #[inline]
    pub(in crate::estimators) fn of(&self, x: DVec3) -> usize {
        let place = (x - self.low) * self.per_side;
        // The cast takes what is negative to 0.
        let cell = |axis: usize| (place[axis] as u32 as usize).min(self.counts[axis] - 1);
        (cell(2) * self.counts[1] + cell(1)) * self.counts[0] + cell(0)
    }
}

/// What turns in one cell have found.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::estimators) struct FoundLight {
    turns: u32,
    all: f64,
    /// Their directions, weighted by what they found.
    toward: DVec3,
}

impl FoundLight {
    /// A turn has found this much, which is positive.
    pub(in crate::estimators) fn add(&mut self, dir: DVec3, found: f64) {
        self.turns += 1;
        self.all += found;
        self.toward += dir * found;
    }

    fn pull(&self, medium: &Medium) -> Pull {
        let mean = self.toward / self.all;
        if self.turns < FEWEST || !mean.is_finite() {
            return Pull::NONE;
        }
        let cosine = mean.length() * (1.0 - medium.albedo * medium.phase.g);
        Pull::new(mean.normalize_or_zero() * growth_of_mean(cosine))
    }
}

/// The growth per mean free path, up to [`MOST`], whose lobe has this mean cosine.
fn growth_of_mean(cosine: f64) -> f64 {
    let spread = |s: f64| ln_1p(2.0 * s / (1.0 - s));
    let mean = |s: f64| 1.0 / s - 2.0 / spread(s);
    let slope = |s: f64| 4.0 / ((1.0 - s * s) * spread(s) * spread(s)) - 1.0 / (s * s);
    // Below it the difference has lost its digits, and is s / 3.
    const LEAST: f64 = 1e-3;
    if cosine <= mean(LEAST) {
        return 3.0 * cosine;
    }
    if cosine >= mean(MOST) {
        return MOST;
    }
    bracketed_root(|s| (mean(s) - cosine, slope(s)), [LEAST, MOST], true, (3.0 * cosine).min(0.9))
}

/// Growth of importance per cell.
#[derive(Clone, Debug)]
pub(in crate::estimators) struct LearnedPulls {
    cells: LearningCells,
    pulls: Vec<Pull>,
}

impl LearnedPulls {
    /// From what was found in each cell.
    pub(in crate::estimators) fn new(
        cells: LearningCells,
        found: &[FoundLight],
        medium: &Medium,
    ) -> LearnedPulls {
        LearnedPulls { cells, pulls: found.iter().map(|found| found.pull(medium)).collect() }
    }

    #[inline]
    pub(super) fn at(&self, x: DVec3) -> Pull {
        self.pulls[self.cells.of(x)]
    }

    /// Memory on the heap, bytes.
    pub(super) fn heap_bytes(&self) -> usize {
        size_of_val(&*self.pulls)
    }
}

/// How walks learn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::estimators) struct Lessons {
    /// Share of turns and flights that are guided.
    pub share: f64,
    /// Cells along the longest side of the body.
    pub cells: u32,
    /// Paths per band.
    pub paths: u64,
}

impl WalkDraw {
    /// What has to be learned before walks are drawn in this way.
    pub(in crate::estimators) fn lessons(&self) -> Option<Lessons> {
        match *self {
            WalkDraw::Learned { share, cells, paths } => Some(Lessons { share, cells, paths }),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::integrate;

    /// The mean cosine of 1 / (1 - s m) by quadrature, and back.
    #[test]
    fn growth_has_its_mean_cosine() {
        for s in [1e-5, 1e-3, 0.02, 0.4, 0.9, 0.959] {
            let moment = |power: i32| {
                let of = |m: f64| m.powi(power) / (1.0 - s * m);
                integrate(of, -1.0, 1.0, 1e-13).value
            };
            let found = growth_of_mean(moment(1) / moment(0));
            assert!((found / s - 1.0).abs() < 1e-6, "{s}: {found}");
        }
        assert_eq!(growth_of_mean(0.99), MOST);
        assert_eq!(growth_of_mean(0.0), 0.0);
    }
}
