//! `judge` on images of the program itself, made with other seeds, and `compare`; each with planted
//! defects.

use std::collections::BTreeMap;
use std::path::Path;

use scatterproof::results::exr_file::{ExrImage, read_exr, write_parts};

use super::work::{Ran, SENSOR, Work, edit, replaced};

/// A large lamp and a sky through a smooth boundary: light tails. One estimator.
fn scene() -> String {
    let text = edit("budget.passes = 100", "budget.passes = 2048");
    let boundary = "rough = { distribution = \"ggx\", alpha = 0.3, eta = 1.3 }";
    let text = replaced(&text, boundary, "smooth = { eta = 1.3 }");
    let sun = "directional = { toward = [1, 0, 1], irradiance = 1.0 }";
    let lamp = "solid_angle = { toward = [1, 0.7, 0.5], solid_angle_sr = 4, irradiance = 2.0 }";
    let text = replaced(&text, sun, lamp);
    let (head, _) = text.rsplit_once("[[estimator]]").expect("two estimators");
    head.into()
}

/// A record in `results/x`, and images of this many other seeds, `seed-K.exr`.
fn rendered(seeds: u64) -> (Work, String) {
    let work = Work::with(&scene());
    work.run("run x.toml -q").exits(0);
    let mut names = Vec::new();
    for seed in 0..seeds {
        let number = blake3_of(&format!("judging {seed}"));
        let options = format!("-q --set seed={number} --set budget.passes=512 --out s{seed}");
        work.run(&format!("run x.toml {options}")).exits(0);
        let name = format!("seed-{seed}.exr");
        std::fs::rename(work.path(&format!("s{seed}/x/images/000-mis.exr")), work.path(&name))
            .expect("an image");
        names.push(name);
    }
    (work, names.join(" "))
}

/// A seed from a name: no literal that someone liked.
fn blake3_of(name: &str) -> u32 {
    let hash = scatterproof::results::json::hash_bytes(name.as_bytes());
    u32::from_le_bytes([hash[0], hash[1], hash[2], hash[3]]) >> 1
}

#[track_caller]
fn judged(work: &Work, options: &str) -> Ran {
    work.run(&format!("judge --reference results/x {options}"))
}

/// Rewrites an image's R, G and B, pixel by pixel: channel, row, column and value in, value out.
fn altered(work: &Work, from: &str, to: &str, change: impl Fn(usize, usize, usize, f32) -> f32) {
    let image: ExrImage = read_exr(&work.path(from)).expect("an image");
    let plane = |(c, name): (usize, &&str)| {
        let values = image.channels[*name].iter().enumerate();
        let values = values.map(|(i, x)| change(c, i / image.width, i % image.width, *x)).collect();
        (name.to_string(), values)
    };
    let channels = ["R", "G", "B"].iter().enumerate().map(plane).collect();
    let parts = vec![("rgb".to_string(), channels)];
    write_parts(&work.path(to), (image.width, image.height), parts, &[]).expect("a write");
}

/// The same change to every seed; the new names.
fn all_altered(
    work: &Work,
    names: &str,
    prefix: &str,
    change: impl Fn(usize, usize, usize, f32) -> f32,
) -> String {
    let new = names.split(' ').map(|name| {
        let to = format!("{prefix}-{name}");
        altered(work, name, &to, &change);
        to
    });
    new.collect::<Vec<_>>().join(" ")
}

