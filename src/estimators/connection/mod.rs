//! Connections through the boundary: at every medium vertex x of a camera walk, the boundary points
//! p at which light from a chosen light is refracted to x.
//!
//! A root p satisfies Snell's law for w = unit(p - x) and the direction w_L to the light. `throughput`
//! computes its contribution, and `vertex` its MIS weight against unidirectional sampling by the walk. A root
//! counts if p is the first boundary point on the ray from x along w, and nothing lies between p and the
//! light. Methods differ in which roots they find:
//!
//! | method | roots | parallel light | disc of directions |
//! |---|---|---|---|
//! | `conic` | all | unbiased | unbiased, MIS with the walk |
//! | `newton` | at most one per triangle | biased on interpolated normals | unbiased, MIS with the walk |
//! | `mnee` | at most one | biased: light is missing | unbiased, MIS with the walk |
//! | `sms` | one, weighted | unbiased | unbiased, alone |
//! | `segments` | all | unbiased | unbiased, MIS with the walk except for single scattering |
//! | `straight_line` | the unrefracted point, which is no root | biased | biased, alone |
//!
//! Lights that are not concentrated (environments) are left to the walk.
//!
//! At a rough boundary `newton`, `mnee` and `sms` also draw a facet, which refracts in place of the surface.
//! There the walk finds every path that a method loses, also under parallel light, so that no method is
//! biased; `sms` replaces the walk for its lights.
//!
//! Connections find the paths whose light is refracted once, at the last boundary point before the last
//! medium vertex, whatever the camera's part of the path does. By transport class of the record:
//!
//! | light reaches the last medium vertex | class by the camera's part | found |
//! |---|---|---|
//! | by one refraction, one vertex | `single`; `single_internal` after reflections on the camera's side | yes |
//! | by one refraction, more vertices | `multiple`; `multiple_internal` after reflections on the camera's side | yes |
//! | by a refraction and internal reflections | `single_internal`, `multiple_internal` | from a disc, by the walk; parallel light: no |
//! | through another part of a body that is not convex | any of the four | from a disc, by the walk; parallel light: no |
//!
//! Under parallel light `single` and `multiple` are therefore complete on convex bodies. `single_internal` and
//! `multiple_internal` lack light that is reflected inside on the light's side. The classes do not
//! distinguish it from light that is reflected on the camera's side, so that `light_trace` has larger means
//! there. The part of the path towards the sensor may enter and leave the body any number of times.

mod bounds;
mod cones;
mod conic;
mod connected;
mod eight;
mod facet;
mod manifold;
mod method;
mod newton;
mod patch;
mod polynomial;
mod segments;
mod sphere;
mod straight_line;
mod throughput;
mod vertex;

use std::sync::Arc;

use schemars::JsonSchema;
use serde::Deserialize;

use super::bands::OneBand;
use super::choice::shares;
use super::field::{Field, Path};
use super::walk::{CameraWalk, Unrivalled};
use super::{Bias, BoundaryKind, Estimator, EstimatorKind, Roulette, Scores, Serves, read_options};
use crate::error::{Error, Result};
use crate::geometry::Shape;
use crate::optics::boundary::Boundary;
use crate::sampling::stream::{PassKey, Purpose};
use crate::scene::{Light, Scene};

use method::Solver;
use vertex::Connected;

pub use method::ConnectionMethod;

// The complete solver, for estimators that weight its connections against other techniques.
pub(super) use conic::Conic;
pub(super) use facet::SolverWork;
pub(super) use patch::SurfacePatch;
pub(super) use throughput::{Query, Root, solid_angle_ratio};

/// Options of `connection`.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ConnectionOptions {
    /// How a vertex is connected to a light through the boundary.
    #[serde(default = "complete")]
    pub method: ConnectionMethod,
    /// Russian roulette; all choices are unbiased.
    #[serde(default)]
    pub roulette: Roulette,
}

fn complete() -> ConnectionMethod {
    ConnectionMethod::Conic {}
}

/// Least concentration 4 pi int L^2 / (int L)^2 of a light that is connected to, 2 / height of a cap:
/// 0.4 pi sr.
const LEAST_CONCENTRATION: f64 = 10.0;

/// Data that all connections share.
#[derive(Debug)]
struct ConnectionSetup {
    solver: Solver,
    /// Per band: probability of choosing each light; 0 for those that are left to the walk.
    shares: Vec<Vec<f64>>,
    /// Whether the density of the method's roots is known.
    is_density_known: bool,
}

/// The estimator, for one scene.
#[derive(Debug)]
pub struct SpecularConnection {
    field: Field,
    method: ConnectionMethod,
    setup: ConnectionSetup,
}

