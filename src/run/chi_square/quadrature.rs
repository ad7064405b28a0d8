//! Integrals of a sampler's density over boxes of its charts, with bounds of their errors.
//!
//! Tensor products of the Gauss-Kronrod pair (7, 15). The bound of a box is what replacing the Kronrod
//! rule by the Gauss rule along either coordinate changes, summed over both: it measures the error of
//! the 7-point rule and so overstates that of the 15-point one. Boxes are cut at the stated kinks; then
//! the box with the largest bound is halved, along the coordinate that contributes more, until all
//! bounds together are small enough or the budget of evaluations is spent.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use crate::math::gauss_kronrod;
use crate::samplers::{Contrast, Coordinate, Piece, Sampler};

/// Densities are taken to be exact to this relative error: what a draw's own density may differ by.
pub(crate) const ROUNDING: f64 = 1e-9;

/// Sum of all bounds at which refinement ends.
const TARGET: f64 = 1e-9;

/// Evaluations of the density that refinement may spend.
const BUDGET: u64 = 2_000_000;

/// An integral and a bound of its error.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Mass {
    /// Estimate of the integral.
    pub value: f64,
    /// Bound of its error.
    pub bound: f64,
}

impl Mass {
    /// Adds the mass and the bound of another region.
    pub(crate) fn add(&mut self, other: Mass) {
        self.value += other.value;
        self.bound += other.bound;
    }
}

/// A box in the chart of a piece. Along a periodic axis it may reach beyond the range: points are
/// wrapped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Area {
    /// Index of the piece of the chart.
    pub piece: usize,
    /// Lower corner, in coordinates of the piece.
    pub low: [f64; 2],
    /// Upper corner, in coordinates of the piece.
    pub high: [f64; 2],
}

/// Part of an area.
#[derive(Clone, Copy, Debug)]
struct SubArea {
    owner: usize,
    area: Area,
    mass: Mass,
    /// The coordinate along which to halve it.
    axis: usize,
}

/// The largest bound first; of equal ones the first region.
#[derive(PartialEq)]
struct LargestBound(f64, usize);

impl Eq for LargestBound {}

impl PartialOrd for LargestBound {
    fn partial_cmp(&self, other: &LargestBound) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for LargestBound {
    fn cmp(&self, other: &LargestBound) -> Ordering {
        self.0.total_cmp(&other.0).then(other.1.cmp(&self.1))
    }
}

/// Integrates a sampler's density.
pub(crate) struct Quadrature<'a> {
    sampler: &'a dyn Sampler,
    pieces: Vec<Piece>,
    nodes: [(f64, f64, f64); 15],
    regions: Vec<SubArea>,
    /// Evaluations so far.
    pub evaluations: u64,
    /// Evaluations that were negative or not finite; they count as 0.
    pub senseless: u64,
}

