//! Instructions of the kernels, counted by Valgrind: the same on a busy machine, so that a change of speed is seen that clocks
//! would hide. A benchmark fails where it takes more than its limit, some 5 % above what was counted.
//!
//!   cargo install gungraun-runner --version 0.20.0
//!   cargo bench -p benches --features instructions --bench instructions
//!
//! Valgrind has AVX2 and not AVX-512: counts are those of the code for AVX2. Instructions are not time: a cache miss costs none,
//! and a vector of four numbers one. After a change that is meant to take more of them, or another compiler, set the limits anew,
//! and say why.

use std::hint::black_box;
use std::sync::Arc;

use gungraun::{
    Callgrind, EventKind, LibraryBenchmarkConfig, library_benchmark, library_benchmark_group, main,
};
use scatterproof::estimators::path::{PathTracer, Roulette};
use scatterproof::estimators::snee::{Snee, SneePreset};
use scatterproof::estimators::{Estimator, Layout, Scores};
use scatterproof::geometry::{Ray, Shape, Side, procedural};
use scatterproof::math::{DVec3, Frame, cbrt};
use scatterproof::optics::boundary::Boundary;
use scatterproof::optics::medium::Medium;
use scatterproof::optics::microfacet::{MicrofacetKind, Microfacets};
use scatterproof::optics::phase::HenyeyGreenstein;
use scatterproof::sampling::distance::sample_exponential;
use scatterproof::sampling::stream::{PassKey, Purpose, Stream, StreamKey};
use scatterproof::sampling::warp::{square_to_cap, square_to_cosine_hemisphere};
use scatterproof::scene::sensor::Probe;
use scatterproof::scene::{Emission, Light, Scene, Sensor};

/// Inputs of a kernel.
const INPUTS: usize = 1024;

/// Paths of an estimator.
const PATHS: usize = 256;

/// Fails above so many instructions.
fn at_most(instructions: u64) -> LibraryBenchmarkConfig {
    let mut config = LibraryBenchmarkConfig::default();
    config.tool(Callgrind::default().hard_limits([(EventKind::Ir, instructions)]));
    config
}

fn pass() -> PassKey {
    StreamKey::named("instructions").pass(0)
}

fn inputs<I>(mut make: impl FnMut(&mut Stream) -> I) -> Vec<I> {
    let mut stream = pass().stream(0, Purpose::Walk);
    (0..INPUTS).map(|_| make(&mut stream)).collect()
}

/// A kernel over all its inputs.
fn all<I: Copy, O>(inputs: &[I], kernel: impl Fn(I) -> O) {
    for &input in inputs {
        black_box(kernel(black_box(input)));
    }
}

fn numbers() -> Vec<f64> {
    inputs(Stream::draw)
}

#[library_benchmark(config = at_most(314_000))]
#[bench::of_eight(pass())]
fn streams(pass: PassKey) {
    for index in 0..INPUTS as u64 {
        let mut stream = pass.stream(index, Purpose::Walk);
        black_box((0..8).map(|_| stream.draw()).sum::<f64>());
    }
}

#[library_benchmark(config = at_most(64_700))]
#[bench::exponential(numbers())]
fn distances(numbers: Vec<f64>) {
    all(&numbers, |u| sample_exponential(10.0, u));
}

fn turns() -> Vec<(DVec3, [f64; 2])> {
    inputs(|s| (square_to_cap(2.0, s.draw2()), s.draw2()))
}

#[library_benchmark(config = at_most(194_000))]
#[bench::forward(turns())]
fn phases(turns: Vec<(DVec3, [f64; 2])>) {
    let phase = HenyeyGreenstein { g: 0.8 };
    all(&turns, |(dir, u)| phase.sample(dir, u));
}

const ROUGH: Boundary =
    Boundary::Rough { eta: 1.3, facets: Microfacets { kind: MicrofacetKind::Ggx, alpha: 0.2 } };

fn from_inside() -> Vec<(DVec3, [f64; 3])> {
    inputs(|s| (-square_to_cosine_hemisphere(s.draw2()), s.draw3()))
}

#[library_benchmark(config = at_most(244_000))]
#[bench::ggx(from_inside())]
fn boundary_samples(from_inside: Vec<(DVec3, [f64; 3])>) {
    all(&from_inside, |(wo, u)| ROUGH.sample(wo, u));
}

fn through() -> Vec<[DVec3; 2]> {
    inputs(|s| {
        let [wo, wi] = [s.draw2(), s.draw2()].map(square_to_cosine_hemisphere);
        [-wo, wi]
    })
}

#[library_benchmark(config = at_most(147_700))]
#[bench::ggx(through())]
fn boundary_densities(through: Vec<[DVec3; 2]>) {
    all(&through, |[wo, wi]| ROUGH.eval(wo, wi));
}