#[test]
fn images_of_other_seeds_agree_and_planted_biases_are_found() {
    let (work, names) = rendered(4);
    let ran = judged(&work, &format!("{names} --independent-pixels --out out --junit j.xml --verbose"));
    ran.exits(0).says("54 of 54 verdicts are green").says("t of pixels").says("squared bias");
    for file in ["judge.exr", "judge.html", "z-R.png", "relative-B.png", "verdicts.csv"] {
        assert!(work.path("out").join(file).is_file(), "{file}");
    }
    assert_eq!(work.read("out/verdicts.csv").lines().count(), 55);
    assert!(work.read("j.xml").contains("tests=\"54\" failures=\"0\" errors=\"0\""));
    let maps = read_exr(&work.path("out/judge.exr")).expect("an image");
    let z = &maps.channels["z"];
    assert_eq!(z.len(), 144);
    assert!(
        z.iter().all(|z| z.abs() < 5.0) && z.iter().any(|z| *z > 0.5) && z.iter().any(|z| *z < -0.5)
    );

    // Seeds as blocks: four of them have three degrees of freedom, and see only what is large.
    judged(&work, &names).exits(3).says("underpowered").says("t of seeds").says("could have missed");
    judged(&work, &format!("{names} --level 0.05 --detect 0.2")).exits(0);
    judged(&work, &format!("{names} --scale 3")).exits(1).says("off by +");

    // A factor on everything, on one tile, and a pattern that no region sees.
    let bias = judged(&work, &format!("{names} --independent-pixels --scale 1.05"));
    bias.exits(1).says("fail     R").says("fail     G").says("fail     B").says("off by +");
    let tile =
        all_altered(
            &work,
            &names,
            "tile",
            |_, row, column, x| {
                if row / 3 == 1 && column / 3 == 2 { 1.4 * x } else { x }
            },
        );
    let ran = judged(&work, &format!("{tile} --independent-pixels"));
    ran.exits(1).says("tile_1_2").check(!ran.stdout().contains("tile_2_1"), "one tile fails");
    let pattern =
        all_altered(
            &work,
            &names,
            "pattern",
            |_, row, column, x| {
                if (row + column) % 2 == 0 { 1.3 * x } else { 0.7 * x }
            },
        );
    let ran = judged(&work, &format!("{pattern} --independent-pixels"));
    ran.exits(1).says("squared bias").check(!ran.stdout().contains("tile_"), "no tile fails");

    // Upside down, this light comes from the other side.
    let mirrored = |from: &str| {
        let image = read_exr(&work.path(from)).expect("an image");
        let planes: BTreeMap<usize, Vec<f32>> =
            (0..3).map(|c| (c, image.channels[["R", "G", "B"][c]].clone())).collect();
        let width = image.width;
        let to = format!("mirror-{from}");
        altered(&work, from, &to, |c, row, column, _| planes[&c][row * width + width - 1 - column]);
        to
    };
    let mirrors: Vec<String> = names.split(' ').map(mirrored).collect();
    let ran = judged(&work, &format!("{} --independent-pixels", mirrors.join(" ")));
    ran.exits(1).says("the images fit far better mirrored left to right");
}

#[test]
fn efficiency_of_the_same_estimator_is_one() {
    let (work, names) = rendered(4);
    let timing: serde_json::Value =
        serde_json::from_str(&work.read("results/x/timing.json")).expect("JSON");
    let cost = timing["cells"].as_object().expect("cells").values().next().expect("a cell");
    let seconds = cost["mis"]["cpu_seconds"].as_f64().expect("seconds") / 4.0;
    let ran = judged(&work, &format!("{names} --independent-pixels --seconds {seconds:?}"));
    ran.exits(0).says("efficiency, band R: variance x CPU seconds").says("95 % interval");
    for line in ran.stdout().lines().filter(|line| line.starts_with("efficiency")) {
        let number = |after: &str| -> f64 {
            let rest = line.split_once(after).expect("words").1;
            rest.split([' ', ',']).next().expect("a word").parse().expect("a number")
        };
        let (low, high) = (number("interval "), number(" to "));
        // A 99.99 % interval is wider than this one by the ratio of the t values: 22.2 / 3.18 at 3 dof.
        let middle = (low * high).sqrt();
        let factor = (high / low).sqrt().powf(7.0);
        assert!(middle < factor && middle * factor > 1.0, "{line}");
    }
    judged(&work, &format!("{names} --independent-pixels --seconds 1 --scale 1.2"))
        .exits(1)
        .says("not compared, because the means were not found equal");
    judged(
        &work,
        "seed-0.exr seed-1.exr --independent-pixels --seconds seed-0.exr=1 --seconds seed-1.exr=2",
    )
    .says("not resolved (2 seeds");
    judged(&work, "seed-0.exr seed-1.exr --seconds seed-0.exr=1 --seconds 3")
        .exits(2)
        .complains("seed-1.exr");
    judged(&work, "seed-0.exr seed-1.exr --seconds none").exits(2).complains("`none`");
}

