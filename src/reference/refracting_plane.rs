//! Light that the plane z = 0 refracts into the body below: one ray per point, in closed form.
//!
//! Parallel light from the direction w_L (unit, z = cl > 0) travels inside along -w with w = (w_L + (eta
//! ct - cl) z) / eta, eta ct = sqrt(eta^2 - 1 + cl^2). An irradiance E across the light becomes T E cl /
//! ct across the refracted beam: the flux through a unit of the plane, T E cl, crosses ct of it.
//!
//! The light of a camera ray that enters with the cosine mu to the depth axis and is scattered once:
//!   L = int_0^l sigma_s e^(-sigma t) p T E (cl / ct) e^(-sigma mu t / ct) dt
//!     = sigma_s p T E (cl / ct) (1 - e^(-k l)) / k,   k = sigma (1 + mu / ct).

use crate::math::{DVec3, exp_m1};
use crate::optics::fresnel::fresnel;

/// Parallel light behind a plane.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlaneBeam {
    /// Unit direction inside, from a point towards the light's entry.
    pub toward: DVec3,
    /// Cosine to the normal outside.
    pub cos_outside: f64,
    /// Fresnel transmittance T.
    pub transmittance: f64,
}

impl PlaneBeam {
    /// From the unit direction towards the light; `None` from below, and under total reflection.
    pub(crate) fn new(toward: DVec3, eta: f64) -> Option<PlaneBeam> {
        let surface = fresnel(toward.z, eta);
        let inside = DVec3::new(toward.x / eta, toward.y / eta, surface.cos_t);
        let transmittance = 1.0 - surface.reflectance;
        (surface.cos_t > 0.0).then_some(PlaneBeam {
            toward: inside,
            cos_outside: toward.z,
            transmittance,
        })
    }

    /// Irradiance across the beam, without T and absorption, over that outside.
    pub(crate) fn magnification(&self) -> f64 {
        self.cos_outside / self.toward.z
    }

    /// Where the light of a point below the plane comes in, and how far that is, mm.
    pub(crate) fn entry(&self, point: DVec3) -> (DVec3, f64) {
        let distance = -point.z / self.toward.z;
        (point + self.toward * distance, distance)
    }

    /// Radiance that a camera ray gathers by one scattering event, W/(mm^2 sr), of light of irradiance
    /// 1: the ray enters at the plane along `dir` and ends after `length` mm (infinite in a half-space).
    /// `phase` is per solid angle, `sigma_s` and `sigma_t` are in 1/mm.
    pub(crate) fn single_scattering(
        &self,
        dir: DVec3,
        length: f64,
        phase: f64,
        [sigma_s, sigma_t]: [f64; 2],
    ) -> f64 {
        let k = sigma_t * (1.0 - dir.z / self.toward.z);
        let reach = if length == f64::INFINITY { 1.0 / k } else { -exp_m1(-k * length) / k };
        sigma_s * phase * self.transmittance * self.magnification() * reach
    }
}

/// Light of a point source at height `h` over the plane at depth `z` and horizontal distance `r`, mm.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PointBeam {
    /// Sine of the angle to the normal, outside.
    pub sin_outside: f64,
    /// D: the irradiance across the beam is I T eta^2 / D for intensity I, mm^2.
    pub spread: f64,
}

