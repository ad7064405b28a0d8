//! Rays on closed meshes, against Embree where there is one.
//!
//!   cargo bench -p benches --bench rays
//!   cargo bench -p benches --bench rays -- --embree PROGRAM --csv rays.csv MESH...
//!
//! Meshes are a lumpy sphere in three sizes and the files named, with a longest side of 2. Rays are of four kinds: `camera`,
//! parallel from outside; `inside`, from points of the body in all directions; flights of a walk of isotropic scattering with
//! 10 and 50 mean free paths per unit, from one medium vertex to the next or to the boundary. PROGRAM is benches/embree.cpp.
//! It finds the closest triangle in single precision; here the closest crossing from the side of the ray is found in
//! double precision, and most flights end at the distance to the boundary that a grid of the mesh states.
//!
//! Rounds visit both programs in turn, every other one backwards; the first round is not counted. A figure is the median
//! over the rounds, a ratio the median of the ratios within a round, with the smallest and the largest, in CPU time of
//! the calling thread.

use std::fmt::Write as _;
use std::fs;
use std::io::{BufRead as _, BufReader, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use scatterproof::geometry::{Placement, Ray, Shape, Side, load_mesh, procedural};
use scatterproof::math::DVec3;
use scatterproof::sampling::distance::sample_exponential;
use scatterproof::sampling::stream::{Purpose, Stream, StreamKey};
use scatterproof::sampling::warp::square_to_cap;

mod timing;

use timing::{spread, thread_cpu_time};

const ROUNDS: usize = 9;
const RAYS: usize = 1 << 16;

/// A ray, the side on which it travels, and how far.
type Cast = (Ray, Side, f64);

/// Name and rays of a kind.
type Kind = (&'static str, Vec<Cast>);

fn direction(stream: &mut Stream) -> DVec3 {
    square_to_cap(2.0, stream.draw2())
}

fn camera(shape: &Shape, stream: &mut Stream) -> Vec<Cast> {
    let bounds = shape.bounds().expect("a finite body");
    let ray = |_| {
        let [x, y] = stream.draw2().map(|u| bounds.radius * (2.0 * u - 1.0));
        let origin = bounds.center + DVec3::new(x, y, 2.0 * bounds.radius);
        (Ray { origin, dir: -DVec3::Z }, Side::Outside, f64::INFINITY)
    };
    (0..RAYS).map(ray).collect()
}

/// A point in the body.
fn point(shape: &Shape, stream: &mut Stream) -> DVec3 {
    let bounds = shape.bounds().expect("a finite body");
    loop {
        let [x, y, z] = stream.draw3().map(|u| bounds.radius * (2.0 * u - 1.0));
        let point = bounds.center + DVec3::new(x, y, z);
        if shape.contains(point) {
            return point;
        }
    }
}

fn inside(shape: &Shape, stream: &mut Stream) -> Vec<Cast> {
    let ray =
        |_| (Ray { origin: point(shape, stream), dir: direction(stream) }, Side::Inside, f64::INFINITY);
    (0..RAYS).map(ray).collect()
}

/// Flights from medium vertices; where one meets the boundary, the next begins at another point of the body.
fn flights(shape: &Shape, sigma_t: f64, stream: &mut Stream) -> Vec<Cast> {
    let mut origin = point(shape, stream);
    let flight = |_| {
        let ray = Ray { origin, dir: direction(stream) };
        let t = sample_exponential(sigma_t, stream.draw());
        origin = match shape.end_of_flight(&ray, None, t) {
            Some(_) => point(shape, stream),
            None => ray.at(t),
        };
        (ray, Side::Inside, t)
    };
    (0..RAYS).map(flight).collect()
}

fn kinds(shape: &Shape) -> [Kind; 4] {
    let stream = &mut StreamKey::named("rays").pass(0).stream(0, Purpose::Walk);
    [
        ("camera", camera(shape, stream)),
        ("inside", inside(shape, stream)),
        ("flights, 10 per unit", flights(shape, 10.0, stream)),
        ("flights, 50 per unit", flights(shape, 50.0, stream)),
    ]
}

/// Lengths of the rays, infinity where nothing is met.
fn trace(shape: &Shape, rays: &[Cast]) -> Vec<f64> {
    let length = |&(ref ray, side, t): &Cast| {
        let hit = match side {
            Side::Inside if t < f64::INFINITY => shape.end_of_flight(ray, None, t),
            _ => shape.intersect(ray, side, None, t),
        };
        hit.map_or(f64::INFINITY, |hit| hit.t)
    };
    rays.iter().map(length).collect()
}

/// The other program, with its rays.
struct Embree {
    child: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
}

impl Embree {
    fn start(program: &Path, file: &Path) -> Embree {
        let mut child = Command::new(program)
            .arg(file)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("the program of --embree starts");
        let input = child.stdin.take().expect("piped");
        let output = BufReader::new(child.stdout.take().expect("piped"));
        Embree { child, input, output }
    }

    /// CPU seconds of all rays.
    fn pass(&mut self) -> f64 {
        let mut line = String::new();
        writeln!(self.input).expect("the program of --embree reads");
        self.output.read_line(&mut line).expect("the program of --embree answers");
        line.trim().parse().expect("the program of --embree answers with seconds")
    }

    fn stop(mut self) {
        drop(self.input);
        self.child.wait().expect("the program of --embree ends");
    }
}

/// Nanoseconds per ray, round by round, and the lengths that are found here.
struct Rounds {
    ours: Vec<f64>,
    theirs: Vec<f64>,
    lengths: Vec<f64>,
}

fn rounds(shape: &Shape, rays: &[Cast], mut other: Option<&mut Embree>) -> Rounds {
    let mut rounds = Rounds { ours: Vec::new(), theirs: Vec::new(), lengths: Vec::new() };
    for round in 0..=ROUNDS {
        let (mut here, mut of_embree) = (0.0, None);
        let mut turns = [true, false];
        turns.rotate_left(round % 2);
        for is_here in turns {
            if is_here {
                let start = thread_cpu_time();
                rounds.lengths = trace(shape, rays);
                here = (thread_cpu_time() - start).as_secs_f64();
            } else {
                of_embree = other.as_deref_mut().map(Embree::pass);
            }
        }
        if round > 0 {
            let per_ray = 1e9 / rays.len() as f64;
            rounds.ours.push(here * per_ray);
            rounds.theirs.extend(of_embree.map(|seconds| seconds * per_ray));
        }
    }
    rounds
}

fn write_rays(file: &Path, shape: &Shape, rays: &[Cast]) {
    let Shape::Mesh(mesh) = shape else { unreachable!("bodies are meshes") };
    let mut bytes = Vec::new();
    for count in [mesh.vertices().len(), mesh.triangles().len(), rays.len()] {
        bytes.extend((count as u32).to_le_bytes());
    }
    let vector = |v: DVec3| v.to_array().map(|x| (x as f32).to_le_bytes()).concat();
    mesh.vertices().iter().for_each(|&v| bytes.extend(vector(v)));
    mesh.triangles().iter().flatten().for_each(|index| bytes.extend(index.to_le_bytes()));
    for (ray, _, t) in rays {
        bytes.extend(vector(ray.origin));
        bytes.extend(vector(ray.dir));
        bytes.extend((*t as f32).to_le_bytes());
    }
    fs::write(file, bytes).expect("rays in a temporary file");
}

/// Rays for which the two programs disagree: hit or not, or by more than 1e-3 of the unit.
fn disagreements(file: &Path, lengths: &[f64]) -> usize {
    let bytes = fs::read(file.with_extension("rays.t")).expect("lengths of the program of --embree");
    let theirs = bytes.chunks_exact(4).map(|b| f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])));
    // Two infinities are equal, and have no difference.
    let agree = |(&ours, theirs): (&f64, f64)| ours == theirs || (ours - theirs).abs() < 1e-3;
    lengths.iter().zip(theirs).filter(|&pair| !agree(pair)).count()
}

