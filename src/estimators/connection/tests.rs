//! Weights that sum to 1, and means against closed forms.

use super::method::WeightedRoot;
use super::testing::entering;
use super::throughput::{Judgement, Query};
use super::vertex::{self, Departure, Drawn};
use super::*;
use crate::estimators::testing::measure as measure_passes;
use crate::estimators::vertices::{WalkExit, WalkVertex};
use crate::estimators::{Anomaly, Layout, TransportClass};
use crate::geometry::{Hit, Ray, Side, procedural};
use crate::math::{DVec2, DVec3, Frame, cos, exp, integrate};
use crate::optics::boundary::Boundary;
use crate::optics::fresnel::fresnel;
use crate::optics::medium::Medium;
use crate::optics::microfacet::{MicrofacetKind, Microfacets};
use crate::optics::phase::HenyeyGreenstein;
use crate::reference::refracting_plane::PlaneBeam;
use crate::reference::refracting_polyhedron::{self, CameraSegment};
use crate::reference::refracting_sphere::LitSphere;
use crate::sampling::distance::transmittance;
use crate::sampling::stream::StreamKey;
use crate::scene::sensor::Probe;
use crate::scene::{Emission, Sensor};

const ETA: f64 = 1.4;

fn sun(toward: DVec3, irradiance: f64) -> Light {
    let emission = Emission::Directional { toward: toward.normalize(), irradiance: vec![irradiance] };
    Light { name: format!("sun {toward}"), emission }
}

fn disc(toward: DVec3, height: f64, radiance: f64) -> Light {
    let frame = Frame::about(toward.normalize());
    Light {
        name: format!("disc {toward}"),
        emission: Emission::Cap { frame, height, radiance: vec![radiance] },
    }
}

fn medium(sigma_t: f64, albedo: f64, g: f64) -> Medium {
    Medium { sigma_t, albedo, phase: HenyeyGreenstein { g }, emission: 0.0 }
}

fn scene(shape: Shape, medium: Medium, lights: Vec<Light>, ray: Ray, paths: usize) -> Arc<Scene> {
    let sensor = Sensor::Probe(Probe { ray, paths });
    let boundary = vec![Boundary::Smooth { eta: ETA }];
    Arc::new(Scene { shape: Arc::new(shape), boundary, medium: vec![medium], lights, sensor })
}

fn measure(estimator: &SpecularConnection, passes: u64, test: &str) -> (Vec<(f64, f64)>, Scores) {
    measure_passes(estimator, &Layout::new(&estimator.field.scene), passes, test)
}

fn class(class: TransportClass) -> usize {
    1 + class as usize
}

const METHODS: [ConnectionMethod; 6] = [
    ConnectionMethod::Conic {},
    ConnectionMethod::Newton {},
    ConnectionMethod::Mnee {},
    ConnectionMethod::Sms {},
    ConnectionMethod::Segments {},
    ConnectionMethod::StraightLine {},
];

fn unlike_lights() -> Vec<Light> {
    vec![
        disc(DVec3::new(-0.5, 0.4, 0.6), 1e-2, 30.0),
        sun(DVec3::new(0.6, -0.3, 0.7), 2.0),
        disc(DVec3::new(0.2, 0.8, -0.5), 0.1, 20.0),
        disc(DVec3::Z, 2.0, 0.3),
    ]
}

/// Round and flat, with interpolated and with plain normals, convex and not.
fn unlike_bodies() -> [Shape; 4] {
    let mesh = |mesh: Result<crate::geometry::Mesh>| Shape::Mesh(mesh.expect("closed"));
    [
        Shape::Sphere { radius: 1.0 },
        Shape::Box { half: DVec3::new(0.8, 0.6, 1.0) },
        mesh(procedural::bumpy_sphere(1.0, 3, 0.03, 6.0, true)),
        mesh(procedural::torus(0.7, 0.3, [24, 12], false)),
    ]
}

