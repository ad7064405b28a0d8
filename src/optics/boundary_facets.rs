//! Directions by several facets.
//!
//! One facet of a rough surface, drawn from the visible normals, gives a direction whose weight is G1, or none where the
//! direction is on the wrong side: from inside a body of index 1.4 and GGX roughness 0.2 that is 5 % of the light, and the
//! variance of a weight is 0.054 (directions by cosine). The mean weight of a few facets, with a direction chosen in proportion to
//! theirs (resampled importance sampling, Talbot et al. 2005), has the same expectation.

use super::{Boundary, BoundarySample, Event, side_eta, through, visible_facet};
use crate::math::{DVec3, GOLDEN, Vectorized, vectorized};
use crate::optics::fresnel::fresnel;
use crate::optics::microfacet::{MicrofacetKind, Microfacets};
use crate::sampling::discrete::choose;

/// The most facets out of which one is chosen.
const MOST_FACETS: usize = 8;

/// Facets for walks that know little of what light finds.
pub const FEW_FACETS: usize = 3;

/// The most facets that pay for light that meets the surface from outside, of which few facets send any to the wrong side; so many
/// fill one vector.
pub const FACETS_FROM_OUTSIDE: usize = 4;

/// The second coordinates of a lattice, one per facet; the first are multiples of one part of their number.
const LATTICE: [f64; MOST_FACETS] = {
    let mut points = [0.0; MOST_FACETS];
    let mut i = 0;
    while i < MOST_FACETS {
        points[i] = (i as f64 * GOLDEN) % 1.0;
        i += 1;
    }
    points
};

/// The two lobes.
const EVENTS: [Event; 2] = [Event::Reflect, Event::Refract];

/// Where facets send light, of one lobe.
struct FacetLobe {
    /// Facets.
    count: usize,
    weights: [f64; MOST_FACETS],
    /// Of the weights.
    sum: f64,
    /// x, y, z of each facet's direction.
    directions: [[f64; MOST_FACETS]; 3],
}

impl FacetLobe {
    fn none(count: usize) -> FacetLobe {
        let (weights, directions) = ([0.0; MOST_FACETS], [[0.0; MOST_FACETS]; 3]);
        FacetLobe { count, weights, sum: 0.0, directions }
    }

    /// Of light that belongs on this side of the surface, with its G1.
    #[inline(always)]
    fn set(&mut self, facet: usize, way: &Way, side: f64, g1: f64) {
        let Way { wi, share } = *way;
        self.weights[facet] = if share > 0.0 && wi.z * side > 0.0 { share * g1 } else { 0.0 };
        let [x, y, z] = &mut self.directions;
        (x[facet], y[facet], z[facet]) = (wi.x, wi.y, wi.z);
    }

    /// Mean over the facets.
    #[inline]
    fn weight(&self) -> f64 {
        self.sum / self.count as f64
    }

    /// One direction, in proportion to its weight; `None` where none weighs anything.
    fn choose(&self, u: f64) -> Option<DVec3> {
        let mut rest = u * self.sum;
        let mut chosen = None;
        for (facet, weight) in self.weights[..self.count].iter().enumerate() {
            if *weight > 0.0 {
                chosen = Some(facet); // the last one where rounding leaves a rest
                if rest < *weight {
                    break;
                }
            }
            rest -= weight;
        }
        chosen.map(|facet| DVec3::from_array(self.directions.map(|axis| axis[facet])))
    }
}

impl Boundary {
    /// Facets per meeting that pay for walks whose other variance is small, by measured efficiency under a sky: rougher
    /// surfaces send more of them to the wrong side. Visible normals of Beckmann's distribution are found by iteration.
    pub fn facets_that_pay(&self) -> usize {
        match self {
            Boundary::Rough { facets: Microfacets { kind: MicrofacetKind::Ggx, alpha }, .. } => {
                match alpha {
                    0.15.. => MOST_FACETS,
                    0.08.. => 5,
                    _ => FEW_FACETS,
                }
            }
            _ => FEW_FACETS,
        }
    }

