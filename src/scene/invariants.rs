//! Values that hold for every body, medium and phase function.
//!
//! A body without losses is lit by a sky of radiance L: the medium absorbs nothing, and the boundary reflects
//! what it does not transmit. Radiance over squared index is then L everywhere and in all directions, which
//! satisfies the radiative transfer equation and the conditions at the boundary. (Directions of total internal
//! reflection receive light by scattering only: without scattering, a smooth boundary keeps them dark.) The
//! fluence inside is 4 pi eta^2 L, so the light in the body travels
//!   4 pi eta^2 L V
//! per time in the volume V (power times length; a part of the body has the part's volume). The power
//! that falls onto the surface of area S from outside is pi L S. Their ratio is the mean path length in
//! the body of light that falls onto its surface,
//!   mean length = 4 eta^2 V / S,
//! where light that is reflected at once counts with length 0, and light that leaves a body that is not
//! convex and meets it again counts as falling onto it again. Blanco & Fournier, "An invariance property of
//! diffusive random walks", Europhys. Lett. 61 (2003), for eta = 1; Martelli et al., Sci. Rep. 11, 19486
//! (2021) and Sassaroli et al., J. Biomed. Opt. 27(8), 083018 (2022) with the index.

use super::{Emission, Scene, Sensor};

impl Scene {
    /// Means of the sensor's `path_length` and `incident`, in this order, in a sky of equal radiance
    /// without losses, which the caller has made sure of; none where the sensor has no such observables.
    pub fn lossless_means(&self, band: usize) -> Option<[f64; 2]> {
        let Sensor::PathLength(sensor) = &self.sensor else { return None };
        let volume = sensor.ball.map_or(self.shape.volume(), |ball| Some(ball.volume()))?;
        let eta = self.boundary[band].eta();
        let radiance = |emission: &Emission| match emission {
            Emission::Cap { radiance, .. } => radiance[band],
            Emission::Directional { .. } | Emission::Map(_) => 0.0,
        };
        let sky: f64 = self.lights.iter().map(|light| radiance(&light.emission)).sum();
        Some([4.0 * eta * eta * volume / sensor.area * sky, sky])
    }
}
