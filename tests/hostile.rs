//! Mutated input of every kind: no panic, no signal, no hang, no memory above 1 GiB.
//!
//! Each test is a kind. `SCATTERPROOF_HOSTILE_SECONDS` is its time (10 by default), `SCATTERPROOF_HOSTILE_SEED` another
//! sequence.

use std::fs;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use scatterproof::results::json::hash_hex;

use super::work::{IMAGE, Work, edit};

/// splitmix64: any sequence will do.
struct Chance(u64);

impl Chance {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut x = self.0;
        x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        x ^ (x >> 31)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n.max(1) as u64) as usize
    }

    fn pick<'a>(&mut self, words: &[&'a str]) -> &'a str {
        words[self.below(words.len())]
    }
}

/// What breaks readers of numbers, names and lengths.
const WORDS: [&str; 24] = [
    "-1",
    "0",
    "1e308",
    "1e-308",
    "nan",
    "-inf",
    "4294967296",
    "9223372036854775807",
    "18446744073709551616",
    "\"\"",
    "[]",
    "{}",
    "[[",
    "\u{feff}",
    "\0",
    "\u{202e}",
    "../../x",
    "/dev/zero",
    "\n",
    "\"\"\"",
    ",",
    "f 1 1 1\n",
    "v nan 0 0\n",
    "f -9999999 4294967295 0\n",
];

fn mutated(seed: &[u8], chance: &mut Chance) -> Vec<u8> {
    let mut bytes = seed.to_vec();
    for _ in 0..=chance.below(4) {
        let at = chance.below(bytes.len());
        let to = bytes.len().min(at + 1 + chance.below(40));
        match chance.below(8) {
            _ if bytes.is_empty() => bytes.push(chance.next() as u8),
            0 => bytes[at] ^= 1 << chance.below(8),
            1 => bytes[at] = chance.next() as u8,
            2 => bytes.truncate(at),
            3 => drop(bytes.drain(at..to)),
            4 => {
                let copy = bytes[at..to].to_vec();
                let place = chance.below(bytes.len());
                bytes.splice(place..place, copy);
            }
            5 => drop(bytes.splice(at..to, chance.pick(&WORDS).bytes())),
            6 => {
                // A number for another.
                let is_digit = |b: &u8| b.is_ascii_digit();
                let begin = bytes[at..].iter().position(is_digit).map(|i| at + i);
                let Some(begin) = begin else { continue };
                let end =
                    bytes[begin..].iter().position(|b| !is_digit(b)).map_or(bytes.len(), |i| begin + i);
                drop(bytes.splice(begin..end, chance.pick(&WORDS[..9]).bytes()));
            }
            _ => {
                // Four bytes of a binary header.
                let value = [0, 1, 0x7fff_ffff, u32::MAX, 0x0001_0000][chance.below(5)].to_le_bytes();
                let end = bytes.len().min(at + 4);
                bytes[at..end].copy_from_slice(&value[..end - at]);
            }
        }
    }
    bytes
}

/// A file and a command that reads it.
type Target<'a> = (&'a str, &'a str);

