//! The command line: messages and exit codes for bad input, and the effect of each command.

use super::work::{IMAGE, SENSOR, Work, edit, probe, replaced};

/// `run` and `plan` refuse the experiment with exit code 2 and these words.
#[track_caller]
fn refused(work: &Work, words: &[&str]) {
    for command in ["run x.toml", "plan x.toml --dry", "verify x.toml"] {
        let ran = work.run(command);
        ran.exits(2).check(ran.stdout().is_empty(), "nothing except the error is printed");
        ran.complains_of(words);
    }
    assert!(!work.path("results").exists(), "bad input leaves nothing behind");
}

/// An experiment that `check` refuses already.
#[track_caller]
fn bad(old: &str, new: &str, words: &[&str]) {
    let work = Work::with(&edit(old, new));
    refused(&work, words);
    let ran = work.run("check x.toml");
    ran.exits(2).complains_of(words);
}

/// Every shipped experiment, in every setting: the only error is a scan that has not been fetched.
#[test]
fn shipped_experiments_are_accepted() {
    let work = Work::new();
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/experiments");
    let ran = work.shell(&format!("\"$0\" check $(find '{root}' -name '*.toml')"));
    let is_expected = |line: &str| line.contains("/../meshes/");
    for line in ran.stderr().lines().filter(|line| line.starts_with("error: ")) {
        ran.check(is_expected(line), line);
    }
    ran.check(
        ran.stdout().lines().filter(|line| line.contains(": ok, ")).count() > 40,
        "files are checked",
    );
}

#[test]
fn words_and_types() {
    let help = "did you mean `radius_mm`?";
    bad("{ radius_mm", "{ radius_m", &["unknown key `radius_m`", "x.toml:4:25", help]);
    bad("seed", "sead", &["unknown key `sead`", "x.toml:2:1", "did you mean `seed`?"]);
    bad("budget.passes = 100\n", "", &["missing key `budget`", "Number of passes"]);
    bad(
        "mm = 1.0",
        "mm = \"one\"",
        &["expected a number, found a string", "x.toml:4:37", "Radius, mm."],
    );
    bad("path = {}", "pth = {}", &["unknown key `pth`", "x.toml:17:1", "did you mean `path`?"]);
    bad("ggx", "gxg", &["unknown kind `gxg`", "x.toml:5:42", "did you mean `ggx`?"]);
    bad("seed = 7", "seed =", &["x.toml:2:"]);
    bad("seed = 7", "seed = 7\nseed = 8", &["x.toml:3:1"]);
    bad(
        "name = \"x\"",
        "name = \"../x\"",
        &["`../x` cannot name a folder", "x.toml:1:8", "letters, digits"],
    );
}

#[test]
fn numbers_out_of_range() {
    bad("mm = 1.0", "mm = nan", &["must be a finite number", "x.toml:4:37"]);
    bad("mm = 1.0", "mm = inf", &["must be a finite number", "x.toml:4:37"]);
    bad("mm = 1.0", "mm = 0", &["must be greater than 0, is 0", "x.toml:4:37"]);
    bad("[1, 2, 4]", "[1, -2, 4]", &["must be at least 0, is -2", "x.toml:6:53"]);
    for g in ["1", "-1.0", "3"] {
        bad(
            "g = 0.2",
            &format!("g = {g}"),
            &["must be between -1 and 1, both excluded, is ", "x.toml:6:90"],
        );
    }
    for eta in ["0", "-1.3"] {
        bad("eta = 1.3", &format!("eta = {eta}"), &["must be greater than 0, is ", "x.toml:5:68"]);
    }
    bad("passes = 100", "passes = 1", &["must be at least 2, is 1", "x.toml:8:17"]);
    bad("irradiance = 1.0", "irradiance = -1", &["must be at least 0, is -1", "x.toml:11:50"]);
}