/// Of a path x -> p -> light the walk's own sampling and the connection have the densities T and P p_L J
/// / (phase e^(-sigma d)), relative to U. A technique scores f / D_t for it, D_t being what its code
/// believes to be the sum. So f is kept exactly if the sum of p_t score_t / f is 1.
#[test]
fn weights_sum_to_one() {
    let key = StreamKey::named("weights_sum_to_one (connection)");
    let mut stream = key.pass(0).stream(0, Purpose::Sensor);
    let ray = Ray { origin: DVec3::new(0.3, -0.4, 3.0), dir: -DVec3::Z };
    let mut done = [0u32; 6];
    for body in unlike_bodies() {
        let scene = scene(body, medium(4.0, 0.9, 0.3), unlike_lights(), ray, 1);
        for (index, method) in METHODS.into_iter().enumerate() {
            let estimator = SpecularConnection::new(scene.clone(), method, Roulette::Below(1e-12))
                .expect("a scene for it");
            let mut tries = 0;
            while tries < 60 {
                let light = tries % 4;
                let sample = scene.lights[light].sample(0, stream.draw2());
                let Some((hit, dir, length)) = entering(&scene.shape, sample.wi, ETA, stream.draw2())
                else {
                    continue;
                };
                tries += 1;
                let distance = length * (0.01 + 0.98 * stream.draw());
                let x = hit.point - dir * distance;
                let frame = Frame::about(hit.shading_normal);
                let exit = WalkExit { hit, frame, wo: frame.to_local(-dir) };
                let query = Query::new(x, sample.wi, ETA);
                let patch = patch::SurfacePatch::at(&scene.shape, hit.face, hit.point, hit.normal);
                let Judgement::Root(root) = query.judge(&patch, 1e-9) else { panic!("no root") };
                let is_found = match method {
                    ConnectionMethod::StraightLine {} => continue, // has no density
                    _ => estimator.setup.solver.finds(
                        &scene.shape,
                        &query,
                        (hit.face, hit.point),
                        &mut facet::SolverWork::default(),
                    ),
                };
                let share = estimator.setup.shares[0][light];
                let pdf = sample.pdf;
                let mut scores = Scores::new(Layout::new(&scene));
                let pass = key.pass(1);
                let path = Path { field: &estimator.field, band: 0, index: 0, key: &pass };
                let state = Connected::new(&estimator.setup, pass.stream(0, Purpose::Connection));
                let mut walk = CameraWalk::led(
                    path,
                    &mut scores,
                    state,
                    OneBand,
                    x + DVec3::new(0.01, 0.02, -0.01),
                );
                // The first vertex is another technique's where the method is that of segments.
                walk.lead_to(x + DVec3::new(0.01, -0.01, 0.02), false);
                walk.lead_to(x, true);
                let vertex = WalkVertex { point: x, arrival: walk.ray.dir, walks: 1.0 };
                let departure = Departure { vertex, bands: OneBand, history: walk.history };
                let throughput = walk.throughput;
                let observed = 1 + TransportClass::ALL.len() + light;
                // What the connection scores for the root, if it draws this direction.
                let by_connection = if share > 0.0 && is_found != Some(false) {
                    walk.scores.clear();
                    let is_shared = pdf.is_some() && estimator.setup.is_density_known;
                    let density = share * pdf.unwrap_or(1.0);
                    let drawn = Drawn { light, radiance: sample.radiance, density, is_shared };
                    let found = WeightedRoot { root, weight: 1.0 };
                    vertex::score(&mut walk, &departure, &drawn, &found, sample.wi);
                    walk.scores.observables[observed]
                } else {
                    0.0
                };
                walk.lead_out(&exit);
                walk.scores.clear();
                let by_walk = if pdf.is_some() {
                    walk.score_own_sample(sample.wi);
                    walk.scores.observables[observed]
                } else {
                    0.0
                };
                let phase = HenyeyGreenstein { g: 0.3 }.pdf(vertex.arrival.dot(dir));
                let walked = phase * transmittance(4.0, distance);
                let f = throughput * root.transmittance * ETA * ETA * sample.radiance;
                let of_connection = share * pdf.unwrap_or(1.0) * root.ratio / walked;
                let sum = (of_connection * by_connection + root.transmittance * by_walk) / f;
                assert!(
                    (sum - 1.0).abs() < 1e-12 || by_connection == 0.0 && pdf.is_none(),
                    "{method:?}, light {light}: {sum}, {by_connection} {by_walk} of {f}, {is_found:?}"
                );
                done[index] += u32::from(by_connection > 0.0);
            }
        }
    }
    assert!(done[..5].iter().all(|&count| count > 80), "{done:?}");
}