impl SpecularConnection {
    /// `connection` in experiment files.
    pub const KIND: EstimatorKind = EstimatorKind {
        kind: "connection",
        doc: "path tracing with connections to lights through the boundary, by six methods; conic, segments and sms are unbiased",
        serves: Serves {
            boundaries: &[BoundaryKind::Smooth, BoundaryKind::Rough],
            emission: true,
            ..Serves::WITHOUT_ENTRIES
        },
        options_schema: || schemars::schema_for!(ConnectionOptions),
        build: |options, scene| {
            let ConnectionOptions { method, roulette } = read_options(options)?;
            Ok(Box::new(SpecularConnection::new(scene, method, roulette)?))
        },
    };

    /// For a scene.
    ///
    /// # Errors
    /// A scene that it does not serve.
    pub fn new(
        scene: Arc<Scene>,
        method: ConnectionMethod,
        roulette: Roulette,
    ) -> Result<SpecularConnection> {
        SpecularConnection::KIND.check(&scene)?;
        let is_rough = scene.boundary.iter().any(|boundary| matches!(boundary, Boundary::Rough { .. }));
        if is_rough && !method.takes_slopes() {
            return Err(Error::input_help(
                "connection: this method needs a smooth boundary",
                "at a rough one choose method newton, mnee or sms",
            ));
        }
        let is_connected = |light: &Light| light.concentration() >= LEAST_CONCENTRATION;
        let of_band = |band: usize| {
            // Without refraction a facet turns nothing: its slopes are those of no density.
            let boundary = &scene.boundary[band];
            let is_served = boundary.is_delta() || boundary.eta() != 1.0;
            let strength = |light: &Light| {
                if is_served && is_connected(light) { light.strength(band) } else { 0.0 }
            };
            shares(&scene.lights.iter().map(strength).collect::<Vec<f64>>())
        };
        let shares = (0..scene.bands()).map(of_band).collect();
        let is_density_known =
            !matches!(method, ConnectionMethod::Sms {} | ConnectionMethod::StraightLine {});
        let setup =
            ConnectionSetup { solver: Solver::new(method, &scene.shape), shares, is_density_known };
        Ok(SpecularConnection { field: Field::new(scene, roulette), method, setup })
    }

    /// Whether there is light that the walk cannot find.
    fn is_alone(&self) -> bool {
        let is_smooth = self.field.scene.boundary.iter().any(Boundary::is_delta);
        is_smooth && self.field.scene.lights.iter().any(Light::is_directional)
    }
}

impl Estimator for SpecularConnection {
    fn pass(&self, bands: &[usize], key: &PassKey, scores: &mut Scores) {
        for &band in bands {
            let is_called = self.setup.shares[band].iter().any(|share| *share > 0.0);
            for index in 0..self.field.scene.sensor.rays_per_pass() {
                let path = Path { field: &self.field, band, index, key };
                if is_called {
                    let stream = key.stream(index as u64, Purpose::Connection);
                    CameraWalk::trace(path, scores, Connected::new(&self.setup, stream), OneBand);
                } else {
                    CameraWalk::trace(path, scores, Unrivalled, OneBand);
                }
            }
        }
    }

    fn bias(&self) -> Bias {
        let scene = &self.field.scene;
        let is_alone = self.is_alone();
        let interpolated = matches!(&*scene.shape, Shape::Mesh(mesh) if mesh.normals().is_some());
        match self.method {
            ConnectionMethod::StraightLine {} => {
                Bias::Biased("light goes straight through the boundary, which refracts it".into())
            }
            ConnectionMethod::Mnee {} if is_alone => Bias::Biased(
                "manifold next-event estimation finds one boundary point at most for a vertex; parallel light by all \
                 others is missing"
                    .into(),
            ),
            ConnectionMethod::Newton {} if is_alone && interpolated => Bias::Biased(
                "one Newton iteration a triangle may lose boundary points where normals are interpolated; \
                 parallel light that comes through them is missing"
                    .into(),
            ),
            _ => Bias::Unbiased,
        }
    }

    fn held_bytes(&self) -> usize {
        self.setup.solver.heap_bytes()
    }

    fn notes(&self) -> Vec<String> {
        missing_notes(&self.field.scene)
    }
}

/// Note on parallel light that no connection through one boundary point finds.
pub(super) fn missing_notes(scene: &Scene) -> Vec<String> {
    let is_smooth = scene.boundary.iter().any(Boundary::is_delta);
    let lights = scene.lights.iter().filter(|light| is_smooth && light.is_directional());
    lights
        .map(|light| {
            format!(
                "of directional light `{}`, what is reflected inside before its last scattering event, what goes through \
                 another part of a body that is not convex before, and what is not scattered are excluded from this \
                 estimator's result",
                light.name
            )
        })
        .collect()
}

#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod work_tests;