/// Writes mutations of files of one kind and runs a command on each, in at most 1 GiB and 20 s. The targets share the time of
/// the kind.
fn withstand(work: &Work, targets: &[Target<'_>]) {
    let seconds = number("SCATTERPROOF_HOSTILE_SECONDS", 10) as f64;
    let time = Duration::from_secs_f64(seconds / targets.len() as f64);
    targets.iter().for_each(|target| withstands(work, *target, time));
}

fn number(name: &str, default: u64) -> u64 {
    std::env::var(name).map_or(default, |text| text.parse().expect("a whole number"))
}

fn withstands(work: &Work, (name, command): Target<'_>, time: Duration) {
    let first = number("SCATTERPROOF_HOSTILE_SEED", 1);
    // A record is signed, and what is behind the signature is to be read.
    let sign = name.ends_with("record.json");
    let seed = fs::read(work.path(name)).expect("a seed");
    let script = format!("ulimit -v 1048576; exec timeout -s KILL 20 \"$0\" {command}");
    let (begun, mut tried) = (Instant::now(), 0);
    while begun.elapsed() < time {
        let bytes = mutated(&seed, &mut Chance(first << 32 | tried));
        fs::write(work.path(name), &bytes).expect("a mutation");
        if sign {
            let line = format!("{}  record.json\n", hash_hex(&bytes));
            fs::write(work.path(&format!("{name}.b3")), line).expect("a checksum");
        }
        let mut program = Command::new("bash");
        program.args(["-c", &script, env!("CARGO_BIN_EXE_scatterproof")]).current_dir(work.path(""));
        let ran = program.stdin(Stdio::null()).output().expect("bash");
        let code = ran.status.code();
        if !matches!(code, Some(0..=3)) {
            let kept = std::env::temp_dir().join(format!("hostile-{}", name.replace('/', "-")));
            fs::write(&kept, &bytes).expect("kept");
            let said = String::from_utf8_lossy(&ran.stderr);
            panic!("{name}, mutation {tried}: {command}: {code:?}; kept as {}\n{said}", kept.display());
        }
        tried += 1;
    }
    fs::write(work.path(name), seed).expect("the seed again");
    println!("{name}: {tried} mutations");
    assert!(tried > 0);
}

const TABLE: &str = "# rows\nlabel,g,value,error\na,0.1,1.5,0.1\nb,0.2,\"2,5\",0.1\n";

fn with_table() -> String {
    let sweep =
        "[[sweep]]\ncsv = { path = \"t.csv\", columns = { g = \"object.medium.coefficients.g\" } }\n";
    let claims = "[[claim]]\nagree = { estimators = [\"mis\", \"analog\"], detect = 0.9, class = \"each\" }\n\
                  [[claim]]\nname = \"c\"\nequals = { column = \"value\", error_column = \"error\", source = \"none\", detect = 0.5 }\n\
                  [setting.short]\nbudget.passes = 2\n";
    format!("{IMAGE}{sweep}{claims}")
}

#[test]
#[ignore = "minutes; the night runs it"]
fn hostile_experiments_and_tables() {
    let work = Work::with(&with_table());
    work.write("t.csv", TABLE);
    withstand(&work, &[("x.toml", "check x.toml"), ("t.csv", "check x.toml")]);
}

#[test]
#[ignore = "minutes; the night runs it"]
fn hostile_meshes() {
    let shape = "object.shape.sphere = { radius_mm = 1.0 }";
    let mesh = "object.shape.mesh = { path = \"m.obj\", normals = \"interpolated\" }";
    let work = Work::with(&edit(shape, mesh));
    work.write(
        "m.obj",
        "# a tetrahedron\no a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvn 0 0 1\nvt 0 0\ng b\ns off\n\
         f 1 3 2\nf 1//1 2//1 4//1\nf 2/1/1 3/1/1 4/1/1\nf -2 -4 -1\n",
    );
    withstand(&work, &[("m.obj", "check x.toml")]);
}

#[test]
#[ignore = "minutes; the night runs it"]
fn hostile_images() {
    let work = Work::with(&edit("passes = 100", "passes = 4"));
    work.run("run x.toml -q").exits(0);
    let images = work.files("results/x/images");
    let image = images.iter().find(|(name, _)| name.ends_with("mis.exr")).expect("an image").1;
    // `judge` asks for two.
    for name in ["m.exr", "other.exr"] {
        fs::write(work.path(name), image).expect("an image");
    }
    work.write("y.toml", &edit("environment = { radiance = 0.2 }", "environment = { map = \"m.exr\" }"));
    let judge = "judge --reference results/x --estimator mis m.exr other.exr";
    withstand(&work, &[("m.exr", judge), ("m.exr", "check y.toml")]);
}

#[test]
#[ignore = "minutes; the night runs it"]
fn hostile_records() {
    let work = Work::with(&edit("passes = 100", "passes = 4"));
    work.run("run x.toml -q").exits(0);
    let files = [
        "results/x/record/record.json",
        "results/x/record/cells/000/000.observables.npy",
        "results/x/timing.json",
        "results/x/provenance.json",
        "results/x/manifest.json",
    ];
    let targets = files.map(|name| [(name, "verify results/x"), (name, "report results/x")]);
    withstand(&work, targets.as_flattened());
}

#[test]
#[ignore = "minutes; the night runs it"]
fn hostile_states_and_shards() {
    let work = Work::with(&edit("passes = 100", "passes = 4"));
    for index in [1, 2] {
        work.run(&format!("run x.toml -q --shard {index}/2")).exits(0);
    }
    let states = work.files("results/x/shards/1-of-2/state");
    let state = states.keys().find(|name| name.ends_with(".state")).expect("a state");
    let state = format!("results/x/shards/1-of-2/state/{state}");
    let shard = "results/x/shards/1-of-2/shard.json";
    withstand(&work, &[(shard, "merge x.toml --no-report"), (&state, "run x.toml -q --shard 1/2")]);
}
