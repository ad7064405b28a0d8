//! Points of a plane by the radial profiles of subsurface scattering.
//!
//! Chart: x = l / (l + r) with a length l of the profile's own size, or r = r_max x in a disc; azimuth in
//! turns. dA = 2 pi r dr per turn. The far tail lies at x = 0, where numbers are dense: a profile without
//! absorption draws r = 1e7 l once in 1e7, and 1 - x would keep half of its digits.

use std::f64::consts::TAU;

use super::{Axis, Contrast, Draw, Piece, Sampler, turns};
use crate::math::exp;
use crate::sampling::radial::{Dipole, Radial};
use crate::sampling::stream::Stream;

/// Points by one profile.
pub struct RadialSampler {
    code: Radial,
    chart: Chart,
}

#[derive(Clone, Copy)]
enum Chart {
    /// The whole plane; l.
    Plane(f64),
    Disc(f64),
}

impl Chart {
    fn coordinate(self, r: f64) -> f64 {
        match self {
            Chart::Plane(l) => l / (l + r),
            Chart::Disc(r_max) => r / r_max,
        }
    }

    /// r and |dr/dx|; nothing at infinity.
    fn at(self, x: f64) -> Option<(f64, f64)> {
        match self {
            Chart::Plane(l) => (x > 0.0).then(|| (l * (1.0 - x) / x, l / (x * x))),
            Chart::Disc(r_max) => Some((r_max * x, r_max)),
        }
    }
}

impl RadialSampler {
    /// For this profile.
    pub fn new(code: Radial) -> RadialSampler {
        let chart = match code {
            Radial::Exponential { sigma } => Chart::Plane(1.0 / sigma),
            Radial::Gaussian { r_max, .. } if r_max.is_finite() => Chart::Disc(r_max),
            Radial::Gaussian { variance, .. } => Chart::Plane(variance.sqrt()),
            Radial::NormalizedDiffusion { d } => Chart::Plane(2.0 * d),
            // A strongly absorbing layer narrows the profile from z to sqrt(z / sigma_tr).
            Radial::Dipole(Dipole { sigma_tr, z_real, .. }) => {
                Chart::Plane(z_real / (1.0 + sigma_tr * z_real).sqrt())
            }
        };
        RadialSampler { code, chart }
    }

    /// A bounded function of r whose mean is known: of the radius of the exponential e^(-sigma r), 1/2; of
    /// the Gaussian e^(-r^2/2v), 1/2 over the plane; of normalized diffusion e^(-r/d), with a quarter
    /// Exp(d) and three quarters Exp(3d): 1/4 * 1/2 + 3/4 * 1/4 = 5/16.
    fn decay(&self) -> (Option<f64>, Box<dyn Fn(f64) -> f64 + Send + Sync>) {
        match self.code {
            Radial::Exponential { sigma } => (Some(0.5), Box::new(move |r| exp(-sigma * r))),
            Radial::Gaussian { variance, r_max } => {
                let known = r_max.is_infinite().then_some(0.5);
                (known, Box::new(move |r| exp(-r * r / (2.0 * variance))))
            }
            Radial::NormalizedDiffusion { d } => (Some(5.0 / 16.0), Box::new(move |r| exp(-r / d))),
            Radial::Dipole(Dipole { z_real, .. }) => (None, Box::new(move |r| z_real / (r + z_real))),
        }
    }

    fn per_chart(&self, r: f64, dr: f64) -> f64 {
        self.code.pdf_area(r) * TAU * r * dr
    }
}

impl Sampler for RadialSampler {
    fn draw(&self, stream: &mut Stream) -> Draw {
        let [x, y] = self.code.sample(stream.draw2());
        let r = (x * x + y * y).sqrt();
        let at = [self.chart.coordinate(r), turns(x, y)];
        let density = self.chart.at(at[0]).map_or(0.0, |(_, dr)| self.per_chart(r, dr));
        Draw::Point { piece: 0, at, density }
    }

    fn pieces(&self) -> Vec<Piece> {
        vec![Piece::plane("points", [Axis::over(0.0, 1.0), Axis::turns()])]
    }

    fn density(&self, _piece: usize, [x, _]: [f64; 2]) -> f64 {
        self.chart.at(x).map_or(0.0, |(r, dr)| self.per_chart(r, dr))
    }

    fn contrasts(&self) -> Vec<Contrast> {
        let (expected, decay) = self.decay();
        let chart = self.chart;
        let mean = move |[x, _]: [f64; 2]| chart.at(x).map_or(0.0, |(r, _)| decay(r));
        vec![Contrast::of("mean decay", expected, mean), Contrast::azimuth()]
    }
}