fn bodies(files: &[PathBuf]) -> Vec<(String, Shape)> {
    let lumpy = [5, 6, 8].map(|subdivisions| {
        let mesh = procedural::lumpy_sphere(1.0, subdivisions, 0.25, false).expect("a closed mesh");
        ("lumpy".to_owned(), Shape::Mesh(mesh))
    });
    let placement = Placement { longest_side_mm: Some(2.0), ..Placement::default() };
    let read = files.iter().map(|file| {
        let name = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let mesh = load_mesh(file, &placement, false).unwrap_or_else(|error| panic!("{error}"));
        (name, Shape::Mesh(mesh))
    });
    lumpy.into_iter().chain(read).collect()
}

fn main() {
    let mut words = std::env::args().skip(1);
    let (mut embree, mut csv, mut files) = (None, None, Vec::new());
    while let Some(word) = words.next() {
        match word.as_str() {
            "--test" => return, // `cargo test --benches` only builds it
            "--bench" => {}
            "--embree" => embree = words.next().map(PathBuf::from),
            "--csv" => csv = words.next().map(PathBuf::from),
            _ => files.push(PathBuf::from(word)),
        }
    }
    let folder = std::env::temp_dir().join(format!("rays-{}", std::process::id()));
    fs::create_dir_all(&folder).expect("a temporary folder");
    let mut table = String::from(
        "mesh,triangles,rays,ns_per_ray,embree_ns_per_ray,over_embree,over_embree_low,over_embree_high,disagree\n",
    );
    for (name, shape) in bodies(&files) {
        let Shape::Mesh(mesh) = &shape else { unreachable!("bodies are meshes") };
        let triangles = mesh.triangles().len();
        println!("{name}, {triangles} triangles");
        for (kind, rays) in kinds(&shape) {
            let file = folder.join("cast.rays");
            let mut other = embree.as_deref().map(|program| {
                write_rays(&file, &shape, &rays);
                Embree::start(program, &file)
            });
            let Rounds { ours, theirs, lengths } = rounds(&shape, &rays, other.as_mut());
            let [ns, ..] = spread(ours.clone());
            let mut row = format!("\"{name}\",{triangles},\"{kind}\",{ns:.1}");
            print!("  {kind:24} {ns:7.0} ns");
            if let Some(other) = other {
                other.stop();
                let ratios = ours.iter().zip(&theirs).map(|(ours, theirs)| ours / theirs).collect();
                let ([of_embree, ..], [ratio, low, high]) = (spread(theirs), spread(ratios));
                let disagree = disagreements(&file, &lengths);
                print!(", Embree {of_embree:7.0} ns, ratio {ratio:.2} [{low:.2}, {high:.2}], ");
                print!("{disagree} rays differ");
                write!(row, ",{of_embree:.1},{ratio:.3},{low:.3},{high:.3},{disagree}")
                    .expect("a string");
            } else {
                row.push_str(",,,,,");
            }
            println!();
            table.push_str(&row);
            table.push('\n');
        }
    }
    fs::remove_dir_all(&folder).expect("the temporary folder");
    if let Some(path) = csv {
        path.parent().map(fs::create_dir_all).transpose().expect("a folder for the table");
        fs::write(path, table).expect("the table");
    }
}
