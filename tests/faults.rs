//! Faults around a run: two processes on one folder, limits, signals, files that are none.

use std::fs::{self, File};
use std::time::{Duration, Instant};

use super::work::{IMAGE, Work, edit, probe, replaced, same};

/// Two runs on one folder, which both have only the record to write: one of them does, and the other says who works
/// there, or comes later and finds it done.
#[test]
fn two_processes_on_one_folder() {
    let work = Work::with(&edit("passes = 100", "passes = 20"));
    work.run("run x.toml -q --threads 1").exits(0);
    let sound = work.record("results");
    let mut refused = 0;
    for _ in 0..12 {
        fs::remove_dir_all(work.path("results/x/record")).expect("removed");
        let both =
            [(); 2].map(|()| work.start("run x.toml -q --threads 1")).map(|program| program.end());
        for ran in &both {
            if ran.code() != Some(0) {
                refused += 1;
                ran.exits(3).complains("results/x: another process works in this folder (process ");
                ran.complains("choose another folder with --out");
            }
        }
        both[0].check(both.iter().any(|ran| ran.code() == Some(0)), "one of them ends well");
        same(&work.record("results"), &sound, "after two runs at once");
    }
    assert!(refused > 0, "the runs were never there at the same time");
}

/// A report is not written beside a run, a verification not either; reading is no fault.
#[test]
fn a_folder_in_which_another_process_works() {
    let claim = "[[claim]]\nagree = { estimators = [\"mis\", \"analog\"], detect = 0.9 }\n";
    let work = Work::with(&format!("{IMAGE}{claim}"));
    work.run("run x.toml -q").exits(0);
    let lock = File::options().write(true).open(work.path("results/x/.lock")).expect("the lock");
    lock.try_lock().expect("nobody works there");
    for command in ["run x.toml -q", "verify x.toml -q", "report results/x"] {
        work.run(command).exits(3).complains("results/x: another process works in this folder");
    }
    for command in ["verify x.toml -q --no-report", "verify results/x", "compare results/x results/x"] {
        let ran = work.run(command);
        ran.check(!ran.stderr().contains("another process"), "reading asks for no lock");
    }
    drop(lock);
    work.run("run x.toml -q").exits(0);
}

/// Readers repair nothing: what a crash within the swap left aside is read where it is.
#[test]
fn a_reader_leaves_an_interrupted_swap_to_the_next_run() {
    let work = Work::with(&edit("passes = 100", "passes = 8"));
    work.run("run x.toml -q").exits(0);
    let sound = work.record("results");
    fs::rename(work.path("results/x/record"), work.path("results/x/.record.old")).expect("a rename");
    work.run("compare results/x results/x").exits(0);
    assert!(!work.path("results/x/record").exists() && work.path("results/x/.record.old").exists());
    work.run("run x.toml -q").exits(0);
    same(&work.record("results"), &sound, "after the next run");
    assert!(!work.path("results/x/.record.old").exists());
}

/// What a crash between record and timing leaves: times of another record are not those of this one.
#[test]
fn timing_of_another_record_is_left_out() {
    let work = Work::with(&edit("passes = 100", "passes = 8"));
    work.run("run x.toml -q").exits(0);
    let earlier = work.read("results/x/timing.json");
    work.run("run x.toml -q --set budget.passes=16").exits(0);
    let table = |name: &str| work.read(&format!("results/x/{name}"));
    assert!(table("tables/cost.csv").contains("CPU seconds"));
    work.write("results/x/timing.json", &earlier);
    work.run("report results/x").exits(0);
    assert!(table("report.md").contains("timing.json is of another"), "a note");
    assert!(!table("tables/cost.csv").contains("CPU seconds"), "no seconds");
    fs::remove_file(work.path("results/x/timing.json")).expect("removed");
    work.run("report results/x").exits(0);
    assert!(!table("report.md").contains("timing.json is of another"));
}

/// Limits of the shell, which schedulers set, are respected before anything runs.
#[test]
fn limits_of_memory_are_stated() {
    let work = Work::with(&edit("[12, 12]", "[900, 900]"));
    let ran = work.shell("ulimit -v 400000; exec \"$0\" run x.toml -q");
    ran.exits(2).complains("the run would need").complains("ulimit -v) are available");
    let ran = work.shell("ulimit -v 400000; exec \"$0\" plan x.toml --dry");
    ran.exits(2).says("ulimit -v)");
}

#[test]
fn a_thread_that_is_refused() {
    let work = Work::with(IMAGE);
    // Each thread reserves 2 MiB for its stack.
    let ran = work.shell("ulimit -v 120000; exec \"$0\" run x.toml -q --threads 300");
    ran.exits(3).complains("could not start a thread (lower --threads").complains(" of 300: ");
    work.run("run x.toml -q --threads 2").exits(0);
}

/// An experiment that is built for seconds: a mesh of five million triangles.
fn heavy() -> String {
    let mesh = "object.shape.lumpy_sphere = { radius_mm = 1.0, subdivisions = 9, amplitude = 0.1, normals = \"flat\" }";
    edit("object.shape.sphere = { radius_mm = 1.0 }", mesh)
}