#[test]
fn sweeps_and_bodies_that_cannot_be() {
    let sweep =
        "[[sweep]]\nkey = \"object.shape.sphere.radius_mm\"\nvalues = []\n[[light]]\nname = \"sun\"";
    bad("[[light]]\nname = \"sun\"", sweep, &["empty sweep", "x.toml:11:10"]);
    let half_space = edit("sphere = { radius_mm = 1.0 }", "half_space = {}");
    let work = Work::with(&replaced(&half_space, "0.8, 0.7]", "1, 0.7]"));
    let rule = "a conservative half-space has walks of infinite mean length";
    refused(&work, &[rule, "x.toml:6:69", "band `G` absorbs nothing", "use a slab"]);
}

#[test]
fn several_violations_come_together() {
    let text = replaced(&edit("{ radius_mm", "{ radius_m"), "g = 0.2", "g = 1");
    let text = replaced(&replaced(&text, "eta = 1.3", "eta = -1"), "path = {}", "pth = {}");
    let work = Work::with(&text);
    let words =
        ["unknown key `radius_m`", "x.toml:5:68", "both excluded", "unknown key `pth`", "4 errors"];
    refused(&work, &words);
    work.write("good.toml", IMAGE);
    work.run("check x.toml good.toml x.toml").exits(2).complains("8 errors").says("good.toml: ok");
    // Nothing runs where one file is bad, be it the last.
    work.run("run good.toml x.toml").exits(2).complains("4 errors");
    assert!(!work.path("results").exists());
}

/// Corners of a tetrahedron and its four faces.
const CORNERS: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n";
const FACES: &str = "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";

fn with_mesh(mesh: Option<&str>) -> Work {
    let shape = "mesh = { path = \"body.obj\", normals = \"flat\" }";
    let work = Work::with(&edit("sphere = { radius_mm = 1.0 }", shape));
    mesh.into_iter().for_each(|mesh| work.write("body.obj", mesh));
    work
}

#[test]
fn meshes() {
    let bad = |mesh: Option<&str>, words: &[&str]| {
        let work = with_mesh(mesh);
        refused(&work, &[&["body.obj", "help:"], words].concat());
    };
    bad(None, &["could not read the mesh", "relative to the folder of the experiment file"]);
    bad(Some(&format!("{CORNERS}f 1 3 2\nf 1 2 4\nf 1 4 3\n")), &["3 boundary edges", "close the mesh"]);
    bad(Some(&format!("{CORNERS}{FACES}f 1 2 9\n")), &["out of bounds", "export it again"]);
    bad(Some(CORNERS), &["no triangles"]);
    bad(Some(""), &["no triangles"]);
    bad(Some(&format!("{CORNERS}{FACES}f 1 2 2\n")), &["1 triangle has no area", "triangle 4"]);
    let nan = CORNERS.replace("v 1 0 0", "v nan 0 0");
    bad(Some(&format!("{nan}{FACES}")), &["1 vertex is not finite", "(NaN, 0, 0)"]);
    bad(Some("\u{0}\u{1}\u{2}"), &[]);
    with_mesh(Some(&format!("{CORNERS}{FACES}"))).run("run x.toml -q --set budget.passes=2").exits(0);
}