/// The same at a rough boundary, where the walk's light sampling is a third technique, and parallel light is
/// shared, too.
#[test]
fn weights_with_facets_sum_to_one() {
    let key = StreamKey::named("weights_with_facets_sum_to_one");
    let mut stream = key.pass(0).stream(0, Purpose::Sensor);
    let facets = Microfacets { kind: MicrofacetKind::Ggx, alpha: 0.15 };
    let ray = Ray { origin: DVec3::new(0.3, -0.4, 3.0), dir: -DVec3::Z };
    let methods = [ConnectionMethod::Newton {}, ConnectionMethod::Mnee {}, ConnectionMethod::Sms {}];
    let mut done = [0u32; 3];
    for body in unlike_bodies() {
        let sensor = Sensor::Probe(Probe { ray, paths: 1 });
        let boundary = vec![Boundary::Rough { eta: ETA, facets }];
        let medium = vec![medium(4.0, 0.9, 0.3)];
        let scene =
            Arc::new(Scene { shape: Arc::new(body), boundary, medium, lights: unlike_lights(), sensor });
        for (index, method) in methods.into_iter().enumerate() {
            let estimator = SpecularConnection::new(scene.clone(), method, Roulette::Below(1e-12))
                .expect("a scene for it");
            let mut tries = 0;
            while tries < 80 {
                let light = tries % 4;
                let sample = scene.lights[light].sample(0, stream.draw2());
                let Some(x) = testing::point_inside(&scene.shape, &mut stream) else { continue };
                let m = facets.sample_normal(stream.draw2());
                let query =
                    Query { slopes: DVec2::new(m.x, m.y) / m.z, ..Query::new(x, sample.wi, ETA) };
                let mut work = facet::SolverWork::default();
                let mut roots = Vec::new();
                estimator.setup.solver.roots(&scene.shape, &query, &mut stream, &mut work, &mut roots);
                let Some(WeightedRoot { root, .. }) = roots.first().copied() else { continue };
                let Root { point, face, normal, shading, dir, distance, .. } = root;
                let seen = scene.shape.intersect(&Ray { origin: x, dir }, Side::Inside, None, 1e9);
                let outside = Ray { origin: point, dir: sample.wi };
                if !seen.is_some_and(|hit| hit.point.distance(point) < 1e-9)
                    || scene.shape.occluded(&outside, Some(face))
                {
                    continue;
                }
                tries += 1;
                let frame = Frame::about(shading);
                let hit = Hit { t: distance, point, normal, shading_normal: shading, face };
                let exit = WalkExit { hit, frame, wo: frame.to_local(-dir) };
                let share = estimator.setup.shares[0][light];
                let of_slopes = facets.d(m) * m.z * m.z * m.z * m.z;
                let mut scores = Scores::new(Layout::new(&scene));
                let pass = key.pass(1);
                let path = Path { field: &estimator.field, band: 0, index: 0, key: &pass };
                let state = Connected::new(&estimator.setup, pass.stream(0, Purpose::Connection));
                let start = x + DVec3::new(0.01, 0.02, -0.01);
                let mut walk = CameraWalk::led(path, &mut scores, state, OneBand, start);
                walk.lead_to(x, false);
                let vertex = WalkVertex { point: x, arrival: walk.ray.dir, walks: 1.0 };
                let departure = Departure { vertex, bands: OneBand, history: walk.history };
                let throughput = walk.throughput;
                let observed = 1 + TransportClass::ALL.len() + light;
                let by_connection = if share > 0.0 {
                    walk.scores.clear();
                    let is_shared = estimator.setup.is_density_known;
                    let density = share * sample.pdf.unwrap_or(1.0) * of_slopes;
                    let drawn = Drawn { light, radiance: sample.radiance, density, is_shared };
                    let found = WeightedRoot { root, weight: 1.0 };
                    vertex::score(&mut walk, &departure, &drawn, &found, sample.wi);
                    walk.scores.observables[observed]
                } else {
                    0.0
                };
                let choice = walk.choice(light);
                walk.lead_out(&exit);
                walk.scores.clear();
                walk.score_light_sample(light, sample.wi);
                let by_light = walk.scores.observables[observed];
                let (f_cos, interface) = scene.boundary[0].eval(exit.wo, frame.to_local(sample.wi));
                let mut by_interface = 0.0;
                if sample.pdf.is_some() {
                    walk.scores.clear();
                    walk.score_own_sample(sample.wi);
                    by_interface = walk.scores.observables[observed];
                }
                let phase = HenyeyGreenstein { g: 0.3 }.pdf(vertex.arrival.dot(dir));
                let walked = phase * transmittance(4.0, distance);
                let pdf = sample.pdf.unwrap_or(1.0);
                let f = throughput * f_cos * sample.radiance;
                let of_connection = share * pdf * of_slopes * root.ratio / walked;
                let sum =
                    (of_connection * by_connection + choice * pdf * by_light + interface * by_interface)
                        / f;
                assert!(
                    (sum - 1.0).abs() < 1e-9,
                    "{method:?}, light {light}: {sum}, {by_connection} {by_light} {by_interface} of {f}"
                );
                done[index] += u32::from(by_connection > 0.0);
            }
        }
    }
    assert!(done.iter().all(|&count| count > 150), "{done:?}");
}

