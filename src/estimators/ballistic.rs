//! Light that goes straight through a matched body: transmittance times radiance.
//!
//! Radiance along a ray that meets no particle falls by exp(-sigma_t d) over a length d inside (Beer, Lambert). A
//! matched boundary neither bends the ray nor takes anything from it, so that what a sensor's ray receives unscattered
//! is the light's own radiance in the ray's direction times that.

use std::sync::Arc;

use super::{
    BandUse, Bias, BoundaryKind, Cost, Estimator, EstimatorKind, Scores, Serves, TransportClass,
    read_options,
};
use crate::error::Result;
use crate::geometry::{Ray, Side};
use crate::sampling::distance::transmittance;
use crate::sampling::stream::{PassKey, Purpose};
use crate::scene::Scene;

/// Under which name and with which options an experiment file asks for it, and which scenes it serves.
pub const BALLISTIC: EstimatorKind = EstimatorKind {
    kind: "ballistic",
    doc: "light straight through a matched body; unbiased in the class surface, and scores no other",
    serves: Serves { boundaries: &[BoundaryKind::Matched], ..Serves::FROM_OUTSIDE },
    options_schema: || schemars::schema_for!(BallisticOptions),
    build: |options, scene| Ok(Box::new(Ballistic::new(read_options(options)?, scene)?)),
};

/// Options of `ballistic`.
#[derive(Clone, Debug, Default, PartialEq, serde::Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct BallisticOptions {
    /// Straight rays whose mean is one score; 1 without it.
    #[schemars(range(min = 1, max = 1024))]
    rays: Option<u32>,
}

/// The estimator, for one scene.
struct Ballistic {
    rays: u32,
    scene: Arc<Scene>,
}

impl Ballistic {
    /// For a scene that it serves.
    fn new(options: BallisticOptions, scene: Arc<Scene>) -> Result<Ballistic> {
        BALLISTIC.check(&scene)?;
        Ok(Ballistic { rays: options.rays.unwrap_or(1), scene })
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
        for index in 0..scene.sensor.rays_per_pass() {
            let mut stream = key.stream(index as u64, Purpose::Sensor);
            for _ in 0..self.rays {
                let ([a, b], [c, d]) = (stream.draw2(), stream.draw2());
                let start = scene.sensor.ray(index, [a, b, c, d]);
                scores.count(Cost::Paths);
                let Some(length) = self.length_inside(start.ray) else { continue };
                for &band in bands {
                    let through = transmittance(scene.medium[band].sigma_t, length);
                    let weight = start.weight * through / f64::from(self.rays);
                    for (light, emission) in scene.lights.iter().enumerate() {
                        let (radiance, _) = emission.eval(band, start.ray.dir);
                        scores.add(start.slot, band, TransportClass::Surface, light, weight * radiance);
                    }
                }
            }
        }
    }

    fn bias(&self) -> Bias {
        Bias::Unbiased
    }

    fn band_use(&self) -> BandUse {
        BandUse::Shared // one straight line serves all bands
    }

    fn notes(&self) -> Vec<String> {
        vec![
            "ballistic scores the class surface alone: scattered light is excluded from its result"
                .into(),
        ]
    }
}
