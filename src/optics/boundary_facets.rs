//! Directions by several facets.
//!
//! One facet of a rough surface, drawn from the visible normals, gives a direction whose weight is G1, or none where the
//! direction is on the wrong side: from inside a body of index 1.4 and GGX roughness 0.2 that is 5 % of the light, and the
//! variance of a weight is 0.054 (directions by cosine). The mean weight of a few facets, with a direction chosen in proportion to
//! theirs (resampled importance sampling, Talbot et al. 2005), has the same expectation.

use super::{Boundary, BoundarySample, Event, split};
use crate::math::{DVec3, GOLDEN};
use crate::optics::fresnel::fresnel;
use crate::sampling::discrete::{choose, choose_share};

/// Facets out of which one is chosen.
const FACETS: usize = 3;

/// Where facets send light, of one lobe.
#[derive(Clone, Copy)]
struct FacetLobe {
    weights: [f64; FACETS],
    directions: [DVec3; FACETS],
}

impl FacetLobe {
    const NONE: FacetLobe = FacetLobe { weights: [0.0; FACETS], directions: [DVec3::Z; FACETS] };

    /// Mean over the facets.
    fn weight(&self) -> f64 {
        self.weights.iter().sum::<f64>() / FACETS as f64
    }

    /// One direction, in proportion to its weight; `None` where none weighs anything.
    fn choose(&self, u: f64) -> Option<DVec3> {
        let sum: f64 = self.weights.iter().sum();
        if sum == 0.0 {
            return None;
        }
        let (index, _) = choose_share(self.weights.iter().map(|weight| weight / sum), u)?;
        Some(self.directions[index])
    }
}

impl Boundary {
    /// [`Boundary::sample`] out of several facets, which a rough surface has, and both lobes of each: one direction in
    /// proportion to its weight, with the mean weight of a facet. Its density is that of [`Self::sample`]: weights of the
    /// balance heuristic may use it, since they need but sum to 1.
    pub fn sample_of_several(&self, wo: DVec3, u: [f64; 3]) -> Option<BoundarySample> {
        if self.is_delta() {
            return self.sample(wo, u);
        }
        let [reflections, refractions] = self.lobes(wo, [u[1], u[2]]);
        let [reflected, refracted] = [&reflections, &refractions].map(FacetLobe::weight);
        let sum = reflected + refracted;
        if sum == 0.0 {
            return None;
        }
        let (reflects, u) = choose(u[0], reflected / sum);
        let (lobe, event) =
            if reflects { (reflections, Event::Reflect) } else { (refractions, Event::Refract) };
        Some(self.sample_of(wo, lobe.choose(u)?, event, sum))
    }

    /// Both lobes in place of a choice between them, each out of several facets where the surface has them: reflection and
    /// refraction, weighing together what [`Self::sample_of_several`] weighs; without what weighs nothing or fails.
    pub fn sample_both(&self, wo: DVec3, u: [f64; 3]) -> [Option<BoundarySample>; 2] {
        if !self.is_delta() {
            let [reflections, refractions] = self.lobes(wo, [u[1], u[2]]);
            return [(reflections, Event::Reflect), (refractions, Event::Refract)].map(
                |(lobe, event)| {
                    let wi = lobe.choose(u[0])?;
                    Some(self.sample_of(wo, wi, event, lobe.weight()))
                },
            );
        }
        match self.facet(wo, [u[1], u[2]]) {
            None => [None, self.sample(wo, u)],
            Some((h, relative)) => choices(wo, h, relative).map(|(probability, choice)| {
                let (wi, event) = (probability > 0.0).then(|| split(wo, h, relative, choice))?;
                Some(self.sample_of(wo, wi, event, probability))
            }),
        }
    }

    /// Where several facets reflect and refract `wo`. They are the points of a lattice that `u` shifts, each of them
    /// uniform, and together spread evenly, so that their mean varies less than that of independent ones.
    fn lobes(&self, wo: DVec3, u: [f64; 2]) -> [FacetLobe; 2] {
        let mut lobes = [FacetLobe::NONE; 2];
        for facet in 0..FACETS {
            let i = facet as f64;
            let shifted = [(u[0] + i / FACETS as f64).fract(), (u[1] + i * GOLDEN).fract()];
            let Some((h, relative)) = self.facet(wo, shifted) else { continue };
            for (lobe, (probability, choice)) in lobes.iter_mut().zip(choices(wo, h, relative)) {
                if probability > 0.0 {
                    let (wi, event) = split(wo, h, relative, choice);
                    lobe.directions[facet] = wi;
                    lobe.weights[facet] = probability * self.shadowing(wo, wi, event).unwrap_or(0.0);
                }
            }
        }
        lobes
    }
}

/// Probabilities of reflection and of refraction, each with the number at which `split` takes it, where there is any.
fn choices(wo: DVec3, h: DVec3, relative: f64) -> [(f64, f64); 2] {
    let reflectance = fresnel(wo.dot(h), relative).reflectance;
    [(reflectance, 0.0), (1.0 - reflectance, 1.0)]
}

#[cfg(test)]
mod tests {
    use super::super::Density;
    use super::super::tests::{direction, rough_surfaces};
    use super::*;
    use crate::optics::microfacet::{MicrofacetKind, Microfacets};
    use crate::sampling::stream::{Purpose, StreamKey};

    /// Several facets, and both lobes of each, are what one facet gives on average: weight, and a direction weighted by it;
    /// with densities that are those of the directions.
    #[test]
    fn several_facets_are_the_mean_of_one() {
        let smooth = [Boundary::Smooth { eta: 1.4 }, Boundary::Smooth { eta: 0.7 }, Boundary::Matched];
        let mut stream = StreamKey::named("several_facets").pass(0).stream(0, Purpose::Walk);
        for surface in rough_surfaces().chain(smooth) {
            for cos in [0.95, 0.4, 0.1, -0.1, -0.4, -0.95] {
                let wo = direction(cos, 0.21);
                // Per way of sampling and lobe: weight, weight times x, weight times z; sums and squares.
                let mut sums = [[[[0.0; 2]; 3]; 2]; 3];
                const COUNT: usize = 4000;
                for _ in 0..COUNT {
                    let u = stream.draw3();
                    let several = surface.sample_of_several(wo, stream.draw3());
                    let [a, b] = surface.sample_both(wo, stream.draw3());
                    let drawn = [[surface.sample(wo, u), None], [several, None], [a, b]];
                    for (sums, drawn) in sums.iter_mut().zip(drawn) {
                        for s in drawn.into_iter().flatten() {
                            let own = match surface {
                                Boundary::Rough { .. } => Density::Finite(surface.eval(wo, s.wi).1),
                                _ => Density::Delta,
                            };
                            assert_eq!(s.density, own);
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
            let several = surface.sample_of_several(wo, stream.draw3());
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