/// The camera ray's part inside: where it enters a convex body, its direction there, its length, and
/// what the boundary does to the radiance on its way out.
fn camera_segment(scene: &Scene, ray: &Ray) -> (CameraSegment, f64) {
    let hit = scene.shape.intersect(ray, Side::Outside, None, f64::INFINITY).expect("a hit");
    let ci = -ray.dir.dot(hit.normal);
    let surface = fresnel(ci, ETA);
    let dir = (ray.dir + hit.normal * (ci - ETA * surface.cos_t)) / ETA;
    let inside = Ray { origin: hit.point, dir };
    let leave = scene.shape.intersect(&inside, Side::Inside, Some(hit.face), f64::INFINITY);
    let length = leave.map_or(f64::INFINITY, |hit| hit.t);
    (CameraSegment { origin: hit.point, dir, length }, (1.0 - surface.reflectance) / (ETA * ETA))
}

fn check_single(estimator: &SpecularConnection, expected: f64, test: &str) {
    let (means, scores) = measure(estimator, 30, test);
    let (mean, error) = means[class(TransportClass::Single)];
    println!("{test}: {mean:.6} +- {error:.6}, expected {expected:.6}");
    assert!(
        (mean - expected).abs() < 4.0 * error && error < 0.01 * expected,
        "{test}: {mean} {error} {expected}"
    );
    assert_eq!(scores.anomalies[Anomaly::NonFinite as usize], 0);
    assert_eq!(scores.anomalies[Anomaly::LostRay as usize], 0);
}

const UNBIASED: [ConnectionMethod; 4] = [
    ConnectionMethod::Conic {},
    ConnectionMethod::Newton {},
    ConnectionMethod::Sms {},
    ConnectionMethod::Segments {},
];

/// Half-space and slab against the closed form, four standard errors.
#[test]
fn single_scattering_below_a_plane() {
    let toward = DVec3::new(0.5, 0.3, 0.7).normalize();
    let ray = Ray { origin: DVec3::new(0.0, 0.0, 2.0), dir: DVec3::new(0.3, 0.0, -0.9).normalize() };
    let (sigma_t, albedo, g) = (2.0, 0.8, 0.4);
    let beam = PlaneBeam::new(toward, ETA).expect("from above");
    for (shape, name) in [(Shape::HalfSpace, "half-space"), (Shape::Slab { thickness: 0.4 }, "slab")] {
        let scene = scene(shape, medium(sigma_t, albedo, g), vec![sun(toward, 1.0)], ray, 600);
        let (segment, out) = camera_segment(&scene, &ray);
        let phase = HenyeyGreenstein { g }.pdf(beam.toward.dot(segment.dir));
        let sigma = [sigma_t * albedo, sigma_t];
        let expected = out * beam.single_scattering(segment.dir, segment.length, phase, sigma);
        for method in [
            ConnectionMethod::Conic {},
            ConnectionMethod::Mnee {},
            ConnectionMethod::Sms {},
            ConnectionMethod::Segments {},
        ] {
            let estimator =
                SpecularConnection::new(scene.clone(), method, Roulette::default()).expect("a scene");
            check_single(&estimator, expected, &format!("{name} {method:?}"));
        }
    }
}

