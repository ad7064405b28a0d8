//! How far path tracing is from the least that its physics costs, and what a mesh adds.
//!
//!   cargo bench -p benches --bench floor
//!   cargo bench -p benches --bench floor -- --csv floor.csv
//!
//! The floor is a loop that does nothing but the walk: unit sphere, smooth boundary, one band, isotropic
//! scattering, a sky of radiance 1, the same roulette, the same random streams and elementary functions as the
//! estimator, in scalar double precision, and no scores by class or region, moments, counters or choice of scene.
//! The last line compares its mean with the estimator's. The other rows are `path` on meshes of the same size.
//!
//! Rounds visit the rows in turn, every other one backwards; the first round is not counted. A figure is the median
//! over the rounds, a ratio the median of the ratios within a round, with the smallest and the largest, in CPU time
//! of the calling thread.

use std::fmt::Write as _;
use std::hint::black_box;
use std::sync::Arc;

use scatterproof::estimators::path::{PathTracer, Roulette};
use scatterproof::estimators::{Cost, Estimator, Layout, Scores};
use scatterproof::geometry::{Ray, Shape, procedural};
use scatterproof::math::{DVec3, ln, sin_cos_turns};
use scatterproof::optics::boundary::Boundary;
use scatterproof::optics::fresnel::fresnel;
use scatterproof::optics::medium::Medium;
use scatterproof::optics::phase::HenyeyGreenstein;
use scatterproof::sampling::stream::{PassKey, Purpose, StreamKey};
use scatterproof::scene::sensor::Probe;
use scatterproof::scene::{Emission, Light, Scene, Sensor};

mod timing;

use timing::{spread, thread_cpu_time};

const ROUNDS: usize = 9;
const PATHS: usize = 20_000;
const ETA: f64 = 1.3;
const ROULETTE: f64 = 0.25;

/// Extinction per radius and albedo.
const MEDIA: [(&str, f64, f64); 2] =
    [("sigma_t 10, albedo 0.99", 10.0, 0.99), ("sigma_t 30, albedo 0.95", 30.0, 0.95)];

/// What a block of paths took, in all.
#[derive(Clone, Copy, Default)]
struct Block {
    seconds: f64,
    events: f64,
    mean: f64,
}

/// Something that is timed: traces `PATHS` paths of the pass.
type Row<'a> = (String, Box<dyn FnMut(&PassKey) -> Block + 'a>);

fn sensor_ray() -> Ray {
    Ray { origin: DVec3::new(0.3, -0.5, 3.0), dir: -DVec3::Z }
}

/// The floor: radiance of one path, and its medium events.
#[inline(never)]
fn floor_path(pass: &PassKey, index: u64, sigma_t: f64, albedo: f64) -> (f64, u64) {
    let mut stream = pass.stream(index, Purpose::Walk);
    let Ray { origin, dir } = sensor_ray();
    let b = origin.dot(dir);
    let mut point = origin + dir * (-b - (b * b - origin.length_squared() + 1.0).sqrt());
    let cos = -point.dot(dir);
    let optics = fresnel(cos, ETA);
    let [_, _, u] = stream.draw3();
    if u < optics.reflectance {
        return (1.0, 0);
    }
    let mut dir = (dir + point * cos) / ETA - point * optics.cos_t;
    let (mut throughput, mut events) = (1.0, 0);
    loop {
        let t = -ln(1.0 - stream.draw()) / sigma_t;
        let end = point + dir * t;
        if end.length_squared() < 1.0 {
            point = end;
            events += 1;
            throughput *= albedo;
            if throughput < ROULETTE {
                if stream.draw() * ROULETTE >= throughput {
                    return (0.0, events);
                }
                throughput = ROULETTE;
            }
            let [u, v] = stream.draw2();
            let z = 1.0 - 2.0 * u;
            let across = (1.0 - z * z).max(0.0).sqrt();
            let (sin, cos) = sin_cos_turns(v);
            dir = DVec3::new(across * cos, across * sin, z);
            continue;
        }
        let b = point.dot(dir);
        point += dir * (-b + (b * b - point.length_squared() + 1.0).sqrt());
        let cos = point.dot(dir);
        let [_, _, u] = stream.draw3();
        if u >= fresnel(cos, 1.0 / ETA).reflectance {
            return (throughput, events);
        }
        dir -= point * (2.0 * cos);
    }
}

fn floor<'a>(sigma_t: f64, albedo: f64) -> Row<'a> {
    let run = move |pass: &PassKey| {
        let mut block = Block::default();
        let start = thread_cpu_time();
        for index in 0..PATHS as u64 {
            let (value, events) = floor_path(pass, index, sigma_t, albedo);
            block.mean += value / PATHS as f64;
            block.events += events as f64;
        }
        block.seconds = (thread_cpu_time() - start).as_secs_f64();
        black_box(block)
    };
    ("floor".into(), Box::new(run))
}