#[test]
fn sensors_in_bodies_and_too_much_memory() {
    // Inside, and exactly on the surface.
    for point in ["[0, 0, 0.5]", "[0, 0, 1]"] {
        let probe = format!("sensor.probe = {{ point_mm = {point}, toward = [0, 0, -1] }}");
        let work = Work::with(&edit(SENSOR, &probe));
        refused(&work, &["the sensor at [0, 0,", "is inside or on the body", "move it outside"]);
    }
    // Parallel rays start before the body wherever the image plane was put.
    let works = ["[0, 0, 3]", "[0, 0, 0.5]", "[0, 0, -7]"]
        .map(|center| Work::with(&edit("center_mm = [0, 0, 3]", &format!("center_mm = {center}"))));
    let means = works.map(|work| {
        work.run("run x.toml -q --set budget.passes=64").exits(0);
        let summary = std::fs::read_to_string(work.path("results/x/summary.json")).expect("a summary");
        let summary: serde_json::Value = serde_json::from_str(&summary).expect("JSON");
        summary["measurements"][0]["mean"].as_f64().expect("a number")
    });
    assert!(means.iter().all(|mean| *mean > 0.5 * means[0]), "{means:?}");

    // A rough surface without refraction, and the same scene twice.
    let rough = edit("alpha = 0.3, eta = 1.3", "alpha = 0.3, eta = [1.3, 1.0, 1.3]");
    refused(&Work::with(&rough), &["an index other than 1", "object.boundary.matched"]);
    let rows = "[[sweep]]\nkeys = [\"object.medium.coefficients.g\"]\n\
                rows = [{ label = \"a\", values = [0.5] }, { label = \"b\", values = [0.5] }]\n";
    let twice = edit("albedo = [0.9, 0.8, 0.7], g = 0.2", "albedo = [0.9, 0.8, 0.7]") + rows;
    let ran = Work::with(&twice).run("plan x.toml --dry");
    ran.exits(2).complains("cells `a` and `b` are the same scene");

    let explicit: Vec<String> = (0..1024).map(|i| format!("{{ name = \"b{i}\" }}")).collect();
    let bands = format!("bands = {{ explicit = [{}] }}", explicit.join(", "));
    let text = edit("[12, 12]", "[16384, 16384]").replace("bands = { rgb = {} }", &bands);
    let text = text.replace("[1, 2, 4]", "1").replace("[0.9, 0.8, 0.7]", "0.9");
    let work = Work::with(&text);
    let words = ["error: the run would need", "TiB of memory", "lower the sensor's resolution"];
    let ran = work.run("run x.toml");
    ran.exits(2).complains_of(&words);
    let ran = work.run("plan x.toml --dry");
    ran.exits(2).complains_of(&words);
    assert!(!work.path("results").exists());
}

#[test]
fn overrides() {
    let work = Work::with(IMAGE);
    let set = |set: &str| work.run(&format!("check x.toml --set {set}"));
    let ran = set("object.shape.sphere.radius=2");
    ran.exits(2)
        .complains("unknown key `radius`")
        .complains("--set:1:")
        .complains("did you mean `radius_mm`?");
    set("seed").exits(2).complains("needs `key=value`").complains("for example");
    set("seed=-1").exits(2).complains("must be at least 0, is -1").complains("--set:1:");
    set("light.7.name=\"x\"").exits(2).complains("past its end");
    set("seed=[").exits(2).complains("--set:1:");
    let ran = work.run("run x.toml --setting quick");
    ran.exits(2).complains("unknown setting `quick`").complains("there are no settings here");
    work.write("y.toml", &format!("{IMAGE}[setting.quick]\nbudget.passes = 8\n"));
    work.run("check y.toml --setting quik").exits(2).complains("did you mean `quick`?");
    let ran = work.run("plan y.toml --dry --setting quick");
    ran.exits(0).says("8 passes").says("setting");
}

#[test]
fn files_that_are_not_there() {
    let work = Work::new();
    for command in ["run no.toml", "check no.toml", "plan no.toml", "verify no.toml"] {
        work.run(command).exits(2).complains("could not read").complains("no.toml").complains("init");
    }
    work.run("report nowhere").exits(3).complains("nowhere").complains("`scatterproof run` makes one");
    std::fs::create_dir(work.path("empty")).expect("a folder");
    work.run("verify empty")
        .exits(2)
        .complains("empty holds neither")
        .complains("name an experiment file");
    std::fs::write(work.path("binary.toml"), [0xff, 0xfe, 0]).expect("a file");
    let ran = work.run("check binary.toml");
    ran.complains("binary.toml").check([Some(2), Some(3)].contains(&ran.code()), "refused");
}

#[test]
fn usage() {
    let work = Work::with(IMAGE);
    for arguments in ["", "rum x.toml", "run", "run x.toml --treads 2"] {
        let ran = work.run(arguments);
        ran.exits(2).complains("Usage: scatterproof");
    }
    work.run("rum x.toml").complains("'run'");
    work.run("run x.toml --threads 0").exits(2).complains("--threads").complains("0 is not in 1..");
    work.run("--version").exits(0).says(concat!("scatterproof ", env!("CARGO_PKG_VERSION")));
    work.run("--help").exits(0).says("Exit codes: 0 success, 1 a claim failed").says("130 interrupted");
    let commands = ["run", "verify", "report", "plan", "check", "init", "list", "schema", "completions"];
    for command in commands {
        work.run("--help").says(&format!("\n  {command} "));
        let ran = work.run(&format!("{command} --help"));
        ran.exits(0).says(&format!("Usage: scatterproof {command}"));
        for line in ran.stdout().lines().filter(|line| line.trim_start().starts_with("--")) {
            ran.check(line.trim_start().len() < 100 || line.contains("  "), "help lines are readable");
        }
    }
}