    /// [`Boundary::sample`] out of `count` facets (at most 8), which a rough surface has, and both lobes of each: one direction in
    /// proportion to its weight, times `gain` where it is refracted, and weighted accordingly. With a gain of 1 the weight is
    /// the mean weight of a facet; with what refracted light finds over what reflected light finds, the product of weight and
    /// light found is the same for both. Weights of the balance heuristic may use the density of [`Self::sample`], since they need
    /// but sum to 1.
    pub fn sample_of_several(
        &self,
        wo: DVec3,
        u: [f64; 3],
        gain: f64,
        count: usize,
    ) -> Option<BoundarySample> {
        if let Boundary::Rough { eta, facets } = *self {
            let mut lobes = [FacetLobe::none(count), FacetLobe::none(count)];
            Meeting { wo, relative: side_eta(eta, wo), facets }.fill(&mut lobes, [u[1], u[2]]);
            let weights = [lobes[0].weight(), lobes[1].weight()];
            let (lobe, weight, u) = choose_lobe(weights, gain, u[0])?;
            return Some(self.sample_of(wo, lobes[lobe].choose(u)?, EVENTS[lobe], weight));
        }
        let Some((h, relative)) = self.facet(wo, [u[1], u[2]]) else { return self.sample(wo, u) };
        let ways = ways(wo, h, relative);
        let (way, weight, _) = choose_lobe([ways[0].share, ways[1].share], gain, u[0])?;
        Some(self.sample_of(wo, ways[way].wi, EVENTS[way], weight))
    }

    /// Both lobes in place of a choice between them, each out of several facets where the surface has them: reflection and
    /// refraction, weighing together what [`Self::sample_of_several`] weighs; without what weighs nothing or fails.
    pub fn sample_both(&self, wo: DVec3, u: [f64; 3], count: usize) -> [Option<BoundarySample>; 2] {
        if let Boundary::Rough { eta, facets } = *self {
            let mut lobes = [FacetLobe::none(count), FacetLobe::none(count)];
            Meeting { wo, relative: side_eta(eta, wo), facets }.fill(&mut lobes, [u[1], u[2]]);
            let lobe = |i: usize| {
                let lobe = &lobes[i];
                Some(self.sample_of(wo, lobe.choose(u[0])?, EVENTS[i], lobe.weight()))
            };
            // Not `map`, which is not inlined.
            return [lobe(0), lobe(1)];
        }
        match self.facet(wo, [u[1], u[2]]) {
            None => [None, self.sample(wo, u)],
            Some((h, relative)) => {
                let ways = ways(wo, h, relative);
                let way = |i: usize| {
                    let Way { wi, share } = ways[i];
                    (share > 0.0).then(|| self.sample_of(wo, wi, EVENTS[i], share))
                };
                [way(0), way(1)]
            }
        }
    }
}

/// Light and a rough surface.
#[derive(Clone, Copy)]
struct Meeting {
    wo: DVec3,
    /// Index of the far side over that of the side of `wo`.
    relative: f64,
    facets: Microfacets,
}

impl Meeting {
    /// Where several facets reflect and refract `wo`, in both lobes. They are the points of a lattice that `u` shifts, each of them
    /// uniform, and together spread evenly, so that their mean varies less than that of independent ones.
    #[inline]
    fn fill(self, lobes: &mut [FacetLobe; 2], u: [f64; 2]) {
        let count = lobes[0].count;
        match self.facets.kind {
            MicrofacetKind::Ggx if count <= 4 => vectorized(GgxLobes::<4> { meeting: self, u, lobes }),
            MicrofacetKind::Ggx => vectorized(GgxLobes::<MOST_FACETS> { meeting: self, u, lobes }),
            MicrofacetKind::Beckmann => {
                for facet in 0..count {
                    let h = visible_facet(&self.facets, self.wo, lattice_point(u, facet, count));
                    self.send(h, |wi| self.facets.g1(wi), facet, lobes);
                }
            }
        }
        lobes.iter_mut().for_each(|lobe| lobe.sum = lobe.weights[..count].iter().sum());
    }

    /// Where a facet of normal `h` reflects and refracts light, and what each way weighs: its share of the light times `g1`, 0
    /// on the wrong side of the surface.
    #[inline(always)]
    fn send(&self, h: DVec3, g1: impl Fn(DVec3) -> f64, facet: usize, lobes: &mut [FacetLobe; 2]) {
        let [reflected, refracted] = ways(self.wo, h, self.relative);
        let [reflection, refraction] = lobes;
        let side = 1f64.copysign(self.wo.z);
        reflection.set(facet, &reflected, side, g1(reflected.wi));
        refraction.set(facet, &refracted, -side, g1(refracted.wi));
    }
}

/// The shifted point of the lattice for a facet.
#[inline(always)]
fn lattice_point(u: [f64; 2], facet: usize, count: usize) -> [f64; 2] {
    // `f64::fract` is a library call on the baseline target.
    let wrapped = |x: f64| if x < 1.0 { x } else { x - 1.0 };
    let part = 1.0 / count as f64;
    [wrapped(u[0] + facet as f64 * part), wrapped(u[1] + LATTICE[facet])]
}

/// The facets of a GGX surface side by side, in a loop without branches and of fixed length, as compilers need it for vectors:
/// one after the other, their chains of divisions and roots take more than twice as long.
struct GgxLobes<'a, const LANES: usize> {
    meeting: Meeting,
    u: [f64; 2],
    lobes: &'a mut [FacetLobe; 2],
}

