//! Rings: a dipole's closed form, and light and camera paths ring by ring.

use std::f64::consts::PI;
use std::sync::Arc;

use super::bssrdf_probe::{BssrdfProbe, ProbeOptions};
use super::bssrdf_rays::{BssrdfRays, RayOptions};
use super::light_trace::LightTracer;
use super::path::{PathTracer, Roulette};
use super::{Estimator, Layout, Scores, TransportClass};
use crate::geometry::Shape;
use crate::math::{DVec3, Frame, exp, integrate};
use crate::optics::boundary::Boundary;
use crate::optics::bssrdf::{Model, MomentKind, Outgoing};
use crate::optics::fresnel::fresnel;
use crate::optics::medium::Medium;
use crate::optics::microfacet::{MicrofacetKind, Microfacets};
use crate::optics::phase::HenyeyGreenstein;
use crate::sampling::stream::StreamKey;
use crate::scene::sensor::{FaceFlux, FluxFace, Rings};
use crate::scene::{Emission, Light, Scene, Sensor};

const MODEL: Model = Model::Classical { moments: MomentKind::Exact, outgoing: Outgoing::Plain };
const SMOOTH: Boundary = Boundary::Smooth { eta: 1.3 };
const GGX: Boundary =
    Boundary::Rough { eta: 1.4, facets: Microfacets { kind: MicrofacetKind::Ggx, alpha: 0.4 } };
const MEDIUM: Medium =
    Medium { sigma_t: 2.0, albedo: 0.9, phase: HenyeyGreenstein { g: 0.3 }, emission: 0.0 };
const EDGES: [f64; 5] = [0.05, 0.2, 0.5, 1.0, 3.0];

/// Radiance 1 from the upper half or, with height 2, from everywhere.
fn scene(shape: Shape, boundary: Boundary, height: f64, sensor: Sensor) -> Scene {
    let emission = Emission::Cap { frame: Frame::about(DVec3::Z), height, radiance: vec![1.0] };
    let lights = vec![Light { name: "sky".into(), emission }];
    Scene { shape: Arc::new(shape), boundary: vec![boundary], medium: vec![MEDIUM], lights, sensor }
}

fn rings(paths: usize) -> Sensor {
    Sensor::Rings(Rings { reach: 1.0, edges: EDGES.to_vec(), paths })
}

fn probe(scene: &Arc<Scene>, reach: Option<f64>) -> BssrdfProbe {
    let options = ProbeOptions { model: MODEL, probes: 2, single: None, straight: true, reach };
    BssrdfProbe::new(Arc::clone(scene), &options).expect("a scene that it serves")
}

/// Mean and standard error, over passes, of `all` and of every ring: all light, or that of one class.
fn measure(
    estimator: &dyn Estimator,
    scene: &Scene,
    class: Option<TransportClass>,
    passes: u64,
    test: &str,
) -> Vec<(f64, f64)> {
    let mut scores = Scores::new(Layout::new(scene));
    let key = StreamKey::named(test);
    let place = class.map_or(0, |class| 1 + class as usize);
    let mut moments = vec![(0.0, 0.0); EDGES.len()];
    for pass in 0..passes {
        scores.clear();
        estimator.pass(&[0], &key.pass(pass), &mut scores);
        let own = scores.observables.iter().skip(place).step_by(1 + TransportClass::ALL.len());
        for ((mean, m2), x) in moments.iter_mut().zip(own) {
            let before = x - *mean;
            *mean += before / (pass + 1) as f64;
            *m2 += before * (x - *mean);
        }
    }
    assert!(scores.anomalies.iter().all(|&count| count == 0));
    let n = passes as f64;
    moments.into_iter().map(|(mean, m2)| (mean, (m2 / (n * (n - 1.0))).sqrt())).collect()
}

/// |z| < 5 in every region, and 5 standard errors of the difference are less than `detectable` of the
/// second.
fn assert_alike(name: &str, ours: &[(f64, f64)], theirs: &[(f64, f64)], detectable: f64) {
    for (region, (a, b)) in ours.iter().zip(theirs).enumerate() {
        let error = (a.1 * a.1 + b.1 * b.1).sqrt();
        let z = (a.0 - b.0) / error;
        assert!(z.abs() < 5.0, "{name}, region {region}: {a:?} {b:?}, z = {z}");
        assert!(5.0 * error < detectable * b.0, "{name}, region {region}: {error} of {b:?}");
    }
}