fn estimator<'a>(name: &str, shape: Shape, sigma_t: f64, albedo: f64) -> Row<'a> {
    let phase = HenyeyGreenstein { g: 0.0 };
    let frame = scatterproof::math::Frame::about(DVec3::Z);
    let scene = Arc::new(Scene {
        shape: Arc::new(shape),
        boundary: vec![Boundary::Smooth { eta: ETA }],
        medium: vec![Medium { sigma_t, albedo, phase, emission: 0.0 }],
        lights: vec![Light {
            name: "sky".into(),
            emission: Emission::Cap { frame, height: 2.0, radiance: vec![1.0] },
        }],
        sensor: Sensor::Probe(Probe { ray: sensor_ray(), paths: PATHS }),
    });
    let tracer =
        PathTracer::new(scene.clone(), Roulette::Below(ROULETTE)).expect("a scene that it serves");
    let mut scores = Scores::new(Layout::new(&scene));
    let run = move |pass: &PassKey| {
        scores.clear();
        scores.cost.fill(0);
        let start = thread_cpu_time();
        tracer.pass(&[0], pass, &mut scores);
        let seconds = (thread_cpu_time() - start).as_secs_f64();
        Block {
            seconds,
            events: scores.cost[Cost::MediumEvents as usize] as f64,
            mean: scores.observables[0],
        }
    };
    (name.into(), Box::new(run))
}

fn lumpy(subdivisions: u32) -> (String, Shape) {
    let triangles = 20 * 4usize.pow(subdivisions);
    let mesh = procedural::lumpy_sphere(1.0, subdivisions, 0.25, false).expect("a closed mesh");
    (format!("path, {triangles} triangles"), Shape::Mesh(mesh))
}

/// Mean and its standard error.
fn mean_and_error(values: impl ExactSizeIterator<Item = f64> + Clone) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.clone().sum::<f64>() / n;
    let squares: f64 = values.map(|value| (value - mean) * (value - mean)).sum();
    (mean, (squares / (n * (n - 1.0))).sqrt())
}

fn main() {
    let words: Vec<String> = std::env::args().collect();
    if words.iter().any(|word| word == "--test") {
        return; // `cargo test --benches` only builds it
    }
    let csv = words.iter().position(|word| word == "--csv").and_then(|at| words.get(at + 1));
    let mut table = String::from(
        "medium,row,ns_per_path,ns_per_event,over_floor,over_floor_low,over_floor_high,mean\n",
    );
    for (medium, sigma_t, albedo) in MEDIA {
        let mut rows = vec![
            floor(sigma_t, albedo),
            estimator("path, sphere", Shape::Sphere { radius: 1.0 }, sigma_t, albedo),
        ];
        for subdivisions in [5, 6, 7, 8] {
            let (name, shape) = lumpy(subdivisions);
            rows.push(estimator(&name, shape, sigma_t, albedo));
        }
        let blocks = rounds(&mut rows);
        println!(
            "{medium}\n  {:24} {:>9} {:>9} {:>20} {:>10}",
            "", "ns/path", "ns/event", "over the floor", "mean"
        );
        for (at, (name, _)) in rows.iter().enumerate() {
            let of = |what: &dyn Fn(&Block, &Block) -> f64| {
                spread(blocks.iter().map(|round| what(&round[at], &round[0])).collect())
            };
            let [per_path, ..] = of(&|block, _| block.seconds / PATHS as f64 * 1e9);
            let [per_event, ..] = of(&|block, _| block.seconds / block.events * 1e9);
            // A path on another body has other events: time for each, but for the body that the floor has.
            let [ratio, low, high] =
                of(&|block, floor| (block.seconds / block.events) / (floor.seconds / floor.events));
            let mean = mean_and_error(blocks.iter().map(|round| round[at].mean)).0;
            let ratios = format!("{ratio:.2} [{low:.2}, {high:.2}]");
            println!("  {name:24} {per_path:9.0} {per_event:9.1} {ratios:>20} {mean:10.5}");
            writeln!(table, "\"{medium}\",\"{name}\",{per_path:.1},{per_event:.2},{ratio:.3},{low:.3},{high:.3},{mean:.6}").expect("a string");
        }
        let (difference, error) =
            mean_and_error(blocks.iter().map(|round| round[1].mean - round[0].mean));
        println!("  mean of `path` on the sphere less the floor's: {difference:.1e} +- {error:.1e}\n");
    }
    if let Some(path) = csv {
        let path = std::path::Path::new(path);
        path.parent().map(std::fs::create_dir_all).transpose().expect("a folder for the table");
        std::fs::write(path, table).expect("the table");
    }
}

fn rounds(rows: &mut [Row<'_>]) -> Vec<Vec<Block>> {
    let key = StreamKey::named("floor");
    let mut all = Vec::new();
    for round in 0..=ROUNDS {
        let pass = key.pass(round as u64);
        let mut blocks = vec![Block::default(); rows.len()];
        let mut order: Vec<usize> = (0..rows.len()).collect();
        if round % 2 == 1 {
            order.reverse();
        }
        for at in order {
            blocks[at] = rows[at].1(&pass);
        }
        if round > 0 {
            all.push(blocks);
        }
    }
    all
}