impl<const LANES: usize> Vectorized for GgxLobes<'_, LANES> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let GgxLobes { meeting, u, lobes } = self;
        let Meeting { wo, facets, .. } = meeting;
        let side = 1f64.copysign(wo.z);
        let stretched = facets.stretched(DVec3::new(wo.x, wo.y, wo.z * side));
        let count = lobes[0].count;
        // Nobody asks for what lanes beyond the number of facets hold.
        for facet in 0..LANES {
            let h = facets.ggx_visible(stretched, lattice_point(u, facet, count));
            let h = DVec3::new(h.x, h.y, h.z * side);
            meeting.send(h, |wi| facets.ggx_g1(wi), facet, lobes);
        }
    }
}

/// A way that light takes at a facet.
#[derive(Clone, Copy)]
struct Way {
    wi: DVec3,
    /// Of the light.
    share: f64,
}

/// Reflection and refraction at a facet of normal `h`; of total reflection the second has no share.
#[inline(always)]
fn ways(wo: DVec3, h: DVec3, relative: f64) -> [Way; 2] {
    let cos = wo.dot(h);
    let surface = fresnel(cos, relative);
    let [reflected, refracted] = [2.0 * cos * h - wo, through(wo, h, relative, surface.cos_t)];
    [
        Way { wi: reflected, share: surface.reflectance },
        Way { wi: refracted, share: 1.0 - surface.reflectance },
    ]
}

/// The index of one of the two lobes, chosen in proportion to its weight, that of refraction times `gain`; its weight divided by
/// the probability of this choice; and a number that is uniform again. `None` where neither weighs anything.
fn choose_lobe([reflected, refracted]: [f64; 2], gain: f64, u: f64) -> Option<(usize, f64, f64)> {
    let sum = reflected + gain * refracted;
    if sum == 0.0 {
        return None;
    }
    let (reflects, u) = choose(u, reflected / sum);
    Some(if reflects { (0, sum, u) } else { (1, sum / gain, u) })
}

#[cfg(test)]
mod tests {
    use super::super::tests::{direction, rough_surfaces};
    use super::*;
    use crate::sampling::stream::{Purpose, StreamKey};

    /// Several facets, both lobes of each, and a choice that prefers refraction are what one facet gives on average: weight, and
    /// a direction weighted by it.
    #[test]
    fn several_facets_are_the_mean_of_one() {
        let smooth = [Boundary::Smooth { eta: 1.4 }, Boundary::Smooth { eta: 0.7 }, Boundary::Matched];
        let mut stream = StreamKey::named("several_facets").pass(0).stream(0, Purpose::Walk);
        for surface in rough_surfaces().chain(smooth) {
            for cos in [0.95, 0.4, 0.1, -0.1, -0.4, -0.95] {
                let wo = direction(cos, 0.21);
                // Per way of sampling and lobe: weight, weight times x, weight times z; sums and squares.
                let mut sums = [[[[0.0; 2]; 3]; 2]; 4];
                const COUNT: usize = 4000;
                for _ in 0..COUNT {
                    let u = stream.draw3();
                    let several = surface.sample_of_several(wo, stream.draw3(), 1.0, 3);
                    let [a, b] = surface.sample_both(wo, stream.draw3(), 5);
                    let leaving = surface.sample_of_several(wo, stream.draw3(), 2.5, 8);
                    let drawn =
                        [[surface.sample(wo, u), None], [several, None], [a, b], [leaving, None]];
                    for (sums, drawn) in sums.iter_mut().zip(drawn) {
                        for s in drawn.into_iter().flatten() {
                            let values = [s.weight, s.weight * s.wi.x, s.weight * s.wi.z];
                            for (sum, x) in
                                sums[usize::from(s.event == Event::Refract)].iter_mut().zip(values)
                            {
                                sum[0] += x;
                                sum[1] += x * x;
                            }
                        }
                    }
                }
                let count = COUNT as f64;
                let mean = |[sum, squares]: [f64; 2]| {
                    let mean = sum / count;
                    (mean, (squares / count - mean * mean).max(0.0) / count)
                };
                let [one, others @ ..] = sums;
                for other in others {
                    for (own, other) in one.iter().flatten().zip(other.iter().flatten()) {
                        let [(a, a2), (b, b2)] = [mean(*own), mean(*other)];
                        let error = (a2 + b2).sqrt() + 1e-12;
                        assert!((a - b).abs() < 5.5 * error, "{surface:?} {cos}: {a} {b} {error}");
                    }
                }
            }
        }
    }