/// Of the classical dipole's exitance the part cdf(r) lies within r,
///   cdf(r) = sum over both sources of w_k (1 - z_k/d_k e^(s (z_k - d_k))),
///   w_k = e^(-s z_k) over their sum,
/// in its total (alpha'/2) sum of e^(-s z_k). With radiance 1 from above and a Fresnel transmittance of
/// mean P = int T12 mu dw / pi at both ends, a ring shows pi P^2 times its part. 512 passes of 1024
/// paths; 5 standard errors are below 5 %.
#[test]
fn rings_of_the_classical_dipole() {
    let moment = |eta: f64| {
        integrate(|mu| 2.0 * mu * (1.0 - fresnel(mu, eta).reflectance), 0.0, 1.0, 1e-13).value
    };
    let (passed, kept) = (moment(1.3), 1.0 - moment(1.0 / 1.3));
    let Medium { sigma_t, albedo, phase, .. } = MEDIUM;
    let (sigma_a, sigma_s) = (sigma_t * (1.0 - albedo), sigma_t * albedo * (1.0 - phase.g));
    let reduced = sigma_a + sigma_s;
    let s = (3.0 * sigma_a * reduced).sqrt();
    let z_real = 1.0 / reduced;
    let sources = [z_real, z_real * (1.0 + 4.0 / 3.0 * (1.0 + kept) / (1.0 - kept))];
    let within = |r: f64| -> f64 {
        let part = |z: f64| {
            let d = (r * r + z * z).sqrt();
            exp(-s * z) * (1.0 - z / d * exp(s * (z - d)))
        };
        0.5 * sigma_s / reduced * sources.map(part).iter().sum::<f64>()
    };
    let scale = PI * passed * passed;
    let total = 0.5 * sigma_s / reduced * sources.map(|z| exp(-s * z)).iter().sum::<f64>();
    let parts = EDGES.windows(2).map(|edge| within(edge[1]) - within(edge[0]));
    let expected: Vec<(f64, f64)> =
        std::iter::once(total).chain(parts).map(|part| (scale * part, 0.0)).collect();

    let scene = Arc::new(scene(Shape::HalfSpace, SMOOTH, 1.0, rings(1024)));
    let options = RayOptions { model: MODEL, rays: 4, depth: None, single: None, straight: true };
    let rays = BssrdfRays::new(Arc::clone(&scene), &options).expect("a scene that it serves");
    let estimators: [(&str, &dyn Estimator); 2] = [("probe", &probe(&scene, None)), ("rays", &rays)];
    for (name, estimator) in estimators {
        let test = format!("rings_of_the_classical_dipole, {name}");
        let found = measure(estimator, &scene, Some(TransportClass::Multiple), 512, &test);
        assert_alike(name, &found, &expected, 0.05);
    }
}

/// Photons come in at the origin, camera paths leave there: ring by ring they find the same, through
/// smooth, rough and no boundaries, on a half-space and on a slab that is lit from below too. 128 passes
/// of 4096 paths of either; 5 standard errors of the difference are below 11 %.
#[test]
fn photons_and_camera_paths_agree_ring_by_ring() {
    let slab = || Shape::Slab { thickness: 0.6 };
    for (name, shape, boundary, height) in [
        ("half-space, smooth", Shape::HalfSpace, SMOOTH, 1.0),
        ("half-space, matched", Shape::HalfSpace, Boundary::Matched, 1.0),
        ("slab, rough", slab(), GGX, 2.0),
        ("slab, matched", slab(), Boundary::Matched, 2.0),
    ] {
        let scene = Arc::new(scene(shape, boundary, height, rings(4096)));
        let photons = LightTracer::new(Arc::clone(&scene), None).expect("a sensor that it serves");
        let paths =
            PathTracer::new(Arc::clone(&scene), Roulette::Below(0.25)).expect("a scene that it serves");
        let [light, camera] =
            [("light", &photons as &dyn Estimator), ("camera", &paths)].map(|(kind, e)| {
                let test = format!("photons_and_camera_paths_agree_ring_by_ring, {name}, {kind}");
                measure(e, &scene, None, 128, &test)
            });
        assert_alike(name, &light, &camera, 0.11);
    }
}

/// Once-scattered light comes in where its refracted way does, not below the light. 384 passes of 4096
/// paths of either; 5 standard errors of the difference are below 10 %.
#[test]
fn single_scattering_ring_by_ring() {
    let scene = Arc::new(scene(Shape::HalfSpace, SMOOTH, 1.0, rings(4096)));
    let photons = LightTracer::new(Arc::clone(&scene), None).expect("a sensor that it serves");
    // Without any line: none is as near as this.
    let single = probe(&scene, Some(0.0));
    let [ours, light] = [("ours", &single as &dyn Estimator), ("light", &photons)].map(|(kind, e)| {
        let test = format!("single_scattering_ring_by_ring, {kind}");
        measure(e, &scene, Some(TransportClass::Single), 384, &test)
    });
    // The outermost ring, many free paths away, has next to none of it.
    assert_alike("single", &ours[..4], &light[..4], 0.1);
}

/// A photon that leaves by the top counts in `all`, whatever its ring: to the bit what a flux of one bin
/// counts.
#[test]
fn all_is_the_flux() {
    let face = FluxFace { name: "top", point: DVec3::ZERO, reach: 1.0, frame: Frame::about(DVec3::Z) };
    let flux = Sensor::FaceFlux(FaceFlux { faces: vec![face], bins: 1, paths: 512 });
    let [by_ring, whole] = [rings(512), flux].map(|sensor| {
        let scene = Arc::new(scene(Shape::HalfSpace, GGX, 1.0, sensor));
        let photons = LightTracer::new(Arc::clone(&scene), None).expect("a sensor that it serves");
        let mut scores = Scores::new(Layout::new(&scene));
        photons.pass(&[0], &StreamKey::named("all_is_the_flux").pass(0), &mut scores);
        scores
    });
    let stride = 1 + TransportClass::ALL.len();
    assert!(whole.observables[0] > 0.0);
    assert_eq!(by_ring.observables[..stride], whole.observables[..stride]);
    let rings: f64 = by_ring.observables.iter().step_by(stride).skip(1).sum();
    assert!(0.0 < rings && rings < whole.observables[0]);
}

/// A body of finite size has no face without end.
#[test]
fn rings_are_for_planes() {
    let scene = scene(Shape::Sphere { radius: 1.0 }, SMOOTH, 1.0, rings(4));
    assert!(LightTracer::new(Arc::new(scene), None).is_err());
}
