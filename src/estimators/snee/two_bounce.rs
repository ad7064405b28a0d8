//! One edge of a path alone: the radiance that two segments carry to a medium vertex.
//!
//! The sensor is a medium vertex: it gives x_i and the direction of arrival. What is estimated is
//!   I(x_i) = int phase T / d_ij^2 sigma_s phase T cos_k / d_jk^2 f_k |cos| L
//! over x_j, x_k and the direction of light, by whatever strategies take part. With one at a time, each
//! of them is compared with all others without the walk that usually surrounds them: errors of a few per
//! cent in one density, which weights would hide, show at once.

use std::sync::Arc;

use super::state::Connections;
use super::{Snee, SneeChoices, SneeOptions};
use crate::error::{Error, Result};
use crate::estimators::bands::OneBand;
use crate::estimators::field::Path;
use crate::estimators::walk::{CameraWalk, Unrivalled};
use crate::estimators::{Estimator, EstimatorKind, Scores, Sensors, Serves, WalkDraw, read_options};
use crate::sampling::stream::{PassKey, Purpose};
use crate::scene::Scene;

/// The estimator, for one scene.
#[derive(Debug)]
pub struct TwoBounce(Snee);

impl TwoBounce {
    /// `two_bounce` in experiment files.
    pub const KIND: EstimatorKind = EstimatorKind {
        kind: "two_bounce",
        doc: "the last two segments alone, from a medium vertex, by snee's techniques; unbiased",
        serves: Serves { sensors: Sensors::Vertex, ..Serves::ALL },
        options_schema: || schemars::schema_for!(SneeChoices),
        build: |options, scene| {
            let choices: SneeChoices = read_options(options)?;
            Ok(Box::new(TwoBounce::new(scene, choices.options()?)?))
        },
    };

    /// For a scene.
    ///
    /// # Errors
    /// A scene that it does not serve; bands that share walks; walks that are guided.
    pub fn new(scene: Arc<Scene>, options: SneeOptions) -> Result<TwoBounce> {
        TwoBounce::KIND.check(&scene)?;
        if options.share_bands {
            return Err(Error::input(
                "two_bounce traces every band alone; leave out `bands = \"shared\"`",
            ));
        }
        if options.walk != (WalkDraw::Plain {}) {
            return Err(Error::input("two_bounce has no walk to guide; leave out `walk`"));
        }
        if options.photons.is_some() {
            return Err(Error::input("two_bounce has no photons; leave out `photons`"));
        }
        if options.learned_calls.is_some() {
            return Err(Error::input("two_bounce has no walk to learn from; leave out `learned_calls`"));
        }
        Ok(TwoBounce(Snee::set_up(scene, options)?))
    }
}

impl Estimator for TwoBounce {
    fn pass(&self, bands: &[usize], key: &PassKey, scores: &mut Scores) {
        let TwoBounce(snee) = self;
        let field = snee.walks.field();
        for &band in bands {
            let setup = &snee.setups[band];
            for index in 0..field.scene.sensor.rays_per_pass() {
                let path = Path { field, band, index, key };
                if setup.guides.is_empty() {
                    CameraWalk::trace_two_bounces(path, scores, Unrivalled, OneBand);
                } else {
                    let stream = key.stream(index as u64, Purpose::Connection);
                    let mut connections = Connections::new(setup, stream);
                    connections.is_edge_alone = true;
                    CameraWalk::trace_two_bounces(path, scores, connections, OneBand);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{Lamp, body, medium, sphere};
    use super::*;
    use crate::estimators::snee::SneePreset;
    use crate::geometry::Ray;
    use crate::math::DVec3;
    use crate::optics::boundary::Boundary;
    use crate::scene::sensor::{Sensor, Vertex};

    #[test]
    fn has_no_walk_to_guide() {
        let scene =
            body(&sphere(), Boundary::Smooth { eta: 1.4 }, &[medium(2.0, 0.9, 0.0)], &[Lamp::Disc]);
        let mut scene = Arc::into_inner(scene).expect("not shared");
        let ray = Ray { origin: DVec3::ZERO, dir: DVec3::Z };
        scene.sensor = Sensor::Vertex(Vertex { ray, paths: 1 });
        let scene = Arc::new(scene);
        let plain = SneePreset::Guided.options();
        let walk = WalkDraw::Guided { share: 0.9, nodes: 8, least_depth: Some(0.0), near_lights: true };
        let guided = SneeOptions { walk, ..plain.clone() };
        let refusal = TwoBounce::new(Arc::clone(&scene), guided).expect_err("refused").to_string();
        assert!(refusal.contains("no walk to guide"), "{refusal}");
        assert!(TwoBounce::new(scene, plain).is_ok());
    }
}