#[test]
fn bad_images_are_refused() {
    let (work, names) = rendered(2);
    let bad = |options: &str, words: &[&str]| {
        judged(&work, options).exits(2).complains_of(words);
    };
    bad("seed-0.exr", &["one image has no error", "different seeds"]);
    bad("seed-0.exr seed-0.exr", &["seed-0.exr hold the same pixels", "one seed?"]);
    bad(&format!("{names} --cell none"), &["no cell `none`"]);
    bad(&format!("{names} --estimator none"), &["no estimator `none`", "it has mis"]);
    bad(&format!("{names} --class none"), &["class `none`", "surface"]);
    bad(&format!("{names} --channel R=none"), &["no channel `none`", "it has B"]);
    bad(&format!("{names} --channel X=R"), &["band `X`", "R, G, B"]);
    bad(&format!("{names} --level 1"), &["between 0 and 1"]);
    bad(&format!("{names} --scale=-1"), &["above 0"]);
    work.write("text.exr", "no image");
    bad("seed-0.exr text.exr", &["text.exr", "not a usable OpenEXR image"]);
    judged(&work, "seed-0.exr none.exr").exits(3).complains("could not read the image");
    work.run("judge --reference none seed-0.exr seed-1.exr").exits(3).complains("no record here");

    let write = |name: &str, size: (usize, usize), channels: &[&str], value: f32| {
        let plane = |c: &&str| (c.to_string(), vec![value; size.0 * size.1]);
        let parts = vec![("rgb".to_string(), channels.iter().map(plane).collect())];
        write_parts(&work.path(name), size, parts, &[]).expect("a write");
    };
    write("small.exr", (6, 6), &["R", "G", "B"], 1.0);
    bad("seed-0.exr small.exr", &["small.exr has 6 x 6 pixels", "12 x 12"]);
    write("grey.exr", (12, 12), &["Y"], 1.0);
    bad(
        "seed-0.exr grey.exr",
        &["grey.exr has no channel for band `R`", "it has Y", "--channel R=NAME"],
    );
    write("black.exr", (12, 12), &["R", "G", "B"], 0.0);
    std::fs::copy(work.path("black.exr"), work.path("dark.exr")).expect("a copy");
    bad("black.exr dark.exr", &["hold the same pixels, all black", "was anything rendered?"]);
    write("layers.exr", (12, 12), &["a.R", "b.R", "a.G", "a.B"], 1.0);
    bad("seed-0.exr layers.exr", &["both `a.R` and `b.R`", "--channel R=a.R"]);

    // A value that is not a number is no bias and no pass.
    altered(
        &work,
        "seed-1.exr",
        "nan.exr",
        |c, row, column, x| {
            if (c, row, column) == (1, 3, 4) { f32::NAN } else { x }
        },
    );
    let ran = judged(&work, "seed-0.exr nan.exr --independent-pixels --verbose");
    ran.exits(3).says("image 2 holds 1 values that are not finite, the first at row 3, column 4");
    ran.check(!ran.stdout().contains("invalid  R"), "the other bands are judged");

    // What the seeds share is not noise of pixels: the images override the user's assertion.
    let (dim, bright) = ("dim.exr", "bright.exr");
    altered(&work, "seed-0.exr", dim, |_, _, _, x| 0.8 * x);
    altered(&work, "seed-1.exr", bright, |_, _, _, x| 1.25 * x);
    let ran = judged(&work, &format!("{dim} {bright} --independent-pixels"));
    ran.exits(3).says("judge without --independent-pixels");

    // A probe has no pixels.
    work.write("p.toml", &replaced(&scene(), SENSOR, PROBE).replace("name = \"x\"", "name = \"p\""));
    work.run("run p.toml -q --set budget.passes=8").exits(0);
    let ran = work.run(&format!("judge --reference results/p {names}"));
    ran.exits(2).complains("its sensor has no pixels");
}

