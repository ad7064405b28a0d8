//! Light that goes straight through a matched body: transmittance times radiance. An estimator of one's
//! own over the library, as `CONTRIBUTING.md` shows it.
//!
//! ```text
//! cargo run --release --example ballistic -- verify examples/ballistic.toml
//! ```

use std::process::ExitCode;
use std::sync::Arc;

use scatterproof::error::{Error, Result};
use scatterproof::estimators::{Cost, Estimator, Scores, TransportClass};
use scatterproof::experiment::estimators::{builtin, read};
use scatterproof::experiment::registry::RegistryEntry;
use scatterproof::geometry::{Ray, Side};
use scatterproof::optics::boundary::Boundary;
use scatterproof::sampling::distance::transmittance;
use scatterproof::sampling::stream::{PassKey, Purpose};
use scatterproof::scene::Scene;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The estimator, for one scene.
struct Ballistic {
    scene: Arc<Scene>,
}

impl Ballistic {
    /// For a scene whose boundary is matched.
    fn new(scene: Arc<Scene>) -> Result<Ballistic> {
        if scene.boundary.iter().any(|b| *b != Boundary::Matched) {
            let help = "use object.boundary.matched, or leave the estimator out";
            return Err(Error::input_help("ballistic needs a matched boundary", help));
        }
        Ok(Ballistic { scene })
    }

    /// Length inside the body; `None` where the ray misses it or never leaves.
    fn length_inside(&self, mut ray: Ray) -> Option<f64> {
        let (mut side, mut from, mut length) = (Side::Outside, None, 0.0);
        while let Some(hit) = self.scene.shape.intersect(&ray, side, from, f64::INFINITY) {
            if side == Side::Inside {
                length += hit.t;
            }
            (ray.origin, from) = (hit.point, Some(hit.face));
            side = if side == Side::Inside { Side::Outside } else { Side::Inside };
        }
        (from.is_some() && side == Side::Outside).then_some(length)
    }
}

impl Estimator for Ballistic {
    fn pass(&self, bands: &[usize], key: &PassKey, scores: &mut Scores) {
        let scene = &self.scene;
        for &band in bands {
            for index in 0..scene.sensor.rays_per_pass() {
                let mut stream = key.stream(index as u64, Purpose::Sensor);
                let ([a, b], [c, d]) = (stream.draw2(), stream.draw2());
                let start = scene.sensor.ray(index, [a, b, c, d]);
                scores.count(Cost::Paths);
                let Some(length) = self.length_inside(start.ray) else { continue };
                let weight = start.weight * transmittance(scene.medium[band].sigma_t, length);
                for (light, emission) in scene.lights.iter().enumerate() {
                    let (radiance, _) = emission.eval(band, start.ray.dir);
                    let value = weight * radiance;
                    scores.add(start.slot, band, TransportClass::Surface, light, value);
                }
            }
        }
    }
}

/// Options of `ballistic`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct BallisticOptions {}

fn main() -> ExitCode {
    let mut registry = builtin();
    registry.entries.push(RegistryEntry {
        kind: "ballistic",
        doc: "light straight through a matched body, without noise",
        options_schema: || schemars::schema_for!(BallisticOptions),
        build: |options, scene| {
            let BallisticOptions {} = read(options)?;
            Ok(Box::new(Ballistic::new(scene)?))
        },
    });
    scatterproof::cli::main(&registry)
}
