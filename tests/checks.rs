//! `check` finds all that `run` would refuse, each at its place and with what to do; the published schema
//! and the protection of records.

use super::work::{SENSOR, Work, edit, replaced};

const PROBE: &str =
    "sensor.probe = { point_mm = [0.3, 0, 3], toward = [0, 0, -1], paths_per_pass = 16 }";

/// The experiment of a probe with parts replaced, and more behind it.
fn probe(parts: &[(&str, &str)], more: &str) -> String {
    let text = edit(SENSOR, PROBE);
    parts.iter().fold(text, |text, (old, new)| replaced(&text, old, new)) + more
}

/// `check`, `plan` and `run` refuse the text with one finding, which has a caret and holds these words.
#[track_caller]
fn wrong(text: &str, words: &[&str]) {
    let work = Work::with(text);
    for command in ["check x.toml", "plan x.toml --dry", "run x.toml -q"] {
        let ran = work.run(command);
        ran.exits(2).complains_of(words);
        let told = ran.stderr();
        ran.check(told.matches("error: ").count() == 1, "one finding");
        ran.check(told.contains("--> x.toml:") && told.contains("^"), "a place with a caret");
        ran.check(told.contains("help: "), "what to do");
    }
    assert!(!work.path("results").exists(), "bad input leaves nothing behind");
}

#[test]
fn claims_name_what_the_sensor_has() {
    let claim = |words: &str| format!("[[claim]]\nequals = {{ value = 1, source = \"s\", {words} }}\n");
    let unknown = |words: &str| probe(&[], &claim(words));
    wrong(
        &unknown("estimator = \"mis\", class = \"mulitple\""),
        &["unknown class `mulitple`", "did you mean `multiple`?"],
    );
    wrong(
        &unknown("estimator = \"mis\", observable = \"mean\""),
        &["unknown observable `mean`", "known observables of this sensor: `probe`"],
    );
}

#[test]
fn estimators_serve_the_scene() {
    wrong(
        &probe(&[("path = {}", "light_trace = {}")], ""),
        &["estimator `mis`: light_trace cannot serve this sensor", "it serves `flux`"],
    );
    let cloud = "point_cloud = { model = { classical = {} } }";
    wrong(
        &probe(&[("path = {}", cloud)], ""),
        &["estimator `mis`: point_cloud needs a matched or smooth boundary", "object.boundary.smooth"],
    );
}

/// A model's error is no defect of either estimator: that they differ is known before the first ray.
#[test]
fn models_are_not_claimed_to_agree_with_transport() {
    let smooth = "smooth = { eta = 1.3 }";
    let more =
        "[[estimator]]\nname = \"model\"\npoint_cloud = { model = { classical = {} }, samples = 16 }\n";
    let parts = [("rough = { distribution = \"ggx\", alpha = 0.3, eta = 1.3 }", smooth)];
    let claimed = |claim: &str| probe(&parts, &format!("{more}[[claim]]\n{claim}\n"));
    let agree = "agree = { estimators = [\"mis\", \"model\"], detect = 0.1 }";
    wrong(
        &claimed(agree),
        &["`model` estimates", "`mis` estimates light transport", "leave the claim out"],
    );
    for allowed in [
        "differs = { estimators = [\"mis\", \"model\"] }".to_string(),
        format!("expect = \"invalid\"\nbecause = \"different_models\"\n{agree}"),
    ] {
        Work::with(&claimed(&allowed)).run("check x.toml").exits(0);
    }
    let faster = "faster = { candidate = \"model\", baseline = \"mis\", cost = \"cpu\" }";
    wrong(&claimed(faster), &["their means differ by the model's error"]);
}

/// A sensor that misses the body measures 0, which a claim would report as a defect.
#[test]
fn sensors_see_the_body() {
    wrong(
        &probe(&[("[0.3, 0, 3]", "[1.3, 0, 3]")], ""),
        &["the ray passes the body by", "sphere of radius 1 mm about [0, 0, 0] mm"],
    );
    wrong(
        &edit("toward = [0, 0, -1]", "toward = [0, 0, 1]").replace("[0, 0, 3]", "[5, 0, 3]"),
        &["no ray of any pixel meets the body", "aim the sensor at the body"],
    );
    wrong(
        &probe(&[("[0.3, 0, 3]", "[0.3, 0, 0.5]")], ""),
        &["the sensor at [0.3, 0, 0.5] mm is inside or on the body", "move it outside"],
    );
    // A body of a pixel's size between the middles of pixels is seen.
    let small = edit("radius_mm = 1.0", "radius_mm = 0.02");
    Work::with(&small).run("check x.toml").exits(0);
}

#[test]
fn files_are_there() {
    let mesh = edit("sphere = { radius_mm = 1.0 }", "mesh = { path = \"no.obj\", normals = \"flat\" }");
    wrong(&mesh, &["could not read the mesh `no.obj`", "relative to the"]);
    let map = edit("radiance = 0.2", "map = \"~/sky.exr\"");
    wrong(&map, &["could not read the image `~/sky.exr`", "relative to the folder", "`~`"]);
}

#[test]
fn syntax() {
    let open = edit("radius_mm = 1.0 }", "radius_mm = 1.0");
    wrong(&open, &["this `{` is not closed", "x.toml:4:", "end it with `}`"]);
    let list = edit("[1, 2, 4]", "[1, 2, 4");
    wrong(&list, &["this `[` is not closed", "end it with `]`"]);
    wrong(&edit("passes = 100", "passes = 1e2"), &["expected an integer, found `1e2`", "write 100"]);
    let one = edit("[[light]]\nname = \"sky\"\nenvironment = { radiance = 0.2 }\n", "");
    wrong(
        &replaced(&one, "[[light]]", "[light]"),
        &["expected an array, found a table", "write `[[light]]`"],
    );
    wrong(
        &edit("[[light]]\nname = \"sky\"", "[light]\nname = \"sky\""),
        &["`[light]` beside `[[light]]`", "write `[[light]]`"],
    );
    // Brackets in texts and comments are none.
    let text = edit("name = \"x\"", "name = \"x\" # {[\ndescription = \"{[ \\\" {\"");
    Work::with(&text).run("check x.toml").exits(0);
}

