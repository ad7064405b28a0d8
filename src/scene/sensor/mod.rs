//! Sensors define what a pass measures, as rays with weights. A pass traces every ray of the sensor once;
//! ray i belongs to one slot (a pixel, or a bin of a flux), and slots are summed into regions.
//!
//! Each kind of sensor has one file and implements `SensorMethods`; `Sensor` forwards every call to its kind.

mod accepting;
mod body_flux;
mod face_flux;
mod orthographic;
mod path_length;
mod perspective;
mod probe;
mod rings;
mod screen;
mod vertex;

pub use accepting::Accepting;
pub use body_flux::BodyFlux;
pub use face_flux::{FaceFlux, FluxFace};
pub use orthographic::Orthographic;
pub use path_length::{Ball, PathLength, PathMeasure};
pub use perspective::Perspective;
pub use probe::Probe;
pub use rings::Rings;
pub use screen::{PixelRectangle, Screen};
pub use vertex::Vertex;

use crate::geometry::{Ray, Side};
use crate::math::DVec3;

/// Sensor of a scene: what is measured.
#[derive(Clone, Debug)]
pub enum Sensor {
    /// Parallel rays through the pixels of a screen.
    Orthographic(Orthographic),
    /// Rays through the pixels of a screen from a cap of directions about the view.
    Accepting(Accepting),
    /// Rays from a point through the pixels of a screen.
    Perspective(Perspective),
    /// Radiance along one ray.
    Probe(Probe),
    /// Radiance that arrives at a medium vertex.
    Vertex(Vertex),
    /// Radiant exitance of a half-space's or slab's faces by the cosine of the exit direction.
    FaceFlux(FaceFlux),
    /// Radiant exitance of the top face of a half-space or slab by how far from the exit its light came
    /// in.
    Rings(Rings),
    /// Flux of a finite body by the cosine between exit direction and axis.
    BodyFlux(BodyFlux),
    /// Path length in a finite body, and what falls onto its surface.
    PathLength(PathLength),
}

/// What a sensor asks of an estimator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SensorClass {
    /// Rays that start outside the body.
    Outside,
    /// The same, and the point at which light entered.
    Entries,
    /// Rays that start outside the body, and what their paths have done inside ([`PathMeasure`]).
    Lengths,
    /// Rays that start inside the body.
    Inside,
}

/// Calls a method of [`SensorMethods`] on whichever kind a sensor is.
macro_rules! call {
    ($sensor:ident.$method:ident($($argument:expr),*)) => {
        match $sensor {
            Sensor::Orthographic(kind) => kind.$method($($argument),*),
            Sensor::Accepting(kind) => kind.$method($($argument),*),
            Sensor::Perspective(kind) => kind.$method($($argument),*),
            Sensor::Probe(kind) => kind.$method($($argument),*),
            Sensor::Vertex(kind) => kind.$method($($argument),*),
            Sensor::FaceFlux(kind) => kind.$method($($argument),*),
            Sensor::Rings(kind) => kind.$method($($argument),*),
            Sensor::BodyFlux(kind) => kind.$method($($argument),*),
            Sensor::PathLength(kind) => kind.$method($($argument),*),
        }
    };
}

/// What sensors say whose slots are the pixels of their screen.
macro_rules! by_its_screen {
    () => {
        fn pixels(&self) -> Option<(usize, usize)> {
            Some(self.screen.size())
        }

        fn rays_per_pass(&self) -> usize {
            self.screen.count()
        }

        fn regions(&self) -> Vec<SensorRegion> {
            self.screen.regions()
        }

        #[inline]
        fn regions_of(&self, slot: usize) -> RegionShares {
            self.screen.regions_of(slot)
        }
    };
}
use by_its_screen;

/// What a kind of sensor says of itself; the methods of [`Sensor`] tell what each means.
trait SensorMethods {
    fn rays_per_pass(&self) -> usize;

    fn ray(&self, index: usize, u: [f64; 4]) -> SensorRay;

    fn regions(&self) -> Vec<SensorRegion>;

    #[inline]
    fn regions_of(&self, _slot: usize) -> RegionShares {
        RegionShares::one(0, 1.0)
    }

    fn pixels(&self) -> Option<(usize, usize)> {
        None
    }

    fn position(&self) -> Option<(DVec3, Side)> {
        None
    }

    fn class(&self) -> SensorClass {
        SensorClass::Outside
    }

    fn slot_of(&self, slot: usize, _entry: DVec3) -> usize {
        slot
    }

    fn receives(&self, _is_finite: bool) -> bool {
        false
    }

    fn receive(&self, _out: &Ray) -> Option<(usize, f64)> {
        None
    }