impl<'a> Quadrature<'a> {
    /// Nothing is integrated yet.
    pub(crate) fn new(sampler: &'a dyn Sampler) -> Quadrature<'a> {
        Quadrature {
            sampler,
            pieces: sampler.pieces(),
            nodes: gauss_kronrod(),
            regions: Vec::new(),
            evaluations: 0,
            senseless: 0,
        }
    }

    /// Pieces of the sampler's chart.
    pub(crate) fn pieces(&self) -> &[Piece] {
        &self.pieces
    }

    /// Integrates over an area without refinement, and keeps its parts for `owner`.
    pub(crate) fn add(&mut self, owner: usize, area: Area) -> Mass {
        let axes = &self.pieces[area.piece].axes;
        let cuts = [0, 1].map(|k| cuts(&axes[k], area.low[k], area.high[k]));
        let mut sum = Mass::default();
        for x in cuts[0].windows(2) {
            for y in cuts[1].windows(2) {
                let part = Area { piece: area.piece, low: [x[0], y[0]], high: [x[1], y[1]] };
                let region = self.region(owner, part);
                sum.add(region.mass);
                self.regions.push(region);
            }
        }
        sum
    }

    /// The mass of a stretch of a one-dimensional piece, not kept.
    pub(crate) fn stretch(&mut self, piece: usize, low: f64, high: f64) -> f64 {
        self.region(0, Area { piece, low: [low, 0.0], high: [high, 1.0] }).mass.value
    }

    /// Frees the values that are kept between calls.
    pub(crate) fn forget(&mut self) {
        self.regions.clear();
    }

    /// Forgets the parts of an owner.
    pub(crate) fn forget_owner(&mut self, owner: usize) {
        self.regions.retain(|region| region.owner != owner);
    }

    /// Halves the worst regions until the bounds sum to the target or the budget is spent; whether it
    /// was.
    pub(crate) fn refine(&mut self) -> bool {
        let worst = |(i, region): (usize, &SubArea)| LargestBound(region.mass.bound, i);
        let mut heap: BinaryHeap<LargestBound> = self.regions.iter().enumerate().map(worst).collect();
        let mut total: f64 = self.regions.iter().map(|region| region.mass.bound).sum();
        let end = self.evaluations + BUDGET;
        while total > TARGET && self.evaluations < end {
            let Some(LargestBound(bound, i)) = heap.pop() else { break };
            let SubArea { owner, area, axis, .. } = self.regions[i];
            let middle = 0.5 * (area.low[axis] + area.high[axis]);
            let (mut first, mut second) = (area, area);
            (first.high[axis], second.low[axis]) = (middle, middle);
            total -= bound;
            for (slot, half) in [(i, first), (self.regions.len(), second)] {
                let region = self.region(owner, half);
                total += region.mass.bound;
                heap.push(LargestBound(region.mass.bound, slot));
                if slot == i { self.regions[i] = region } else { self.regions.push(region) }
            }
        }
        total > TARGET
    }

    /// The masses of all owners 0..`count`, rounding of the densities in their bounds.
    pub(crate) fn masses(&self, count: usize) -> Vec<Mass> {
        let mut masses = vec![Mass::default(); count];
        self.regions.iter().for_each(|region| masses[region.owner].add(region.mass));
        masses.iter_mut().for_each(|mass| mass.bound += ROUNDING * mass.value);
        masses
    }

    /// The integral of a contrast times the density over everything that is kept.
    pub(crate) fn contrast(&mut self, contrast: &Contrast) -> Mass {
        let mut sum = Mass::default();
        for i in 0..self.regions.len() {
            let SubArea { area, .. } = self.regions[i];
            let region = self.integrate(0, area, &|at| (contrast.of)(area.piece, at));
            sum.add(region.mass);
        }
        // The contrast is bounded, so that its rounding is the density's times its bound.
        sum.bound += ROUNDING * sum.value.abs().max(1.0);
        sum
    }

    fn region(&mut self, owner: usize, area: Area) -> SubArea {
        self.integrate(owner, area, &|_| 1.0)
    }

    /// The rule on one box, of the density times `factor`.
    fn integrate(&mut self, owner: usize, area: Area, factor: &dyn Fn([f64; 2]) -> f64) -> SubArea {
        let piece = &self.pieces[area.piece];
        let is_line = piece.dimensions == 1;
        let middle = |k: usize| 0.5 * (area.low[k] + area.high[k]);
        let half = |k: usize| 0.5 * (area.high[k] - area.low[k]);
        let one = [(0.0, 2.0, 2.0)];
        let second: &[(f64, f64, f64)] = if is_line { &one } else { &self.nodes };
        let (mut kk, mut gk, mut kg) = (0.0, 0.0, 0.0);
        let mut senseless = 0;
        for (x, kx, gx) in self.nodes {
            let x = wrap(&piece.axes[0], middle(0) + half(0) * x);
            let (mut k, mut g) = (0.0, 0.0);
            for &(y, ky, gy) in second {
                let y = if is_line { 0.5 } else { wrap(&piece.axes[1], middle(1) + half(1) * y) };
                let mut density = self.sampler.density(area.piece, [x, y]);
                if !density.is_finite() || density < 0.0 {
                    senseless += 1;
                    density = 0.0;
                }
                let value = density * factor([x, y]);
                k += ky * value;
                g += gy * value;
            }
            kk += kx * k;
            gk += gx * k;
            kg += kx * g;
        }
        self.evaluations += 15 * second.len() as u64;
        self.senseless += senseless;
        let size = half(0) * half(1);
        let (along_x, along_y) = ((kk - gk).abs(), (kk - kg).abs());
        let mass = Mass { value: size * kk, bound: size * (along_x + along_y) };
        SubArea { owner, area, mass, axis: usize::from(along_y > along_x) }
    }
}

/// The point of the range that a coordinate beyond it denotes.
pub(crate) fn wrap(axis: &Coordinate, x: f64) -> f64 {
    let [low, high] = axis.range;
    if !axis.periodic || (low..=high).contains(&x) { x } else { low + (x - low).rem_euclid(high - low) }
}

/// The ends of a stretch and the kinks within it; where it reaches beyond a periodic range, the seam is
/// one.
fn cuts(axis: &Coordinate, low: f64, high: f64) -> Vec<f64> {
    let [from, to] = axis.range;
    let mut cuts = vec![low, high];
    for kink in axis.kinks.iter().copied().chain([from, to]) {
        cuts.push(kink);
        if axis.periodic {
            cuts.push(kink + (to - from));
        }
    }
    cuts.retain(|x| (low..=high).contains(x));
    cuts.sort_by(f64::total_cmp);
    cuts.dedup();
    cuts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samplers::Draw;
    use crate::sampling::stream::Stream;

    /// Density of a plane: 1 + sin(2 pi y)/2 where x is below the kink at 0.3, twice that above; y is
    /// periodic.
    struct Step;

    impl Sampler for Step {
        fn draw(&self, _: &mut Stream) -> Draw {
            Draw::Null
        }

        fn pieces(&self) -> Vec<Piece> {
            let x = Coordinate { range: [0.0, 1.0], kinks: vec![0.3], periodic: false };
            vec![Piece::plane("plane", [x, Coordinate::turns()])]
        }

        fn density(&self, _: usize, [x, y]: [f64; 2]) -> f64 {
            let wave = 1.0 + 0.5 * crate::math::sin_cos_turns(y).0;
            if x < 0.3 { wave } else { 2.0 * wave }
        }
    }

    fn area(low: [f64; 2], high: [f64; 2]) -> Area {
        Area { piece: 0, low, high }
    }

    /// Over [0, 1] x [y, y + 1] for any y: 0.3 + 2 * 0.7. Over half a turn: 1/2 + 1/(2 pi) of that.
    #[test]
    fn kinks_are_edges_and_seams_are_crossed() {
        let mut quadrature = Quadrature::new(&Step);
        for y in [0.0, 0.38, 0.9] {
            let mass = quadrature.add(0, area([0.0, y], [1.0, y + 1.0]));
            assert!((mass.value - 1.7).abs() < 1e-12 && mass.bound < 1e-3, "{mass:?}");
        }
        let half = quadrature.add(1, area([0.0, 1.0], [1.0, 1.5]));
        assert!((half.value - 1.7 * (0.5 + 0.5 / std::f64::consts::PI)).abs() < 1e-12, "{half:?}");
        quadrature.forget_owner(0);
        assert!(!quadrature.refine());
        let masses = quadrature.masses(2);
        assert_eq!(masses[0], Mass::default());
        assert!(masses[1].bound < 3e-9 && (masses[1].value - half.value).abs() < 1e-12);
    }

    /// A kink that is not stated is found by refinement, and the bound covers what is left.
    #[test]
    fn bounds_cover_errors() {
        struct Hidden;
        impl Sampler for Hidden {
            fn draw(&self, _: &mut Stream) -> Draw {
                Draw::Null
            }
            fn pieces(&self) -> Vec<Piece> {
                vec![Piece::line("line", Coordinate::over(0.0, 1.0))]
            }
            fn density(&self, _: usize, [x, _]: [f64; 2]) -> f64 {
                if x < 1.0 / 3.0 { 1.0 } else { f64::from(u8::from(x < 0.9)) * 2.0 }
            }
        }
        let truth = 1.0 / 3.0 + 2.0 * (0.9 - 1.0 / 3.0);
        let mut quadrature = Quadrature::new(&Hidden);
        let rough = quadrature.add(0, area([0.0, 0.0], [1.0, 1.0]));
        assert!((rough.value - truth).abs() < rough.bound, "{rough:?}");
        assert!(!quadrature.refine());
        let mass = quadrature.masses(1)[0];
        assert!((mass.value - truth).abs() < mass.bound && mass.bound < 1e-8, "{mass:?}");
    }
}