fn sphere() -> Shape {
    Shape::Sphere { radius: 1.0 }
}

/// 20,480 triangles.
fn bumps() -> Shape {
    Shape::Mesh(procedural::bumpy_sphere(1.0, 5, 0.1, 6.0, true).expect("the mesh is closed"))
}

fn rays(shape: Shape) -> (Shape, Vec<(Ray, f64)>) {
    let rays = inputs(|s| {
        let origin = square_to_cap(2.0, s.draw2()) * (0.85 * cbrt(s.draw()));
        (Ray { origin, dir: square_to_cap(2.0, s.draw2()) }, sample_exponential(50.0, s.draw()))
    });
    (shape, rays)
}

#[library_benchmark(config = at_most(177_300))]
#[bench::from_inside(rays(sphere()))]
fn sphere_rays((shape, rays): (Shape, Vec<(Ray, f64)>)) {
    all(&rays, |(ray, _)| shape.intersect(&ray, Side::Inside, None, f64::INFINITY));
}

#[library_benchmark(config = at_most(1_968_000))]
#[bench::from_inside(rays(bumps()))]
fn mesh_rays((shape, rays): (Shape, Vec<(Ray, f64)>)) {
    all(&rays, |(ray, _)| shape.intersect(&ray, Side::Inside, None, f64::INFINITY));
}

#[library_benchmark(config = at_most(126_000))]
#[bench::mean_0_02(rays(bumps()))]
fn mesh_flights((shape, rays): (Shape, Vec<(Ray, f64)>)) {
    all(&rays, |(ray, t)| shape.end_of_flight(&ray, None, t));
}

fn scene(shape: Shape, boundary: Boundary, emission: Emission) -> Arc<Scene> {
    let ray = Ray { origin: DVec3::new(0.3, -0.5, 3.0), dir: -DVec3::Z };
    let phase = HenyeyGreenstein { g: 0.0 };
    Arc::new(Scene {
        shape: Arc::new(shape),
        boundary: vec![boundary],
        medium: vec![Medium { sigma_t: 10.0, albedo: 0.99, phase, emission: 0.0 }],
        lights: vec![Light { name: "light".into(), emission }],
        sensor: Sensor::Probe(Probe { ray, paths: PATHS }),
    })
}

fn sky() -> Emission {
    Emission::Cap { frame: Frame::about(DVec3::Z), height: 2.0, radiance: vec![1.0] }
}

fn disc() -> Emission {
    let frame = Frame::about(DVec3::new(1.0, 0.5, 1.0).normalize());
    Emission::Cap { frame, height: 1e-3, radiance: vec![300.0] }
}

/// An estimator that is ready, and the scores of its pass.
type Ready = (Box<dyn Estimator>, Scores);

fn path(shape: Shape, boundary: Boundary) -> Ready {
    let scene = scene(shape, boundary, sky());
    let scores = Scores::new(Layout::new(&scene));
    let tracer = PathTracer::new(scene, Roulette::Below(0.25)).expect("a scene that it serves");
    tracer.prepare();
    (Box::new(tracer), scores)
}

fn snee(shape: Shape, boundary: Boundary) -> Ready {
    let scene = scene(shape, boundary, disc());
    let scores = Scores::new(Layout::new(&scene));
    let snee = Snee::new(scene, SneePreset::Guided.options()).expect("a scene that it serves");
    snee.prepare();
    (Box::new(snee), scores)
}

const SMOOTH: Boundary = Boundary::Smooth { eta: 1.3 };

#[library_benchmark]
#[bench::path_sphere(args = (path(sphere(), SMOOTH)), config = at_most(2_677_000))]
#[bench::path_rough_sphere(args = (path(sphere(), ROUGH)), config = at_most(3_027_000))]
#[bench::path_mesh(args = (path(bumps(), SMOOTH)), config = at_most(5_680_000))]
#[bench::snee_rough_sphere(args = (snee(sphere(), ROUGH)), config = at_most(13_056_000))]
#[bench::snee_rough_mesh(args = (snee(bumps(), ROUGH)), config = at_most(34_363_000))]
fn traced((estimator, mut scores): Ready) -> Scores {
    estimator.pass(&[0], &pass(), &mut scores);
    scores
}

library_benchmark_group!(
    name = kernels,
    benchmarks = [
        streams,
        distances,
        phases,
        boundary_samples,
        boundary_densities,
        sphere_rays,
        mesh_rays,
        mesh_flights
    ]
);

library_benchmark_group!(name = estimators, benchmarks = [traced]);

main!(library_benchmark_groups = [kernels, estimators]);