    fn measure(&self) -> PathMeasure {
        PathMeasure::default()
    }
}

impl Sensor {
    /// Pixels per row and rows, for images.
    pub fn pixels(&self) -> Option<(usize, usize)> {
        call!(self.pixels())
    }

    /// Where all of its rays start, if at one point, and the side of the boundary on which that has to
    /// be.
    pub fn position(&self) -> Option<(DVec3, Side)> {
        call!(self.position())
    }

    /// What it asks of an estimator.
    pub fn class(&self) -> SensorClass {
        call!(self.class())
    }

    /// Number of rays of a pass.
    pub fn rays_per_pass(&self) -> usize {
        call!(self.rays_per_pass())
    }

    /// Ray `index` of a pass for uniform numbers `u`.
    #[inline]
    pub fn ray(&self, index: usize, u: [f64; 4]) -> SensorRay {
        call!(self.ray(index, u))
    }

    /// Where light counts that a ray of slot `slot` finds, having come in at the point `entry` of the
    /// body: rings look at that point, all others have decided by the ray.
    #[inline]
    pub fn slot_of(&self, slot: usize, entry: DVec3) -> usize {
        call!(self.slot_of(slot, entry))
    }

    /// What light that leaves the body for good along `out` scores: its slot, and the factor from the
    /// power that it carries to the slot's unit. The adjoint of [`Self::ray`]: what the rays of a slot
    /// find as radiance, all light that leaves finds as power.
    ///
    /// Power that leaves is int int L cos dA dw over the lines of the slot, whatever the surface that
    /// they are counted on (radiance is constant along a line). A slot of one line or one direction has
    /// no power: a probe, a perspective or an orthographic sensor receives nothing (see
    /// [`Self::receives`]).
    #[inline]
    pub fn receive(&self, out: &Ray) -> Option<(usize, f64)> {
        call!(self.receive(out))
    }

    /// Whether light that leaves a body can reach it, one of finite size or a half-space or slab: false
    /// where a slot is a single direction or all of its lines pass through one point.
    pub fn receives(&self, is_finite: bool) -> bool {
        call!(self.receives(is_finite))
    }

    /// What a new path keeps of itself; nothing except for a sensor of [`SensorClass::Lengths`].
    pub fn measure(&self) -> PathMeasure {
        call!(self.measure())
    }

    /// The regions, those that are split by class first.
    pub fn regions(&self) -> Vec<SensorRegion> {
        call!(self.regions())
    }

    /// The regions that a slot counts in: an image's mean and the slot's tile, all light that leaves and
    /// the slot's ring.
    #[inline]
    pub fn regions_of(&self, slot: usize) -> RegionShares {
        call!(self.regions_of(slot))
    }
}

/// A ray of the sensor with its weight and slot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorRay {
    /// The ray, against the flow of light.
    pub ray: Ray,
    /// Factor from radiance to the slot's unit, the mean over the slot's rays included.
    pub weight: f64,
    /// Index of the pixel or bin.
    pub slot: usize,
}

/// A sum of slots that tables speak of.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SensorRegion {
    /// Name of the region in observables.
    pub name: String,
    /// Whether transport classes and lights are distinguished.
    pub split: bool,
    /// The pixels of an image's tile; none for any other region.
    pub tile: Option<PixelRectangle>,
}

impl SensorRegion {
    /// A region that is split by class and light.
    fn split(name: impl Into<String>) -> SensorRegion {
        SensorRegion { name: name.into(), split: true, tile: None }
    }
}

/// The one or two regions that a slot counts in, each with the factor from the slot's score to its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RegionShares {
    first: (usize, f64),
    second: Option<(usize, f64)>,
}

impl RegionShares {
    #[inline]
    fn one(region: usize, factor: f64) -> RegionShares {
        RegionShares { first: (region, factor), second: None }
    }

    #[inline]
    fn and(self, region: usize, factor: f64) -> RegionShares {
        RegionShares { second: Some((region, factor)), ..self }
    }
}

impl IntoIterator for RegionShares {
    type Item = (usize, f64);
    type IntoIter = std::iter::Chain<std::iter::Once<Self::Item>, std::option::IntoIter<Self::Item>>;

    #[inline]
    fn into_iter(self) -> Self::IntoIter {
        std::iter::once(self.first).chain(self.second)
    }
}

/// The bin of equal width that a cosine, `above` the least, falls into. Rounded vectors may exceed 1 by
/// a last digit.
#[inline]
fn bin(above: f64, width: f64, bins: usize) -> usize {
    ((above / width) as usize).min(bins - 1)
}

#[cfg(test)]
mod tests;