impl PointBeam {
    /// By bisection of h tan a + z tan b = r, sin a = eta sin b, which grows with the angle.
    ///
    /// D is that of Walter et al. 2009, "Single scattering in refractive media with triangle mesh
    /// boundaries", for a plane: (d + eta d_L) (d cl / ct + eta d_L ct / cl), d and d_L being the
    /// lengths inside and outside.
    pub(crate) fn new(h: f64, z: f64, r: f64, eta: f64) -> PointBeam {
        let cosines = |sin: f64| [(1.0 - sin * sin).sqrt(), (1.0 - sin * sin / (eta * eta)).sqrt()];
        let reach = |sin: f64| {
            let [outside, inside] = cosines(sin);
            h * sin / outside + z * sin / (eta * inside)
        };
        let (mut low, mut high) = (0.0, 1.0f64.min(eta));
        for _ in 0..200 {
            let middle = 0.5 * (low + high);
            if reach(middle) < r { low = middle } else { high = middle }
        }
        let sin_outside = 0.5 * (low + high);
        let [cl, ct] = cosines(sin_outside);
        let (d, d_l) = (z / ct, h / cl);
        PointBeam { sin_outside, spread: (d + eta * d_l) * (d * cl / ct + eta * d_l * ct / cl) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{asin, cos, exp, integrate, sin, tan};

    const ETA: f64 = 1.5;

    fn tilted(angle: f64) -> DVec3 {
        DVec3::new(0.6 * sin(angle), -0.8 * sin(angle), cos(angle))
    }

    /// Snell's law, and flux: what enters a unit of the plane crosses the beam.
    #[test]
    fn beams_keep_flux() {
        for angle in [0.0, 0.4, 1.0, 1.5] {
            for eta in [1.0, 1.3, 2.4, 0.9] {
                let Some(beam) = PlaneBeam::new(tilted(angle), eta) else {
                    assert!(eta < 1.0 && sin(angle) > eta);
                    continue;
                };
                let inside =
                    asin((beam.toward.x * beam.toward.x + beam.toward.y * beam.toward.y).sqrt());
                assert!((eta * sin(inside) - sin(angle)).abs() < 1e-15);
                assert!((beam.toward.length() - 1.0).abs() < 1e-15);
                let flux = beam.magnification() * beam.toward.z;
                assert!((flux - cos(angle)).abs() < 1e-15);
                let point = DVec3::new(0.3, -0.2, -0.7);
                let (entry, distance) = beam.entry(point);
                // One rounding of each product, at the size of the distance.
                let rounding = 1e-15 * (1.0 + distance);
                assert!(entry.z.abs() < rounding && (entry.distance(point) - distance).abs() < rounding);
            }
        }
        assert!(PlaneBeam::new(tilted(2.0), ETA).is_none());
    }

    /// Single scattering against quadrature along the camera ray, for a slab and for a half-space.
    #[test]
    fn single_scattering_is_its_integral() {
        let beam = PlaneBeam::new(tilted(0.7), ETA).expect("from above");
        let dir = DVec3::new(0.48, 0.0, -(1.0f64 - 0.48 * 0.48).sqrt());
        let (phase, sigma) = (0.3, [1.7, 2.0]);
        let light = |t: f64| {
            let (_, distance) = beam.entry(dir * t);
            let beam_part = beam.transmittance * beam.magnification() * exp(-sigma[1] * distance);
            sigma[0] * exp(-sigma[1] * t) * phase * beam_part
        };
        for (length, end) in [(0.4, 0.4), (f64::INFINITY, 30.0)] {
            let expected = integrate(light, 0.0, end, 1e-14);
            let got = beam.single_scattering(dir, length, phase, sigma);
            assert!((got - expected.value).abs() < 1e-12, "{got} {expected:?}");
        }
    }

    /// D is the area across the beam over the solid angle at the source, times eta^2: a ring of rays,
    /// dA / dw = r cos_b dr / (sin_a da), the derivative by differences.
    #[test]
    fn a_point_source_spreads_as_a_ring_of_rays() {
        let (h, z) = (1.3, 0.8);
        let inside = |a: f64| asin(sin(a) / ETA);
        let reach = |a: f64| h * tan(a) + z * tan(inside(a));
        for a in [0.1, 0.5, 1.0, 1.3] {
            let beam = PointBeam::new(h, z, reach(a), ETA);
            assert!((beam.sin_outside - sin(a)).abs() < 1e-14);
            let step = 1e-4;
            let slope = |e: f64| (reach(a + e) - reach(a - e)) / (2.0 * e);
            let slope = (4.0 * slope(0.5 * step) - slope(step)) / 3.0;
            let area = reach(a) * cos(inside(a)) * slope / sin(a);
            assert!((beam.spread / (ETA * ETA * area) - 1.0).abs() < 1e-9, "{a}: {beam:?} {area}");
        }
        // Far away the source is parallel light: eta^2 / D is cl / (ct d_L^2).
        let far = PointBeam::new(1e9, 0.5, 1e9, ETA);
        let parallel = PlaneBeam::new(tilted(asin(far.sin_outside)), ETA).expect("from above");
        let d_l2 = 2e18;
        assert!((ETA * ETA * d_l2 / far.spread / parallel.magnification() - 1.0).abs() < 1e-8);
    }
}
