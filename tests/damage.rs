//! Disks that are full, folders that cannot be written, records that were damaged.

use std::fs;

use super::work::{IMAGE, SENSOR, Work, edit, same};

/// An experiment with an image of more than 256 KiB.
fn large() -> String {
    edit(SENSOR, &SENSOR.replace("[12, 12]", "[96, 96]")).replace("passes = 100", "passes = 4")
}

/// Files of which only a part may have been written.
fn unfinished(work: &Work) -> Vec<String> {
    let names = work.files("results").into_keys();
    names.filter(|name| name.contains(".tmp") || name.contains(".record.new")).collect()
}

#[test]
fn a_folder_that_cannot_be_written_is_named() {
    let work = Work::with(IMAGE);
    let ran = work.run("run x.toml --out x.toml/below");
    ran.exits(3).complains("could not create the results folder").complains("x.toml/below/x");
    let ran = work.run("verify x.toml --out x.toml/below");
    ran.exits(3).complains("x.toml/below/x");
    let claim = "[[claim]]\nequals = { value = 1, source = \"none\" }\n";
    let work = Work::with(&format!("{IMAGE}{claim}"));
    let ran = work.run("verify x.toml -q --junit x.toml/junit.xml --set budget.passes=2");
    ran.exits(3).complains("could not write the JUnit file: x.toml/junit.xml");
}

#[test]
fn a_full_disk_costs_nothing_that_was_there() {
    let work = Work::with(&large());
    // Nothing was there: no record, no part of one.
    let ran = work.run_limited(64, "run x.toml -q");
    ran.exits(3).complains("error: could not ").complains("results/x/").complains("File too large");
    assert!(!work.path("results/x/record").exists());
    assert_eq!(unfinished(&work), [""; 0]);
    work.run("report results/x").exits(3).complains("no record here");

    work.run("run x.toml -q").exits(0);
    let earlier = work.record("results");
    // More passes do not fit: the earlier record stays, byte for byte, and can be reported.
    let ran = work.run_limited(64, "run x.toml -q --set budget.passes=6");
    ran.exits(3).complains("File too large");
    same(&work.record("results"), &earlier, "after the failure");
    assert_eq!(unfinished(&work), [""; 0]);
    work.run("report results/x").exits(0);

    work.run("run x.toml -q --set budget.passes=6").exits(0);
    let later = work.record("results");
    assert_ne!(later, earlier);
    work.run("run x.toml -q --set budget.passes=6 --out fresh").exits(0);
    same(&later, &work.record("fresh"), "with and without the failure");
}

/// The state fits on the disk, the record does not: what was run is kept.
#[test]
fn a_disk_that_is_full_for_the_record_alone() {
    let work = Work::with(&edit("passes = 100", "passes = 128"));
    work.run("run x.toml -q --out fresh").exits(0);
    let size = |files: &std::collections::BTreeMap<String, Vec<u8>>, end: &str| {
        files.iter().filter(|(name, _)| name.ends_with(end)).map(|(_, b)| b.len()).max().expect(end)
    };
    // The states are written with room to spare, then the room shrinks.
    work.run("run x.toml -q").exits(0);
    fs::remove_dir_all(work.path("results/x/record")).expect("removed");
    let observables = size(&work.record("fresh"), ".observables.npy");
    let ran = work.run_limited(observables / 1024 / 2, "run x.toml -q");
    ran.exits(3).complains("could not write the record").complains(".npy");
    assert!(!work.path("results/x/record").exists());
    assert_eq!(unfinished(&work), [""; 0]);
    work.run("run x.toml -q").exits(0);
    same(&work.record("results"), &work.record("fresh"), "after the failure");
}

#[test]
fn a_damaged_record_is_refused_and_a_run_replaces_it() {
    let work = Work::with(&edit("passes = 100", "passes = 8"));
    work.run("run x.toml -q").exits(0);
    let whole = work.record("results");
    for (name, bytes) in &whole {
        let path = work.path("results/x/record").join(name);
        let mut middle = bytes.clone();
        middle[bytes.len() / 2] ^= 1;
        let mut last = bytes.clone();
        *last.last_mut().expect("bytes") ^= 1;
        let cut = bytes[..bytes.len() / 2].to_vec();
        for (how, damaged) in [("flipped", middle), ("flipped last", last), ("truncated", cut)] {
            fs::write(&path, damaged).expect("written");
            // A changed line end of the checksum's file is no damage.
            if name.ends_with(".b3") && how == "flipped last" {
                continue;
            }
            for command in ["report results/x", "verify results/x"] {
                let ran = work.run(command);
                let file = name.strip_suffix(".b3").unwrap_or(name);
                ran.exits(3).complains("error: ").complains(file);
                ran.check(!ran.stderr().contains("panicked"), &format!("{how}: a message, not a panic"));
            }
        }
        fs::remove_file(&path).expect("removed");
        let ran = work.run("report results/x");
        ran.exits(3).complains("results/x");
        fs::write(&path, bytes).expect("restored");
    }
    work.run("report results/x").exits(0);

    fs::write(work.path("results/x/record/record.json"), "{").expect("written");
    work.run("run x.toml -q").exits(0);
    same(&work.record("results"), &whole, "made again from the states");
    // The passes of a damaged state are run again.
    for (name, bytes) in work.files("results/x/state") {
        let mut bytes = bytes;
        bytes[100] ^= 1;
        fs::write(work.path("results/x/state").join(name), bytes).expect("written");
    }
    fs::remove_dir_all(work.path("results/x/record")).expect("removed");
    work.run("run x.toml -q").exits(0);
    same(&work.record("results"), &whole, "run again");
}

#[test]
fn a_record_of_another_version_is_refused() {
    let work = Work::with(&edit("passes = 100", "passes = 4"));
    work.run("run x.toml -q").exits(0);
    let path = "results/x/record/record.json";
    let text = work.read(path);
    let at = text.find("\"schema_version\"").expect("a version");
    let digits = at + text[at..].find(|c: char| c.is_ascii_digit()).expect("a number");
    work.write(path, &format!("{}9{}", &text[..digits], &text[digits..]));
    work.run("report results/x").exits(3).complains("schema version 9").complains("run it again");
}
