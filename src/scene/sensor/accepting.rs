//! A screen whose pixels accept light from a cap of directions.

use std::f64::consts::PI;

use super::{RegionShares, Screen, SensorMethods, SensorRay, SensorRegion, by_its_screen};
use crate::geometry::{BoundingSphere, Ray};
use crate::math::{DVec3, Frame};
use crate::sampling::warp::square_to_cosine_hemisphere;

/// Mean radiance over a pixel's square and a cap of directions about the view, each direction weighted
/// by its cosine to the view, as flux through the square is.
#[derive(Clone, Copy, Debug)]
pub struct Accepting {
    screen: Screen,
    /// Middle of the plane on which the image is sharp, mm.
    center: DVec3,
    /// Frame about the viewing direction.
    frame: Frame,
    /// Squared sine of the cap's half angle.
    sin2: f64,
    /// Sphere around the body: rays start before it.
    pub(super) bounds: BoundingSphere,
}

impl Accepting {
    /// `height` is 1 - cos of the cap's half angle, solid angle over 2 pi, in (0, 1). The screen, in mm
    /// about `center`, stays where it is, even inside the body: it is the plane on which the image is
    /// sharp.
    pub fn new(screen: Screen, center: DVec3, height: f64, bounds: BoundingSphere) -> Accepting {
        let sin2 = height * (2.0 - height);
        Accepting { screen, center, frame: Frame::about(screen.view), sin2, bounds }
    }

    /// The pixel whose square the line of `out` crosses, if the cap holds its reversed direction.
    #[inline]
    fn pixel(&self, out: &Ray) -> Option<usize> {
        let Screen { width, height, right, down, view, .. } = self.screen;
        let cos = -out.dir.dot(view);
        let across = out.dir + cos * view;
        if cos <= 0.0 || across.length_squared() >= self.sin2 {
            return None;
        }
        let from_middle = out.at((out.origin - self.center).dot(view) / cos) - self.center;
        let column = from_middle.dot(right) / right.length_squared() + 0.5 * width as f64;
        let row = from_middle.dot(down) / down.length_squared() + 0.5 * height as f64;
        let inside = column >= 0.0 && column < width as f64 && row >= 0.0 && row < height as f64;
        inside.then(|| row as usize * width + column as usize)
    }

    /// Area of a pixel times the cap's solid angle weighted by cosine, pi sin^2; mm^2 sr.
    fn extent(&self) -> f64 {
        self.screen.right.length() * self.screen.down.length() * PI * self.sin2
    }
}

impl SensorMethods for Accepting {
    by_its_screen!();

    /// A point uniform in the pixel, a direction with density proportional to its cosine in the cap. The
    /// ray starts two radii before the body's middle: outside the body and before all of it, wherever
    /// the screen is.
    #[inline]
    fn ray(&self, index: usize, u: [f64; 4]) -> SensorRay {
        let point = self.center + self.screen.offset(index, u);
        // The cosine hemisphere's u0 is sin^2.
        let dir = self.frame.to_world(square_to_cosine_hemisphere([u[2] * self.sin2, u[3]]));
        let along = (self.bounds.center - point).dot(dir) - 2.0 * self.bounds.radius;
        SensorRay { ray: Ray { origin: point + along * dir, dir }, weight: 1.0, slot: index }
    }

    fn receives(&self, is_finite: bool) -> bool {
        is_finite
    }

    /// The lines of a pixel cross its square of area A within the cap, so that their power is int_A dA
    /// int_cap L cos dw; a pixel's value is the mean of L in that very measure, whose whole is A int_cap
    /// cos dw = A pi sin^2.
    #[inline]
    fn receive(&self, out: &Ray) -> Option<(usize, f64)> {
        self.pixel(out).map(|pixel| (pixel, 1.0 / self.extent()))
    }
}
