//! Lights that a walk sees through a smooth boundary without scattering, by their expectation.
//!
//! A ray that meets the boundary from outside, with Fresnel reflectance F, sees by reflection the radiance F L(w_r), and
//! straight through the body, along a chord of length d,
//!   (1 - F) e^{-sigma_t d} (1 - F') L(w_t),
//! F' being the reflectance at the far end; the factors eta^2 of entry and exit cancel. A walk follows these paths with
//! the probabilities F and (1 - F) e^{-sigma_t d} (1 - F'), and then scores the whole radiance of the light, which for a small
//! light is large. So both are scored by their expectation where the ray meets the boundary, and the walks that follow them
//! score nothing. Light that is reflected inside at the far end is left to the walk.
//!
//! The variance over the sensor remains: in a pixel on the light's mirror image, one ray sees the light and the next does
//! not. Scoring a sensor ray takes two or three rays, a walk many. So each walk scores `views` sensor rays of its pixel in
//! this way, each with an equal share of the mean.

use super::state::Connections;
use crate::estimators::bands::WalkBands;
use crate::estimators::vertices::Unscattered;
use crate::estimators::walk::{CameraWalk, DensitySum, Rivals};
use crate::estimators::{Anomaly, Cost};
use crate::geometry::{FaceId, Hit, Ray, Side};
use crate::math::{DVec3, Frame};
use crate::sampling::distance::transmittance;

/// A direction in which a light is seen, and the fraction of its radiance that arrives.
struct View {
    way: Unscattered,
    from: DVec3,
    face: FaceId,
    towards: DVec3,
    factor: f64,
}

/// Whether lights that a walk sees in this way are scored by expectation.
pub(super) fn is_expected<B: WalkBands>(
    walk: &CameraWalk<'_, Connections<'_>, B>,
    way: Unscattered,
    light: usize,
    wi: DVec3,
) -> bool {
    let setup = walk.rivals.setup;
    let is_on = match way {
        Unscattered::Reflected => setup.options.expected_reflection,
        Unscattered::Through => setup.options.expected_passage,
        Unscattered::Inside | Unscattered::No => false,
    };
    let guide = setup.guides.iter().find(|guide| guide.light == light);
    let light = &walk.scene.lights[light];
    is_on
        && !light.is_directional()
        && guide.is_some_and(|guide| guide.density(light, walk.band, wi) > 0.0)
}

/// Scores what a ray sees that meets the boundary from outside, from the direction `wo` in the frame of the shading normal.
pub(super) fn score<B: WalkBands>(
    walk: &mut CameraWalk<'_, Connections<'_>, B>,
    hit: &Hit,
    frame: &Frame,
    wo: DVec3,
) {
    let through = walk.boundary.transmittance_smooth(wo);
    let towards = frame.to_world(DVec3::new(-wo.x, -wo.y, wo.z));
    if towards.dot(hit.normal) > 0.0 {
        let way = Unscattered::Reflected;
        let view = View { way, from: hit.point, face: hit.face, towards, factor: 1.0 - through };
        let bands = walk.bands.clone();
        see(walk, &view, &bands);
    }
    let setup = walk.rivals.setup;
    let is_wide = |light: usize| !walk.scene.lights[light].is_directional();
    if setup.options.expected_passage
        && setup.guides.iter().any(|guide| is_wide(guide.light))
        && let Some(refracted) = walk.boundary.refract(wo)
    {
        pass(walk, hit, frame.to_world(refracted), through);
    }
}

/// Scores what is seen straight through the body along `dir`. Where the normals disagree about the side of entry nothing is
/// seen, as by the walk, which counts it.
fn pass<B: WalkBands>(
    walk: &mut CameraWalk<'_, Connections<'_>, B>,
    hit: &Hit,
    dir: DVec3,
    through: f64,
) {
    if dir.dot(hit.normal) >= 0.0 {
        return;
    }
    walk.scores.count(Cost::Rays);
    let chord = Ray { origin: hit.point, dir };
    let Some(far) = walk.scene.shape.intersect(&chord, Side::Inside, Some(hit.face), f64::INFINITY)
    else {
        if walk.scene.shape.bounds().is_some() {
            walk.scores.note(Anomaly::LostRay);
        }
        return;
    };
    let Some(exit) = walk.exit_at(far, dir) else { return };
    let Some(out) = walk.boundary.refract(exit.wo) else { return };
    let towards = exit.frame.to_world(out);
    if !walk.leads_outside(&exit, towards) {
        return;
    }
    let through = through * walk.boundary.transmittance_smooth(exit.wo);
    let factor = through * transmittance(walk.medium.sigma_t, far.t);
    let view = View { way: Unscattered::Through, from: far.point, face: far.face, towards, factor };
    let mut bands = walk.bands.clone();
    bands.passage(&walk.scene.medium, far.t);
    see(walk, &view, &bands);
}

fn see<B: WalkBands>(walk: &mut CameraWalk<'_, Connections<'_>, B>, view: &View, bands: &B) {
    let &View { way, from, face, towards, factor } = view;
    for guide in walk.rivals.setup.guides.iter() {
        if !Connections::is_expected(walk, way, guide.light, towards)
            || walk.is_shadowed(from, face, towards)
        {
            continue;
        }
        let (radiance, _) = walk.scene.lights[guide.light].eval(walk.band, towards);
        let extra_turns = Connections::extra_turns(walk);
        walk.rivals.weigh(&DensitySum { all: 1.0 + extra_turns, rivals: 0.0, extra_turns });
        let drawn = bands.density() * (1.0 + extra_turns);
        let value = walk.throughput * walk.look_share * factor * radiance / drawn;
        walk.score_with(bands, walk.history.class(), guide.light, value);
    }
}
