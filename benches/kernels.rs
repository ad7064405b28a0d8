//! Speed of the kernels and of whole paths, at fixed seeds: every run of a benchmark does the same
//! work, so two builds are compared on equal terms. `cargo bench -p benches --bench kernels -- --quick`
//! for a look, without `--quick` for figures to compare.

use std::f64::consts::PI;
use std::hint::black_box;
use std::sync::Arc;
use std::time::Duration;

use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, Criterion, SamplingMode, Throughput, criterion_group, criterion_main};
use scatterproof::estimators::path::{PathTracer, Roulette};
use scatterproof::estimators::{Estimator, Layout, Scores};
use scatterproof::geometry::{Ray, Shape, Side, procedural};
use scatterproof::math::{DVec3, Frame, cbrt};
use scatterproof::optics::boundary::Boundary;
use scatterproof::optics::fresnel::fresnel;
use scatterproof::optics::medium::Medium;
use scatterproof::optics::microfacet::{MicrofacetKind, Microfacets};
use scatterproof::optics::phase::HenyeyGreenstein;
use scatterproof::sampling::distance::sample_exponential;
use scatterproof::sampling::stream::{PassKey, Purpose, Stream, StreamKey};
use scatterproof::sampling::warp::{square_to_cap, square_to_cosine_hemisphere};
use scatterproof::scene::sensor::Probe;
use scatterproof::scene::{Emission, Light, Scene, Sensor};

/// Inputs of a kernel; one iteration visits all of them.
const INPUTS: usize = 4096;

/// Paths of one iteration.
const PATHS: usize = 256;

fn pass() -> PassKey {
    StreamKey::named("kernels").pass(0)
}

fn stream(index: u64) -> Stream {
    pass().stream(index, Purpose::Walk)
}

/// Times `kernel` over `inputs`, as elements per second.
fn time<I: Copy, O>(
    group: &mut BenchmarkGroup<WallTime>,
    name: &str,
    inputs: &[I],
    kernel: impl Fn(I) -> O,
) {
    group.throughput(Throughput::Elements(inputs.len() as u64));
    group.bench_function(name, |bencher| {
        bencher.iter(|| {
            for &input in inputs {
                black_box(kernel(black_box(input)));
            }
        });
    });
}

fn inputs<I>(index: u64, mut make: impl FnMut(&mut Stream) -> I) -> Vec<I> {
    let mut stream = stream(index);
    (0..INPUTS).map(|_| make(&mut stream)).collect()
}

fn kernels(criterion: &mut Criterion) {
    let group = &mut criterion.benchmark_group("kernel");
    group.sample_size(30);
    group.warm_up_time(Duration::from_millis(300));
    group.measurement_time(Duration::from_millis(1500));
    group.nresamples(10_000);
    sampling(group);
    boundaries(group);
    geometry(group);
}

fn sampling(group: &mut BenchmarkGroup<WallTime>) {
    let indices: Vec<u64> = (0..INPUTS as u64).collect();
    let pass = pass();
    time(group, "stream, 8 draws", &indices, |index| {
        let mut stream = pass.stream(index, Purpose::Walk);
        (0..8).map(|_| stream.draw()).sum::<f64>()
    });
    time(group, "exponential distance", &inputs(1, Stream::draw), |u| sample_exponential(10.0, u));
    let directions = inputs(2, |s| (square_to_cap(2.0, s.draw2()), s.draw2()));
    for g in [0.0, 0.8] {
        let phase = HenyeyGreenstein { g };
        let name = format!("Henyey-Greenstein sample, g {g}");
        time(group, &name, &directions, |(dir, u)| phase.sample(dir, u));
    }
}

fn boundaries(group: &mut BenchmarkGroup<WallTime>) {
    time(group, "Fresnel, from inside", &inputs(3, Stream::draw), |cos| fresnel(cos, 1.0 / 1.3));
    let above = inputs(4, |s| (square_to_cosine_hemisphere(s.draw2()), s.draw3()));
    for (name, kind) in [("GGX", MicrofacetKind::Ggx), ("Beckmann", MicrofacetKind::Beckmann)] {
        let facets = Microfacets { kind, alpha: 0.2 };
        time(group, &format!("{name} visible normal"), &above, |(wo, [a, b, _])| {
            facets.sample_visible(wo, [a, b])
        });
    }
    let rough = rough(0.2);
    let inside: Vec<(DVec3, [f64; 3])> = above.iter().map(|&(wo, u)| (-wo, u)).collect();
    time(group, "rough sample, from outside", &above, |(wo, u)| rough.sample(wo, u));
    time(group, "rough sample, from inside", &inside, |(wo, u)| rough.sample(wo, u));
    let pairs = inputs(5, |s| {
        let [wo, wi] = [s.draw2(), s.draw2()].map(square_to_cosine_hemisphere);
        (wo, wi)
    });
    time(group, "rough eval, reflection", &pairs, |(wo, wi)| rough.eval(wo, wi));
    time(group, "rough eval, refraction", &pairs, |(wo, wi)| rough.eval(wo, -wi));
}