/// A pass of minutes.
fn long_pass() -> String {
    replaced(&probe(), "paths_per_pass = 64", "paths_per_pass = 1048576")
}

/// Every signal that asks for the end is answered within two seconds, whatever is under way.
#[test]
fn signals_are_answered_everywhere() {
    for (text, signal) in
        [(heavy(), "TERM"), (heavy(), "XCPU"), (long_pass(), "INT"), (long_pass(), "HUP")]
    {
        if signal == "HUP" && ignores_hangup() {
            println!("the tests were started by nohup, and so is the program: SIGHUP is not tried");
            continue;
        }
        let work = Work::with(&text);
        let program = work.start("run x.toml -q --threads 1");
        std::thread::sleep(Duration::from_millis(700));
        program.signal(signal);
        let sent = Instant::now();
        let ran = program.end();
        let took = sent.elapsed();
        ran.exits(130).complains("interrupted: ").complains("the same command resumes");
        ran.check(took < Duration::from_secs(2), &format!("{signal}: {took:?}"));
    }
}

/// Whether this process, and what it starts, ignores SIGHUP.
fn ignores_hangup() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    ignored.is_some_and(|mask| mask.trim().ends_with(['1', '3', '5', '7', '9', 'b', 'd', 'f']))
}

/// `nohup` ignores SIGHUP, and what it starts does, too.
#[test]
fn what_nohup_starts_outlives_its_terminal() {
    let work = Work::with(&edit("passes = 100", "passes = 3000"));
    let script = "trap '' HUP; \"$0\" run x.toml -q --threads 1 & child=$!; sleep 0.3; kill -HUP $child; wait $child";
    work.shell(script).exits(0);
}

#[test]
fn input_that_is_no_regular_file() {
    let shape = "object.shape.sphere = { radius_mm = 1.0 }";
    let mesh = |path: &str| {
        edit(shape, &format!("object.shape.mesh = {{ path = \"{path}\", normals = \"flat\" }}"))
    };
    let map = edit("environment = { radiance = 0.2 }", "environment = { map = \"/dev/zero\" }");
    let sweep = "[[sweep]]\ncsv = { path = \"/dev/zero\", columns = { g = \"object.medium.coefficients.g\" } }\n";
    let table = format!("{}{sweep}", IMAGE);
    for (text, path) in [
        (mesh("/dev/zero"), "/dev/zero"),
        (mesh("pipe"), "pipe"),
        (map, "/dev/zero"),
        (table, "/dev/zero"),
    ] {
        let work = Work::with(&text);
        work.shell("mkfifo pipe").exits(0);
        let ran = work.run("check x.toml");
        ran.check(matches!(ran.code(), Some(2 | 3)), "refused");
        ran.complains("not a regular file").complains(path);
    }
    let work = Work::new();
    work.run("check /dev/zero").exits(2).complains("not a regular file");
}

#[test]
fn names_that_are_too_long_for_files() {
    let long = "a".repeat(250);
    for text in [edit("\"analog\"", &format!("\"{long}\"")), edit("\"x\"", &format!("\"{long}\""))] {
        let ran = Work::with(&text).run("check x.toml");
        ran.exits(2)
            .complains("the name has 250 bytes, and at most 128 are possible")
            .complains("x.toml:");
    }
}

#[test]
fn long_texts_are_shortened_in_plans() {
    let text = format!("description = \"{}\"\n{IMAGE}", "long ".repeat(200_000));
    let ran = Work::with(&text).run("plan x.toml --dry");
    ran.exits(0).says("(1000002 characters)");
}

#[test]
fn a_link_that_leads_nowhere() {
    let work = Work::with(IMAGE);
    work.shell("mkdir results && ln -s nowhere results/x").exits(0);
    let ran = work.run("run x.toml -q");
    ran.exits(3).complains("results/x: could not create the results folder: the link leads nowhere");
}

/// In CPU seconds, which the shell limits.
#[test]
fn many_claims_and_estimators_are_checked_in_seconds() {
    let claim = "[[claim]]\nagree = { estimators = [\"mis\", \"analog\"], detect = 0.2 }\n";
    let estimators: String =
        (0..5000).map(|i| format!("[[estimator]]\nname = \"e{i}\"\npath = {{}}\n")).collect();
    let claims = format!("{}{}", probe(), claim.repeat(20_000));
    for text in [claims.clone(), format!("{}{estimators}", probe())] {
        Work::with(&text).shell("ulimit -t 5; exec \"$0\" check x.toml").exits(0);
    }
    // So are 20,000 mistakes, of which not all are told.
    let wrong = Work::with(&claims.replace("\"analog\"], d", "\"analogue\"], d"));
    let ran = wrong.shell("ulimit -t 5; exec \"$0\" check x.toml");
    ran.exits(2).complains(".. and 19900 more").complains("20000 errors");
}