    /// Whichever lobe is chosen, weight times gain is the same.
    #[test]
    fn what_is_found_does_not_depend_on_the_lobe() {
        let smooth = [Boundary::Smooth { eta: 1.4 }, Boundary::Smooth { eta: 0.7 }];
        let mut judged = 0;
        for surface in rough_surfaces().chain(smooth) {
            for (cos, v) in
                [(-0.95, [0.2, 0.7]), (-0.8, [0.6, 0.1]), (-0.72, [0.9, 0.4]), (0.5, [0.3, 0.3])]
            {
                let wo = direction(cos, 0.21);
                let inside_of_far = if cos < 0.0 { 1.0 / surface.eta() } else { surface.eta() };
                for gain in [1.0, 1.7, 0.4] {
                    let drawn = [0.0, 1.0 - 1e-12]
                        .map(|u| surface.sample_of_several(wo, [u, v[0], v[1]], gain, 3));
                    let [Some(reflected), Some(refracted)] = drawn else { continue };
                    if reflected.event == refracted.event {
                        continue;
                    }
                    judged += 1;
                    let found = refracted.weight * inside_of_far * inside_of_far * gain;
                    assert!((found / reflected.weight - 1.0).abs() < 1e-12, "{surface:?} {cos} {gain}");
                }
            }
        }
        assert!(judged > 30, "{judged}");
    }

    /// Facets of a GGX surface side by side have the bits of one facet after the other, with the vectors of this machine and
    /// with those of the least.
    #[test]
    fn side_by_side_as_one_by_one() {
        let mut stream = StreamKey::named("side_by_side_as_one_by_one").pass(0).stream(0, Purpose::Walk);
        let mut lost = 0;
        for surface in rough_surfaces() {
            let Boundary::Rough { eta, facets } = surface else { unreachable!() };
            if facets.kind != MicrofacetKind::Ggx {
                continue;
            }
            for cos in [1.0, 0.95, 0.4, 0.05, -0.05, -0.4, -0.95, -1.0] {
                let wo = direction(cos, 0.21);
                let meeting = Meeting { wo, relative: side_eta(eta, wo), facets };
                for count in [3, 5, 8] {
                    let u = stream.draw2();
                    let none = || [FacetLobe::none(count), FacetLobe::none(count)];
                    let (mut least, mut single) = (none(), none());
                    GgxLobes::<MOST_FACETS> { meeting, u, lobes: &mut least }.call();
                    let mut filled = none();
                    meeting.fill(&mut filled, u);
                    for facet in 0..count {
                        let h = visible_facet(&facets, wo, lattice_point(u, facet, count));
                        meeting.send(h, |wi| facets.g1(wi), facet, &mut single);
                    }
                    for lobes in [filled, least] {
                        for (lobe, expected) in lobes.iter().zip(&single) {
                            let bits = |lobe: &FacetLobe| {
                                let [x, y, z] = lobe.directions;
                                [lobe.weights, x, y, z]
                                    .map(|all| all.map(f64::to_bits)[..count].to_vec())
                            };
                            assert_eq!(bits(lobe), bits(expected), "{surface:?} {cos} {count}");
                            lost +=
                                lobe.weights[..count].iter().filter(|weight| **weight == 0.0).count();
                        }
                    }
                }
            }
        }
        assert!(lost > 20, "{lost} on the wrong side or without a share");
    }

    /// What the head of this file says of one facet, and that several vary less: light from inside, even over the cosine.
    #[test]
    fn a_mean_over_facets_varies_less() {
        let facets = Microfacets { kind: MicrofacetKind::Ggx, alpha: 0.2 };
        let surface = Boundary::Rough { eta: 1.4, facets };
        let mut stream =
            StreamKey::named("a_mean_over_facets_varies_less").pass(0).stream(0, Purpose::Walk);
        const COUNT: u32 = 100_000;
        let (mut failed, mut sums) = (0, [[0.0; 2]; 2]);
        for _ in 0..COUNT {
            let wo = direction(-stream.draw().sqrt(), stream.draw());
            let one = surface.sample(wo, stream.draw3());
            let several = surface.sample_of_several(wo, stream.draw3(), 1.0, 3);
            failed += u32::from(one.is_none());
            for (sums, sample) in sums.iter_mut().zip([one, several]) {
                // Without the squared index, which a crossing has.
                let scale = |s: &BoundarySample| if s.event == Event::Refract { 1.96 } else { 1.0 };
                let weight = sample.map_or(0.0, |s| s.weight / scale(&s));
                sums[0] += weight;
                sums[1] += weight * weight;
            }
        }
        let count = f64::from(COUNT);
        let [one, several] = sums.map(|[sum, squares]| squares / count - (sum / count) * (sum / count));
        let failed = f64::from(failed) / count;
        assert!((failed - 0.0475).abs() < 0.004, "{failed}");
        assert!((one - 0.054).abs() < 0.004, "{one}");
        assert!(several < 0.4 * one, "{several} {one}");
    }
}