fn geometry(group: &mut BenchmarkGroup<WallTime>) {
    let inside = inputs(6, |s| {
        let radius = 0.85 * cbrt(s.draw());
        let origin = square_to_cap(2.0, s.draw2()) * radius;
        Ray { origin, dir: square_to_cap(2.0, s.draw2()) }
    });
    let sphere = Shape::Sphere { radius: 1.0 };
    time(group, "sphere, from inside", &inside, |ray| {
        sphere.intersect(&ray, Side::Inside, None, f64::INFINITY)
    });
    // 20 * 4^6 = 81920 triangles.
    let mesh = procedural::bumpy_sphere(1.0, 6, 0.1, 6.0, true).expect("the mesh is closed");
    let mesh = Shape::Mesh(mesh);
    let flights: Vec<(Ray, f64)> = inside
        .iter()
        .zip(inputs(7, Stream::draw))
        .map(|(&r, u)| (r, sample_exponential(50.0, u)))
        .collect();
    time(group, "mesh of 82k triangles, flights of mean 0.02 R", &flights, |(ray, t)| {
        mesh.intersect(&ray, Side::Inside, None, t)
    });
    time(group, "mesh of 82k triangles, long rays from inside", &inside, |ray| {
        mesh.intersect(&ray, Side::Inside, None, f64::INFINITY)
    });
}

fn rough(alpha: f64) -> Boundary {
    Boundary::Rough { eta: 1.3, facets: Microfacets { kind: MicrofacetKind::Ggx, alpha } }
}

/// Irradiance 1 on a plane that faces the light, or radiance 1.
fn lights() -> [(&'static str, Emission); 3] {
    let toward = DVec3::new(1.0, 0.5, 1.0).normalize();
    let height = 6.8e-3 / (2.0 * PI);
    // Irradiance of a cap of radiance L: pi sin^2 L, sin^2 = h (2 - h).
    let radiance = 1.0 / (PI * height * (2.0 - height));
    let frame = Frame::about(toward);
    [
        ("directional", Emission::Directional { toward, irradiance: vec![1.0] }),
        ("6.8e-3 sr", Emission::Cap { frame, height, radiance: vec![radiance] }),
        ("environment", Emission::Cap { frame, height: 2.0, radiance: vec![1.0] }),
    ]
}

/// Paths per second on the unit sphere. Smooth with directional is what a path costs that no light can
/// reach: that transport is exactly 0 for `path`.
fn paths(criterion: &mut Criterion) {
    let group = &mut criterion.benchmark_group("path");
    group.sample_size(20);
    group.sampling_mode(SamplingMode::Flat);
    group.warm_up_time(Duration::from_millis(300));
    group.measurement_time(Duration::from_millis(1500));
    group.nresamples(10_000);
    group.throughput(Throughput::Elements(PATHS as u64));
    let boundaries = [
        ("smooth", Boundary::Smooth { eta: 1.3 }),
        ("GGX 0.2", rough(0.2)),
        ("GGX 0.04", rough(0.04)),
        ("matched", Boundary::Matched),
    ];
    for (boundary_name, boundary) in boundaries {
        for (light_name, emission) in lights() {
            let scene = Arc::new(unit_sphere(boundary, emission));
            let tracer =
                PathTracer::new(scene.clone(), Roulette::Below(0.25)).expect("a scene that it serves");
            let mut scores = Scores::new(Layout::new(&scene));
            let key = pass();
            group.bench_function(format!("{boundary_name}, {light_name}"), |bencher| {
                bencher.iter(|| {
                    scores.clear();
                    tracer.pass(&[0], &key, &mut scores);
                    black_box(scores.observables[0])
                });
            });
        }
    }
}

fn unit_sphere(boundary: Boundary, emission: Emission) -> Scene {
    let ray = Ray { origin: DVec3::new(0.3, -0.5, 3.0), dir: -DVec3::Z };
    let phase = HenyeyGreenstein { g: 0.0 };
    Scene {
        shape: Arc::new(Shape::Sphere { radius: 1.0 }),
        boundary: vec![boundary],
        medium: vec![Medium { sigma_t: 10.0, albedo: 0.99, phase, emission: 0.0 }],
        lights: vec![Light { name: "light".into(), emission }],
        sensor: Sensor::Probe(Probe { ray, paths: PATHS }),
    }
}

criterion_group!(benches, kernels, paths);
criterion_main!(benches);