/// The faces of a box, each cut in two triangles that turn counter-clockwise seen from outside.
fn cuboid(half: DVec3) -> Vec<[DVec3; 3]> {
    let mut facets = Vec::new();
    for axis in 0..3 {
        for sign in [-1.0, 1.0] {
            let corner = |a: f64, b: f64| {
                let mut p = DVec3::ZERO;
                (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]) = (sign, a, b * sign);
                p * half
            };
            let [a, b, c, d] =
                [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
            facets.extend([[a, b, c], [a, c, d]]);
        }
    }
    facets
}

/// Flat facets of a convex body against the exact sum over prisms; the box against the same with its
/// faces cut in two.
#[test]
fn single_scattering_of_flat_facets() {
    let toward = DVec3::new(0.5, -0.3, 0.6).normalize();
    let (sigma_t, albedo, g) = (1.5, 0.9, -0.3);
    let ball = procedural::icosphere(1.0, 1, false).expect("closed");
    let of_ball = ball.triangles().iter().map(|t| t.map(|i| ball.vertices()[i as usize])).collect();
    let half = DVec3::new(0.8, 0.6, 1.0);
    let bodies: [(&str, Shape, Vec<[DVec3; 3]>); 2] =
        [("ball", Shape::Mesh(ball.clone()), of_ball), ("box", Shape::Box { half }, cuboid(half))];
    for (name, shape, facets) in bodies {
        let ray =
            Ray { origin: DVec3::new(0.3, -0.2, 3.0), dir: DVec3::new(-0.1, 0.15, -1.0).normalize() };
        let scene = scene(shape, medium(sigma_t, albedo, g), vec![sun(toward, 1.0)], ray, 500);
        let (segment, out) = camera_segment(&scene, &ray);
        let phase = |mu: f64| HenyeyGreenstein { g }.pdf(mu);
        let sigma = [sigma_t * albedo, sigma_t];
        let expected =
            out * refracting_polyhedron::single_scattering(&facets, toward, ETA, &segment, phase, sigma);
        for method in UNBIASED {
            let estimator =
                SpecularConnection::new(scene.clone(), method, Roulette::default()).expect("a scene");
            check_single(&estimator, expected, &format!("{name} {method:?}"));
        }
    }
}

/// The smooth sphere against quadrature of the reference along the camera ray.
#[test]
fn single_scattering_of_the_sphere() {
    let (sigma_t, albedo, g) = (1.2, 0.9, 0.2);
    let toward = DVec3::Z;
    let ray = Ray { origin: DVec3::new(0.35, -0.2, 3.0), dir: DVec3::new(0.05, 0.1, -1.0).normalize() };
    let scene = scene(
        Shape::Sphere { radius: 1.0 },
        medium(sigma_t, albedo, g),
        vec![sun(toward, 1.0)],
        ray,
        2000,
    );
    let (segment, out) = camera_segment(&scene, &ray);
    let oracle = LitSphere { radius: 1.0, eta: ETA, reflections: 0 };
    let light = |t: f64| {
        let x = segment.origin + segment.dir * t;
        let rho = DVec3::new(x.x, x.y, 0.0);
        let part = |ray: &crate::reference::refracting_sphere::SphereRay| {
            let across = rho.normalize() * crate::math::sin(ray.turn);
            let w = across + DVec3::Z * cos(ray.turn);
            let phase = HenyeyGreenstein { g }.pdf(w.dot(segment.dir));
            phase * ray.transmittance * ray.magnification * exp(-sigma_t * (t + ray.distance))
        };
        let rays = oracle.rays([rho.length(), x.z]);
        sigma_t * albedo * rays.iter().map(part).sum::<f64>()
    };
    let integral = integrate(light, 0.0, segment.length, 2e-5);
    let expected = out * integral.value;
    println!("{integral:?}");
    assert!(integral.error < 1e-3 * integral.value);
    for method in UNBIASED {
        let estimator =
            SpecularConnection::new(scene.clone(), method, Roulette::default()).expect("a scene");
        check_single(&estimator, expected, &format!("sphere {method:?}"));
    }
    // The biased ones are told apart.
    let straight = ConnectionMethod::StraightLine {};
    let estimator =
        SpecularConnection::new(scene.clone(), straight, Roulette::default()).expect("a scene");
    let (mean, error) = measure(&estimator, 60, "straight line").0[class(TransportClass::Single)];
    println!("straight line: {mean:.6} +- {error:.6}, expected {expected:.6}");
    assert!((mean - expected).abs() > 5.0 * error, "{mean} {error} {expected}");
    assert!(matches!(estimator.bias(), Bias::Biased(_)));
}

