//! `snee_connect`: subdivision next-event estimation and the specular connection through a smooth boundary, weighted against
//! each other and the walk by the balance heuristic.
//!
//! The two complement each other. The connection finds single scattering, exits that the vertex before the last does not
//! see, and vertices after an internal reflection; subdivision bounds the connection's weights at caustics. `specular` has the
//! path classes and densities. The other techniques of `snee` are unchanged, but the last vertex is off unless `last_vertex`
//! is named: it samples by a guess what the connection solves for, at the cost of another ray.
//!
//! | light reaches the last medium vertex | parallel light | disc of directions |
//! |---|---|---|
//! | by one refraction | complete | complete |
//! | by a refraction and internal reflections, or through another part of a body that is not convex | missing | left to the walk and to `photons` |

use std::sync::Arc;

use super::{Snee, SneeChoices, SneeOptions};
use crate::error::{Error, Result};
use crate::estimators::{BoundaryKind, EstimatorKind, Serves, read_options};
use crate::scene::Scene;

impl Snee {
    /// `snee_connect` in experiment files.
    pub const CONNECT_KIND: EstimatorKind = EstimatorKind {
        kind: "snee_connect",
        doc: "subdivision next-event estimation and connections through a smooth boundary, weighted together; unbiased",
        serves: Serves {
            boundaries: &[BoundaryKind::Smooth],
            emission: true,
            ..Serves::WITHOUT_ENTRIES
        },
        options_schema: || schemars::schema_for!(SneeChoices),
        build: |options, scene| {
            let choices: SneeChoices = read_options(options)?;
            Ok(Box::new(Snee::connected(scene, choices.connected()?)?))
        },
    };

    /// With connections, for a scene.
    ///
    /// # Errors
    /// A scene that it does not serve; options without a connection; bands that are to share walks and differ in more
    /// than their media.
    pub fn connected(scene: Arc<Scene>, options: SneeOptions) -> Result<Snee> {
        Snee::CONNECT_KIND.check(&scene)?;
        if options.connection.is_none() {
            return Err(Error::input_help(
                "snee_connect: `connection` is switched off",
                "leave it out, or use snee",
            ));
        }
        Snee::set_up(scene, options)
    }
}