#[test]
fn plan_check_list_schema_completions() {
    let work = Work::with(IMAGE);
    let ran = work.run("check x.toml");
    ran.exits(0).says("x.toml: ok, 1 cell, 2 estimators, 3 bands, 0 claims\n");
    let ran = work.run("plan x.toml --dry --set budget.passes=9");
    ran.exits(0).says("object.shape.sphere.radius_mm").says("9 passes").says("--set").says("memory: ");
    ran.says("1 cell, 2 measurements").check(!work.path("results").exists(), "a plan writes nothing");
    work.run("plan x.toml --threads 2").exits(0).says("100 ").says("s on 2 threads");
    // The pilot of a run would take a twentieth of this for each of two measurements, a minute and a half.
    let seconds = IMAGE.replace("passes = 100", "cpu_seconds = 900");
    std::fs::write(work.path("seconds.toml"), seconds).expect("a file");
    let start = std::time::Instant::now();
    work.run("plan seconds.toml --threads 2")
        .exits(0)
        .says("900 CPU seconds each")
        .says("s on 2 threads");
    assert!(start.elapsed().as_secs() < 30, "{:?}", start.elapsed());
    work.run("list").exits(0).says("estimators\n").says("half_space").says("Everything below z = 0.");
    work.run("list estimators").exits(0).says("path").says("roulette");
    let ran = work.run("schema");
    let schema: serde_json::Value = serde_json::from_str(&ran.exits(0).stdout()).expect("JSON");
    assert!(schema["properties"]["object"].is_object(), "{schema:#}");
    assert!(schema["properties"]["sampler"].is_object(), "{schema:#}");
    let ran = work.run("completions bash");
    std::fs::write(work.path("completions"), ran.exits(0).stdout()).expect("a file");
    work.shell("bash -n completions && source ./completions && complete -p scatterproof").exits(0);
}

#[test]
fn init_run_verify_report() {
    let work = Work::new();
    work.run("init").exits(0).says("next: scatterproof run experiment.toml");
    work.run("init").exits(2).complains("experiment.toml already exists").complains("name another file");
    work.run("init no/such/folder.toml").exits(3).complains("no/such/folder.toml");
    let ran = work.run("run experiment.toml --setting quick");
    ran.exits(0).says("report: results/first-sphere/report.html").says("\neta = 1.1  path");
    ran.check(ran.stderr().is_empty(), "no bar where there is no terminal");
    ran.check(!ran.stdout().contains(['\u{1b}', '\r']), "no control characters");

    let views = ["report.html", "report.md", "measurements.csv", "verdicts.csv", "summary.json"];
    let views = views.map(|view| format!("results/first-sphere/{view}"));
    let before = views.each_ref().map(|view| work.read(view));
    let record = work.files("results/first-sphere/record");
    views.iter().for_each(|view| std::fs::remove_file(work.path(view)).expect("removed"));
    work.run("report results/first-sphere").exits(0).says("results/first-sphere/report.html");
    assert_eq!(before, views.each_ref().map(|view| work.read(view)), "the same from the record alone");
    assert_eq!(record, work.files("results/first-sphere/record"), "a report changes no record");

    let ran = work.run("verify experiment.toml --setting quick --junit junit.xml --verbose");
    ran.exits(0).says("verdicts are green");
    assert!(work.read("junit.xml").contains("<testsuite"), "{}", work.read("junit.xml"));
    // A folder is judged as it is; and a claim that is wrong is found.
    work.run("verify results/first-sphere").exits(0);
    let text = work.read("experiment.toml").replace("value = 1.0", "value = 1.5");
    work.write("wrong.toml", &text.replace("\"first-sphere\"", "\"wrong\""));
    work.run("verify wrong.toml -q").exits(1).says("a relative deviation of -3.3e-1");
}

