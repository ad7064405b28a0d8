//! The scenes that an estimator serves: by sensor, boundary, body and medium.

use crate::error::{Error, Result};
use crate::optics::boundary::Boundary;
use crate::scene::sensor::SensorClass;
use crate::scene::{Scene, Sensor};

/// The scenes that an estimator serves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Serves {
    /// Sensors that the estimator serves.
    pub sensors: Sensors,
    /// Boundaries that the estimator serves.
    pub boundaries: &'static [BoundaryKind],
    /// Extents of bodies that the estimator serves.
    pub bodies: Bodies,
    /// Whether it scores emission of the medium; if not, media that emit are refused.
    pub emission: bool,
}

/// Sensors, by what an estimator must be able to do for them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sensors {
    /// All sensors.
    All,
    /// Sensors whose rays start outside the body, those of path lengths included.
    Walks,
    /// Sensors whose rays start outside the body and that do not depend on what paths do inside.
    Outside,
    /// Sensors whose rays start outside the body and that do not depend on where light entered.
    WithoutEntries,
    /// A medium vertex.
    Vertex,
    /// Sensors that light leaving the body can hit.
    Receiving,
}

/// Kinds of boundaries, as scenes distinguish them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BoundaryKind {
    /// The same index inside and outside.
    Matched,
    /// A smooth dielectric.
    Smooth,
    /// A rough dielectric.
    Rough,
}

/// Which bodies are served, by extent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bodies {
    /// Bounded and unbounded bodies.
    All,
    /// Bodies that a sphere bounds: neither half-spaces nor slabs.
    Finite,
}

impl Serves {
    /// Every scene whose medium does not emit: an estimator must state that it scores emission.
    pub const ALL: Serves = Serves {
        sensors: Sensors::All,
        boundaries: &[BoundaryKind::Matched, BoundaryKind::Smooth, BoundaryKind::Rough],
        bodies: Bodies::All,
        emission: false,
    };

    /// Scenes whose sensor looks at the body from outside, path lengths included.
    pub const WALKS: Serves = Serves { sensors: Sensors::Walks, ..Serves::ALL };

    /// Scenes whose sensor looks at the body from outside.
    pub const FROM_OUTSIDE: Serves = Serves { sensors: Sensors::Outside, ..Serves::ALL };

    /// Scenes whose sensor looks from outside and does not depend on where light entered.
    pub const WITHOUT_ENTRIES: Serves = Serves { sensors: Sensors::WithoutEntries, ..Serves::ALL };

    /// Scenes whose sensor looks from outside at a body without a rough boundary, which the BSSRDFs here
    /// need.
    pub const BSSRDF: Serves =
        Serves { boundaries: &[BoundaryKind::Matched, BoundaryKind::Smooth], ..Serves::FROM_OUTSIDE };

    /// Refuses a scene that `name` does not serve.
    pub(super) fn check(&self, name: &str, scene: &Scene) -> Result<()> {
        if !self.sensors.contain(&scene.sensor) {
            return Err(self.sensors.refuse(name, &scene.sensor));
        }
        let is_served = |boundary: &BoundaryKind| self.boundaries.contains(boundary);
        if let Some(boundary) = scene.boundary.iter().map(BoundaryKind::of).find(|b| !is_served(b)) {
            let served: Vec<&str> = self.boundaries.iter().map(|b| b.name()).collect();
            return Err(Error::input_help(
                format!(
                    "{name} needs a {} boundary, this one is {}",
                    served.join(" or "),
                    boundary.name()
                ),
                format!("use `object.boundary.{}`", served.join("` or `object.boundary.")),
            ));
        }
        if self.bodies == Bodies::Finite && scene.shape.bounds().is_none() {
            return Err(Error::input_help(
                format!("{name} needs a finite body, which a half-space or slab is not"),
                "use a finite body, or an estimator for all bodies (`scatterproof list estimators`)",
            ));
        }
        if !self.emission && scene.emits() {
            return Err(Error::input_help(
                format!("{name} does not count light that the medium emits"),
                "use path, snee, bidirectional, light_trace or point_cloud, or leave out \
                 `object.medium.emission_per_mm`",
            ));
        }
        Ok(())
    }
}

impl Sensors {
    fn contain(self, sensor: &Sensor) -> bool {
        match self {
            Sensors::All => true,
            Sensors::Walks => sensor.class() != SensorClass::Inside,
            Sensors::Outside => matches!(sensor.class(), SensorClass::Outside | SensorClass::Entries),
            Sensors::WithoutEntries => sensor.class() == SensorClass::Outside,
            Sensors::Vertex => sensor.class() == SensorClass::Inside,
            Sensors::Receiving => sensor.receives(true) || sensor.receives(false),
        }
    }

    fn refuse(self, name: &str, sensor: &Sensor) -> Error {
        match (self, sensor.class()) {
            (Sensors::Walks | Sensors::Outside | Sensors::WithoutEntries, SensorClass::Inside) => {
                Error::input_help(
                    format!("{name} starts its paths outside the body, the sensor `vertex` is inside"),
                    "use two_bounce, or another sensor",
                )
            }
            (Sensors::WithoutEntries, SensorClass::Entries) => Error::input_help(
                format!("{name} does not keep where light came in, by which the sensor `rings` counts"),
                "use light_trace, path, bssrdf_probe or bssrdf_rays, or the sensor `flux`",
            ),
            (Sensors::Outside | Sensors::WithoutEntries, SensorClass::Lengths) => Error::input_help(
                format!(
                    "{name} does not keep how far its light went inside, as the sensor `path_length` asks"
                ),
                "use path or light_trace, or the sensor `flux`",
            ),
            (Sensors::Receiving, _) => Error::input_help(
                format!("{name} cannot serve this sensor: no photon hits a single ray or direction"),
                format!("it serves {}", self.names()),
            ),
            _ => Error::input_help(
                format!("{name} cannot serve this sensor"),
                format!("it serves {}", self.names()),
            ),
        }
    }

    fn names(self) -> &'static str {
        match self {
            Sensors::All => "every sensor",
            Sensors::Walks => "every sensor except `vertex`",
            Sensors::Outside => "every sensor except `vertex` and `path_length`",
            Sensors::WithoutEntries => "every sensor except `vertex`, `rings` and `path_length`",
            Sensors::Vertex => "the sensor `vertex`",
            Sensors::Receiving => {
                "`flux`, `rings`, `path_length`, and `orthographic` with `acceptance_sr`"
            }
        }
    }
}

impl std::fmt::Display for Serves {
    /// Sensors, boundaries and bodies, where they are restricted, and media that emit.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}", self.sensors.names())?;
        if self.boundaries != Serves::ALL.boundaries {
            let names: Vec<&str> = self.boundaries.iter().map(|b| b.name()).collect();
            write!(f, "; {} boundaries", names.join(" or "))?;
        }
        if self.bodies == Bodies::Finite {
            write!(f, "; finite bodies")?;
        }
        if self.emission { write!(f, "; media that emit") } else { Ok(()) }
    }
}

impl BoundaryKind {
    /// The kind of a boundary.
    pub fn of(boundary: &Boundary) -> BoundaryKind {
        match boundary {
            Boundary::Matched => BoundaryKind::Matched,
            Boundary::Smooth { .. } => BoundaryKind::Smooth,
            Boundary::Rough { .. } => BoundaryKind::Rough,
        }
    }

    /// As experiment files name it.
    fn name(self) -> &'static str {
        match self {
            BoundaryKind::Matched => "matched",
            BoundaryKind::Smooth => "smooth",
            BoundaryKind::Rough => "rough",
        }
    }
}
