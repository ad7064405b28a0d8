//! Cost of a query of a point cloud: by the hierarchy, and by visiting every point.
//!
//!   cargo bench -p benches --bench point_cloud
//!
//! For bodies of three materials and two sizes: points built into the hierarchy, nanoseconds for each
//! node or point that a query visits, for each point that the scan rejects, for each BSSRDF evaluated,
//! and how many times as fast the hierarchy is in CPU time, both evaluating a classical dipole in three
//! bands for what they accept. Repeats of the two alternate; the median of the ratios is shown, with the
//! smallest and the largest.

use std::hint::black_box;
use std::time::Duration;

use scatterproof::math::{DVec3, sin_cos_turns};
use scatterproof::optics::bssrdf::{Bssrdf, Entry, Exit, Model, MomentKind, Outgoing};
use scatterproof::optics::materials;
use scatterproof::optics::medium::Medium;
use scatterproof::sampling::stream::{Purpose, Stream, StreamKey};
use scatterproof::sampling::thinning::{
    Accepted, PointTree, ThinningForm, ThinningRule, ThinningWork, scan,
};

const REPEATS: usize = 7;

/// CPU time that the calling thread has used so far.
fn thread_cpu_time() -> Duration {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    Duration::new(now.tv_sec.unsigned_abs(), now.tv_nsec as u32)
}

fn main() {
    if std::env::args().any(|arg| arg == "--test") {
        return; // `cargo test --benches` only builds it
    }
    println!(
        "{:8} {:>4} {:>8} {:>8} {:>9} {:>8} {:>8} {:>9} {:>8}  hierarchy over scan",
        "material",
        "R/mm",
        "points",
        "build/s",
        "accepted",
        "visited",
        "ns/visit",
        "ns/reject",
        "ns/eval"
    );
    for name in ["marble", "skin1", "ketchup"] {
        for radius in [5.0, 20.0] {
            for count in [10_000, 100_000, 1_000_000] {
                row(name, radius, count);
            }
        }
    }
}

struct Bench {
    tree: PointTree,
    rule: ThinningRule,
    models: Vec<Bssrdf>,
    at: Vec<DVec3>,
    stream: Stream,
}

fn row(name: &str, radius: f64, count: usize) {
    let material = materials::find(name).expect("a material");
    let model = Model::Classical { moments: MomentKind::Exact, outgoing: Outgoing::Plain };
    let of = |band: usize| {
        let medium = Medium::new(material.sigma_a[band], material.reduced_sigma_s[band], 0.0);
        model.of(band, 3, &medium, material.eta).expect("a model")
    };
    let models: Vec<Bssrdf> = (0..3).map(of).collect();
    let sigma = models.iter().map(|model| model.sigma_tr).sum::<f64>() / 3.0;
    let points = sphere(count, radius);
    let start = thread_cpu_time();
    let tree = PointTree::new(&points);
    let build = (thread_cpu_time() - start).as_secs_f64();
    let mut bench = Bench {
        tree,
        rule: ThinningRule::new(ThinningForm::Exponential { sigma }),
        models,
        at: sphere((2_000_000 / count).clamp(5, 50), radius),
        stream: StreamKey::named(name).pass(0).stream(0, Purpose::Walk),
    };
    let mut ratios = Vec::new();
    let (mut best, mut work) = ([f64::INFINITY; 3], ThinningWork::default());
    for _ in 0..REPEATS {
        let (tree, done) = bench.time(true, true);
        let (scan, _) = bench.time(false, true);
        let (bare, _) = bench.time(true, false);
        let (bare_scan, _) = bench.time(false, false);
        ratios.push(scan / tree);
        for (best, time) in best.iter_mut().zip([bare, bare_scan, tree - bare]) {
            *best = best.min(time);
        }
        work = done;
    }
    ratios.sort_by(f64::total_cmp);
    let queries = bench.at.len() as f64;
    let [nodes, candidates, accepted] =
        [work.nodes, work.candidates, work.accepted].map(|total| total as f64 / queries);
    println!(
        "{name:8} {radius:4} {count:8} {build:8.3} {accepted:9.0} {:8.0} {:8.1} {:9.2} {:8.1}  {:.2} [{:.2}, {:.2}]",
        nodes + candidates,
        best[0] / (nodes + candidates),
        best[1] / (count as f64 - accepted),
        best[2] / (3.0 * accepted),
        ratios[REPEATS / 2],
        ratios[0],
        ratios[REPEATS - 1]
    );
}

impl Bench {
    /// Time of a query, ns, and the work of all.
    fn time(&mut self, by_tree: bool, evaluate: bool) -> (f64, ThinningWork) {
        let Bench { tree, rule, models, at, stream } = self;
        let mut work = ThinningWork::default();
        let mut sums = [0.0; 3];
        let start = thread_cpu_time();
        for &at in at.iter() {
            let exit = Exit { point: at, normal: DVec3::Z };
            let accept = |accepted: Accepted| {
                if evaluate {
                    let entry =
                        Entry { point: tree.point(accepted.index), normal: DVec3::Z, dir: -DVec3::Z };
                    for (sum, model) in sums.iter_mut().zip(models.iter()) {
                        *sum += model.kernel(&entry, &exit) * accepted.weight;
                    }
                } else {
                    sums[0] += accepted.weight;
                }
            };
            if by_tree {
                tree.thin(at, rule, stream, &mut work, accept);
            } else {
                scan(tree.axes(), 0..tree.len(), at, rule, stream, &mut work, accept);
            }
        }
        black_box(sums);
        ((thread_cpu_time() - start).as_secs_f64() * 1e9 / at.len() as f64, work)
    }
}

/// Points of a sphere by equal steps of height and the golden angle.
fn sphere(count: usize, radius: f64) -> Vec<DVec3> {
    (0..count)
        .map(|k| {
            let z = 1.0 - (2 * k + 1) as f64 / count as f64;
            let (sin, cos) = sin_cos_turns((k as f64 * 0.618_033_988_749_894_9).fract());
            let across = (1.0 - z * z).sqrt();
            radius * DVec3::new(across * cos, across * sin, z)
        })
        .collect()
}