#[test]
fn no_bar_where_there_is_no_terminal() {
    let work = Work::with(&edit(SENSOR, &SENSOR.replace("[12, 12]", "[40, 40]")));
    let ran = work.run("run x.toml --threads 2");
    ran.exits(0).check(ran.stderr().is_empty(), "nothing is drawn");
    ran.check(!ran.stdout().contains(['\u{1b}', '\r']), "no control characters");
}

/// The script that runs published experiments refuses unknown names before it runs anything.
#[test]
fn reproduce_refuses_what_is_not_published() {
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/scripts/reproduce");
    let work = Work::new();
    work.shell(&format!("'{script}' nothing"))
        .exits(2)
        .complains("`nothing` is not published")
        .complains("snee-matrix");
    work.shell(&format!("'{script}' --fast")).exits(2).complains("no option --fast");
    work.shell(&format!("'{script}' --help")).exits(0).says("every array is byte-identical");
}

/// A name is never a path: separators and control characters are refused, and a record's files are
/// numbered.
#[test]
fn names_of_estimators_are_no_paths() {
    for name in ["snee/guided", "a/../../../x", "a\\\\b", "a\\nb"] {
        let named = format!("name = \"{name}\"");
        bad("name = \"mis\"", &named, &["the name ", " contains ", "x.toml:16:8", "leave out"]);
    }
    let work = Work::with(&edit("name = \"mis\"", "name = \"mean, as (published)\""));
    work.run("check x.toml").exits(0);
    work.run("run x.toml -q --set budget.passes=2").exits(0);
    assert!(work.path("results/x/record/cells/000/000.pixels.npy").exists());
    assert!(work.path("results/x/images/000-000.mean-as-published.png").exists());
    assert!(work.path("results/x/images/000-analog.png").exists());
    // Under another name, no picture of the old one remains.
    work.write("x.toml", &edit("name = \"mis\"", "name = \"two\""));
    work.run("run x.toml -q --replace --set budget.passes=2").exits(0);
    assert!(!work.path("results/x/images/000-000.mean-as-published.png").exists());
    assert!(work.path("results/x/images/000-two.exr").exists());
}

/// A scene and samplers in one file: one run, one record, one verdict.
#[test]
fn a_file_may_have_a_scene_and_samplers() {
    let more = "[[sampler]]\nname = \"hg\"\nhenyey_greenstein = { g = 0.5 }\n[[claim]]\nsampler = {}\n\
                [[claim]]\nagree = { estimators = [\"mis\", \"analog\"], detect = 0.9 }\n";
    let text = edit("budget.passes = 100", "budget.passes = 128\nsamples = 20000") + more;
    let work = Work::with(&text);
    let words = "1 cell, 2 estimators, 3 bands, 1 sampler, 20000 draws each, 2 claims";
    work.run("check x.toml").exits(0).says(words);
    work.run("plan x.toml --dry").exits(0).says("2 measurements").says("1 sampler");
    work.run("verify x.toml -q --verbose").says("chi2 coarse").says("agree");
    assert!(work.path("results/x/record/cells/000/001.observables.npy").exists());
    assert!(work.path("results/x/record/samplers/000.coarse.npy").exists());
    let nothing = Work::with("name = \"x\"\n");
    nothing.run("check x.toml").exits(2).complains("nothing is measured").complains("samplers take");
}

/// A reader that has gone, as of `| head`, ends nothing; a full disk is an error.
#[test]
fn standard_output_that_cannot_be_written() {
    let work = Work::with(&format!("{}\n[[claim]]\nreproduces = {{ passes = 16 }}\n", probe()));
    for arguments in ["list", "check x.toml", "plan x.toml --dry", "run x.toml", "verify x.toml"] {
        let full = work.shell(&format!("\"$0\" {arguments} > /dev/full"));
        full.exits(3).complains_of(&["standard output", "No space left on device"]);
        let (reader, writer) = std::io::pipe().expect("a pipe");
        drop(reader);
        let mut command = work.command(arguments);
        let errors = writer.try_clone().expect("the same pipe");
        let status = command.stdout(writer).stderr(errors).status().expect("the program starts");
        assert_eq!(status.code(), Some(0), "{arguments}, and nobody reads");
    }
}