const PROBE: &str = "sensor.probe = { point_mm = [0, 0, 3], toward = [0, 0, -1], paths_per_pass = 64 }";

#[test]
fn records_are_compared() {
    let text = replaced(&scene(), SENSOR, PROBE);
    let work = Work::with(&text);
    let run = |out: &str, options: &str| {
        work.run(&format!("run x.toml -q --out {out} {options}")).exits(0);
    };
    run("a", "");
    run("b", "--threads 1");
    let ran = work.run("compare a/x b/x");
    ran.exits(0).says("identical: all").check(!ran.stdout().contains("not the same"), "nothing changed");

    let seed = blake3_of("records_are_compared");
    run("seed", &format!("--set seed={seed}"));
    let ran = work.run("compare a/x seed/x -v --junit c.xml --html c.html");
    let page = std::fs::read_to_string(work.path("c.html")).expect("a page");
    assert!(page.contains("comparisons hold") && page.contains("not byte-identical"), "{page}");
    ran.exits(0).says(&format!("seed: 7, then {seed}")).says("welch t").says("99 % power");
    assert!(work.read("c.xml").contains("failures=\"0\""));
    work.run("compare a/x seed/x --detect 1e-4").exits(3).says("underpowered").says("could have missed");

    run("less", "--set budget.passes=256");
    work.run("compare a/x less/x -v").exits(0).says("sum of errors").says("2048 passes, then 256");

    // Half the absorption, and the same boundary.
    run("albedo", "--set object.medium.coefficients.albedo=[0.95,0.9,0.85]");
    let ran = work.run("compare a/x albedo/x");
    ran.exits(1).says("albedo").says("fail").says("off by +");
    let ran = work.run("compare a/x albedo/x --level 1e-300 --max-slowdown 1.01");
    ran.exits(1).says("too slow").says(" per pass grew to 1.");

    run("mine", "--set estimator.0.name=mine");
    work.run("compare a/x mine/x").exits(3).complains("nothing can be compared");
    work.run("compare a/x none").exits(3).complains("no record here");
    work.run("compare a/x").exits(2);
    work.run("compare a/x b/x --level 2").exits(2).complains("between 0 and 1");
}

#[test]
fn the_gate_of_the_example_closes() {
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/ci-gate");
    let readme = std::fs::read_to_string(example.join("README.md")).expect("a page");
    let workflow = std::fs::read_to_string(example.join("workflow.yml")).expect("a workflow");
    let work = Work::new();
    work.write("gate.toml", &std::fs::read_to_string(example.join("gate.toml")).expect("an experiment"));
    let copied = std::process::Command::new("cp")
        .arg("-r")
        .arg(example.join("baseline"))
        .arg(work.path(""))
        .status();
    assert!(copied.expect("cp").success());
    let size: usize = work.files("baseline").values().map(Vec::len).sum();
    assert!(size < 100_000, "{size} bytes of baseline");

    // The page's commands, in its order: three that pass, two of which the last does not.
    let commands: Vec<&str> =
        readme.lines().filter_map(|line| line.strip_prefix("scatterproof ")).collect();
    assert_eq!(commands.len(), 5, "{commands:?}");
    for command in &commands[..3] {
        work.run(command).exits(0);
        let own =
            format!("run: scatterproof {}", command.replace("run gate.toml", "run gate.toml --quiet"));
        assert!(workflow.contains(&own), "workflow.yml has no `{own}`");
    }
    work.run(commands[3]).exits(0);
    work.run(commands[4])
        .exits(1)
        .says("object.medium.coefficients.albedo: 0.95, then 0.94525")
        .says("off by -");
}