#[test]
fn keys_of_sweeps() {
    let sweep = |key: &str| format!("[[sweep]]\nkey = \"{key}\"\nvalues = [0.1, 0.2]\n");
    let named = probe(&[], "");
    Work::with(&(named.clone() + &sweep("light.sun.directional.irradiance")))
        .run("check x.toml")
        .exits(0);
    wrong(
        &(named.clone() + &sweep("light.son.directional.irradiance")),
        &["no `[[light]]` is named `son`", "did you mean `light.sun`?"],
    );
    wrong(
        &(named + &sweep("light.lamp.directional.irradiance")),
        &["by index or name: 0 = `sun`, 1 = `sky`"],
    );
    let rough = "rough = { distribution = \"ggx\", alpha = 0.3, eta = 1.3 }";
    let smooth = probe(&[(rough, "smooth = { eta = 1.3 }")], &sweep("object.boundary.rough.alpha"));
    wrong(&smooth, &["`object.boundary` is `smooth` here: it has no `rough.alpha`", "as a whole"]);
}

/// All files and folders are checked, whatever is wrong with the first; subcommands are suggested.
#[test]
fn all_files_and_folders_are_checked() {
    let work = Work::with(&edit("seed", "sead"));
    work.write("y.toml", &edit("radius_mm", "radius_m"));
    work.write("z.toml", &edit("radiance = 0.2", "map = \"no.exr\""));
    let all = ["`sead`", "`radius_m`", "no.exr"];
    work.run("check z.toml y.toml x.toml").exits(2).complains_of(&all);
    work.run("check .").exits(2).complains_of(&all);
    work.run("run .").exits(2);
    std::fs::create_dir(work.path("empty")).expect("a folder");
    work.run("check empty").exits(2).complains("empty holds neither a record nor experiment files");
    work.run("rnu x.toml").exits(2).complains("run");
}

/// The record of another experiment of the same name stays, unless the user gives it up.
#[test]
fn records_are_not_replaced_silently() {
    let work = Work::with(&edit("passes = 100", "passes = 4"));
    work.run("run x.toml -q").exits(0);
    let before = work.files("results/x/record");
    for command in ["run x.toml -q --set seed=5", "verify x.toml -q --set seed=5"] {
        let ran = work.run(command);
        ran.exits(2).complains_of(&[
            "another experiment",
            "`seed` is 7 there and 5 here",
            "--replace",
            "--out",
        ]);
    }
    assert_eq!(before, work.files("results/x/record"));
    // More passes of the same streams are no other experiment.
    work.run("run x.toml -q --set budget.passes=6").exits(0);
    work.run("run x.toml -q --set seed=5 --out other").exits(0);
    work.run("run x.toml -q --set seed=5 --replace").exits(0);
    assert_ne!(before, work.files("results/x/record"));
}

/// The example of `init` has a name of its own.
#[test]
fn the_example_is_no_shipped_experiment() {
    let work = Work::new();
    work.run("init").exits(0);
    let name = |text: &str| {
        let line = text.lines().find(|line| line.starts_with("name = ")).expect("a name");
        line.split('"').nth(1).expect("a text").to_string()
    };
    let own = name(&work.read("experiment.toml"));
    for file in shipped() {
        let text = std::fs::read_to_string(&file).expect("a file");
        assert_ne!(own, name(&text), "{}", file.display());
    }
}

/// What the scripts of continuous integration ask of experiments is accepted: files, settings, overrides.
#[test]
fn commands_of_the_scripts_are_accepted() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let work = Work::new();
    let mut count = 0;
    for script in ["run", "nightly", "weekly"] {
        let text = std::fs::read_to_string(root.join(".ci").join(script)).expect("a script");
        for line in text.replace("\\\n", " ").lines() {
            let words: Vec<&str> = line.split_whitespace().map(|word| word.trim_matches('"')).collect();
            let Some(start) = words
                .windows(2)
                .position(|two| two[0] == "$program" && ["run", "verify"].contains(&two[1]))
            else {
                continue;
            };
            let words = &words[start + 2..];
            let of = |option: &str| {
                let pairs = words.windows(2).filter(|two| two[0] == option);
                pairs.map(|two| two.join(" ")).collect::<Vec<_>>().join(" ")
            };
            // Without a file it is those that `verify` knows.
            let Some(file) = words.iter().find(|word| word.ends_with(".toml")) else { continue };
            // The script's loop over materials, or the one file.
            let materials = text.lines().find_map(|line| line.strip_prefix("for material in "));
            let files: Vec<String> = match materials.filter(|_| file.contains("$material")) {
                Some(names) => {
                    let names = names.trim_end_matches("; do").split(' ');
                    names.map(|name| file.replace("$material", name)).collect()
                }
                None => vec![file.to_string()],
            };
            for file in files {
                let file = root.join(file);
                let arguments = format!("check {} {} {}", file.display(), of("--setting"), of("--set"));
                work.run(&arguments).exits(0);
                count += 1;
            }
        }
    }
    assert!(count >= 10, "{count} commands");
}

/// All shipped experiments.
fn shipped() -> Vec<std::path::PathBuf> {
    let mut folders =
        vec![std::path::PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/experiments"))];
    let mut files = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "toml") {
                files.push(path);
            }
        }
    }
    assert!(files.len() > 40, "{} experiments", files.len());
    files
}