/// A small disc is parallel light; all methods that may share it with the walk agree with those that may
/// not.
#[test]
fn a_small_disc_is_parallel_light() {
    let toward = DVec3::new(0.3, -0.5, 0.7);
    let ray = Ray { origin: DVec3::new(0.35, -0.2, 3.0), dir: -DVec3::Z };
    let height = 1e-4;
    let light = disc(toward, height, 1.0 / (2.0 * std::f64::consts::PI * height));
    let sphere = || Shape::Sphere { radius: 1.0 };
    let parallel = scene(sphere(), medium(1.0, 0.9, 0.2), vec![sun(toward, 1.0)], ray, 2000);
    let wide = scene(sphere(), medium(1.0, 0.9, 0.2), vec![light], ray, 2000);
    let single = |scene: &Arc<Scene>, method: ConnectionMethod| {
        let estimator =
            SpecularConnection::new(scene.clone(), method, Roulette::default()).expect("a scene");
        let name = format!("a_small_disc_is_parallel_light {method:?}");
        measure(&estimator, 60, &name).0[class(TransportClass::Single)]
    };
    let (expected, of_expected) = single(&parallel, ConnectionMethod::Conic {});
    for method in &METHODS[..5] {
        let (mean, error) = single(&wide, *method);
        println!("{method:?}: {mean:.6} +- {error:.6}, parallel {expected:.6} +- {of_expected:.6}");
        // The disc's half angle is 0.014: the mean changes by its square.
        let bound = 4.0 * (error * error + of_expected * of_expected).sqrt() + 1e-3 * expected;
        assert!((mean - expected).abs() < bound, "{method:?} {mean} {error}");
    }
}

#[test]
fn what_is_biased_says_so() {
    let ray = Ray { origin: DVec3::Z * 3.0, dir: -DVec3::Z };
    let bias = |light: Light, shape: Shape, method: ConnectionMethod| {
        let scene = scene(shape, medium(1.0, 0.9, 0.2), vec![light], ray, 1);
        let estimator = SpecularConnection::new(scene, method, Roulette::default()).expect("a scene");
        (estimator.bias() != Bias::Unbiased, estimator.notes().len())
    };
    let mesh = || Shape::Mesh(procedural::icosphere(1.0, 1, true).expect("closed"));
    let parallel = METHODS.map(|method| bias(sun(DVec3::Z, 1.0), mesh(), method));
    assert_eq!(parallel, [(false, 1), (true, 1), (true, 1), (false, 1), (false, 1), (true, 1)]);
    let wide = METHODS.map(|method| bias(disc(DVec3::Z, 0.01, 1.0), mesh(), method));
    assert_eq!(wide, [(false, 0), (false, 0), (false, 0), (false, 0), (false, 0), (true, 0)]);
    // An environment is left to the walk, whatever the method.
    let lights = vec![disc(DVec3::Z, 2.0, 1.0), disc(DVec3::Z, 0.1, 1.0)];
    let scene = scene(mesh(), medium(1.0, 0.9, 0.2), lights, ray, 1);
    for method in METHODS {
        let estimator = SpecularConnection::new(scene.clone(), method, Roulette::default());
        assert_eq!(estimator.expect("a scene").setup.shares, [[0.0, 1.0]]);
    }
}
