//! Which scenes an estimator serves: by sensor, boundary and body.

use crate::error::{Error, Result};
use crate::optics::boundary::Boundary;
use crate::scene::{Scene, Sensor};

/// The scenes that an estimator serves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Serves {
    /// Sensors that the estimator serves.
    pub sensors: &'static [SensorKind],
    /// Boundaries that the estimator serves.
    pub boundaries: &'static [BoundaryKind],
    /// Extents of bodies that the estimator serves.
    pub bodies: Bodies,
}

/// Kinds of sensors, as estimators distinguish them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SensorKind {
    /// Parallel rays through pixels.
    Orthographic,
    /// Pixels that accept light from a cap of directions.
    Accepting,
    /// Rays from a point through pixels.
    Perspective,
    /// One ray from outside.
    Probe,
    /// Sensor at a medium vertex.
    Vertex,
    /// Exitance or flux by the cosine of the exit direction.
    Flux,
    /// Exitance by the distance between entry and exit.
    Rings,
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
    /// No restriction: every scene is served.
    pub const ALL: Serves = Serves {
        sensors: &[
            SensorKind::Orthographic,
            SensorKind::Accepting,
            SensorKind::Perspective,
            SensorKind::Probe,
            SensorKind::Vertex,
            SensorKind::Flux,
            SensorKind::Rings,
        ],
        boundaries: &[BoundaryKind::Matched, BoundaryKind::Smooth, BoundaryKind::Rough],
        bodies: Bodies::All,
    };

    /// Scenes whose sensor looks at the body from outside.
    pub const FROM_OUTSIDE: Serves = Serves {
        sensors: &[
            SensorKind::Orthographic,
            SensorKind::Accepting,
            SensorKind::Perspective,
            SensorKind::Probe,
            SensorKind::Flux,
            SensorKind::Rings,
        ],
        ..Serves::ALL
    };

    /// Scenes whose sensor looks from outside and does not depend on where light entered.
    pub const WITHOUT_ENTRIES: Serves = Serves {
        sensors: &[
            SensorKind::Orthographic,
            SensorKind::Accepting,
            SensorKind::Perspective,
            SensorKind::Probe,
            SensorKind::Flux,
        ],
        ..Serves::ALL
    };

    /// Scenes whose sensor looks from outside at a body without a rough boundary, which the BSSRDFs here
    /// need.
    pub const BSSRDF: Serves =
        Serves { boundaries: &[BoundaryKind::Matched, BoundaryKind::Smooth], ..Serves::FROM_OUTSIDE };

    /// Refuses a scene that `name` does not serve.
    pub(super) fn check(&self, name: &str, scene: &Scene) -> Result<()> {
        let sensor = SensorKind::of(&scene.sensor);
        if !self.sensors.contains(&sensor) {
            return Err(self.refuse_sensor(name, sensor));
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
        Ok(())
    }

    fn refuse_sensor(&self, name: &str, sensor: SensorKind) -> Error {
        let served = |sensor| self.sensors.contains(&sensor);
        match sensor {
            SensorKind::Vertex => Error::input_help(
                format!("{name} starts its paths outside the body, the sensor `vertex` is inside"),
                "use two_bounce, or another sensor",
            ),
            SensorKind::Rings if served(SensorKind::Flux) => Error::input_help(
                format!("{name} does not keep where light came in, by which the sensor `rings` counts"),
                "use light_trace, path, bssrdf_probe or bssrdf_rays, or the sensor `flux`",
            ),
            _ => Error::input_help(
                format!("{name} cannot serve the sensor {}", sensor.name()),
                format!("it serves {}", self.sensor_names()),
            ),
        }
    }

    fn sensor_names(&self) -> String {
        let names: Vec<&str> = self.sensors.iter().map(|sensor| sensor.name()).collect();
        names.join(", ")
    }
}

impl std::fmt::Display for Serves {
    /// Sensors, boundaries and bodies; what is not restricted is left out.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "sensors {}", self.sensor_names())?;
        if self.boundaries != Serves::ALL.boundaries {
            let names: Vec<&str> = self.boundaries.iter().map(|b| b.name()).collect();
            write!(f, "; {} boundaries", names.join(" or "))?;
        }
        if self.bodies == Bodies::Finite { write!(f, "; finite bodies") } else { Ok(()) }
    }
}

impl SensorKind {
    /// The kind of a sensor.
    pub fn of(sensor: &Sensor) -> SensorKind {
        match sensor {
            Sensor::Orthographic(_) => SensorKind::Orthographic,
            Sensor::Accepting(_) => SensorKind::Accepting,
            Sensor::Perspective(_) => SensorKind::Perspective,
            Sensor::Probe { .. } => SensorKind::Probe,
            Sensor::Vertex { .. } => SensorKind::Vertex,
            Sensor::FaceFlux { .. } | Sensor::BodyFlux { .. } => SensorKind::Flux,
            Sensor::Rings(_) => SensorKind::Rings,
        }
    }

    /// As messages name it.
    fn name(self) -> &'static str {
        match self {
            SensorKind::Orthographic => "`orthographic`",
            SensorKind::Accepting => "`orthographic` with `acceptance_sr`",
            SensorKind::Perspective => "`perspective`",
            SensorKind::Probe => "`probe`",
            SensorKind::Vertex => "`vertex`",
            SensorKind::Flux => "`flux`",
            SensorKind::Rings => "`rings`",
        }
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
