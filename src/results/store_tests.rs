//! Every defect that makes a stored record unusable, planted once.

use tempfile::TempDir;

use super::super::sample;
use super::super::timing::TimeSpent;
use super::*;

fn written() -> (TempDir, RecordFolder, Stored) {
    let temp = tempfile::tempdir().expect("a folder");
    let folder = RecordFolder::new(temp.path().join("sample"));
    let Stored { record, arrays, .. } = sample::stored(0.5);
    let stored = folder.write(record, arrays).expect("a written record");
    (temp, folder, stored)
}

fn refused(folder: &RecordFolder, what: &[&str]) {
    let error = folder.read().expect_err("a refusal").to_string();
    assert!(what.iter().all(|w| error.contains(w)), "{error}");
}

/// A report of an earlier record is never left beside a new one, whether or not a report follows.
#[test]
fn views_go_with_their_record() {
    let (_temp, folder, stored) = written();
    let own = ["images/of-mine.png", "notes.txt"];
    // And what a killed report left unfinished.
    let made = [
        "plots/x.svg",
        "tables/x.md",
        "images/000-mis.png",
        "images/.000-mis.exr.7.tmp",
        ".report.md.7.tmp",
    ];
    let views = VIEW_FILES.into_iter().chain(made);
    let views: Vec<&str> = views.collect();
    views.iter().chain(&own).for_each(|name| folder.write_view(name, b"").expect("a file"));
    folder.write(stored.record, stored.arrays).expect("a written record");
    let left = |names: &[&str]| names.iter().filter(|name| folder.root().join(name).exists()).count();
    assert_eq!((left(&views), left(&own)), (0, own.len()));
}

/// Replaces text in a file of the record and, if asked, mends the checksum of record.json.
fn tamper(folder: &RecordFolder, from: &str, to: &str, mend: bool) {
    let path = folder.record_dir().join("record.json");
    let text = fs::read_to_string(&path).expect("a record").replacen(from, to, 1);
    if mend {
        fs::write(folder.record_dir().join("record.json.b3"), hash_hex(text.as_bytes()))
            .expect("a checksum");
    }
    fs::write(&path, text).expect("a record");
}

#[test]
fn reads_back_what_was_written_and_writes_the_same_bytes() {
    let (_temp, folder, stored) = written();
    assert_eq!(folder.read().expect("a record"), stored);
    let path = folder.record_dir().join("record.json");
    let before = fs::read(&path).expect("bytes");
    folder.write(stored.record, stored.arrays).expect("a written record");
    assert_eq!(fs::read(&path).expect("bytes"), before);
    let mut names: Vec<_> =
        fs::read_dir(folder.root()).expect("a folder").map(|e| e.expect("e").file_name()).collect();
    names.sort();
    assert_eq!(names, ["record"]);
}

#[test]
fn observables_are_found_by_name() {
    let (_temp, folder, _) = written();
    let stored = folder.read().expect("a record");
    let batches = stored.batches(&sample::quantity("snee", 1)).expect("batches");
    assert_eq!((batches.len(), batches.iter().map(|b| b.n).sum::<u64>()), (64, sample::PASSES));
    assert!(stored.batches(&sample::quantity("nobody", 1)).is_none());
    assert!(stored.batches(&sample::quantity("snee", 2)).is_none());
}

#[test]
fn nothing_there() {
    let temp = tempfile::tempdir().expect("a folder");
    let folder = RecordFolder::new(temp.path().join("empty"));
    assert!(!folder.exists());
    refused(&folder, &["no record here", "empty"]);
}

#[test]
fn truncated_json() {
    let (_temp, folder, _) = written();
    let path = folder.record_dir().join("record.json");
    let bytes = fs::read(&path).expect("bytes");
    fs::write(&path, &bytes[..bytes.len() / 2]).expect("a write");
    refused(&folder, &["truncated", "record.json"]);
}

#[test]
fn another_version() {
    let (_temp, folder, _) = written();
    tamper(&folder, "\"schema_version\": 4", "\"schema_version\": 7", false);
    refused(&folder, &["schema version 7", "reads 4", "run it again"]);
}

#[test]
fn changed_json() {
    let (_temp, folder, _) = written();
    tamper(&folder, "\"passes\": 256", "\"passes\": 257", false);
    refused(&folder, &["checksum mismatch", "record.json"]);
}

#[test]
fn unknown_key() {
    let (_temp, folder, _) = written();
    tamper(&folder, "\"experiment\":", "\"albdo\": 1, \"experiment\":", true);
    refused(&folder, &["not a record", "albdo"]);
}

#[test]
fn changed_missing_and_truncated_arrays() {
    let (_temp, folder, _) = written();
    let path = folder.record_dir().join(observables_path(0, 0));
    let mut bytes = fs::read(&path).expect("bytes");
    fs::write(&path, &bytes[..bytes.len() - 3]).expect("a write");
    refused(&folder, &["truncated", "000.observables.npy"]);
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    fs::write(&path, &bytes).expect("a write");
    refused(&folder, &["checksum mismatch", "000.observables.npy"]);
    fs::remove_file(&path).expect("a removal");
    refused(&folder, &["could not read the record", "000.observables.npy"]);
}

#[test]
fn a_path_that_leaves_the_folder() {
    let (_temp, folder, _) = written();
    tamper(&folder, "\"cells/000/000.observables.npy\": ", "\"../../secret\": ", true);
    refused(&folder, &["not a path inside the record"]);
}

#[test]
fn will_not_write_what_does_not_fit_or_read_back() {
    let (_temp, folder, stored) = written();
    let refused = |record: &Record, arrays: &Arrays, what: &str| {
        let error = folder.write(record.clone(), arrays.clone()).expect_err("a refusal").to_string();
        assert!(error.contains(what), "{error}");
        assert_eq!(folder.read().expect("the old record"), stored);
        assert!(!folder.root().join(".record.new").exists());
    };
    let mut arrays = stored.arrays.clone();
    arrays.insert(observables_path(0, 0), Array::new(vec![1, 1, 1, 5], vec![0.0; 5]));
    refused(&stored.record, &arrays, "moments of mis");
    let mut record = stored.record.clone();
    record.bands[0].display_rgb[0] = f64::NAN;
    refused(&record, &stored.arrays, "not finite");
}

#[test]
fn a_folder_that_cannot_be_written() {
    let temp = tempfile::tempdir().expect("a folder");
    fs::write(temp.path().join("file"), b"").expect("a file");
    let stored = sample::stored(0.5);
    let folder = RecordFolder::new(temp.path().join("file/sample"));
    let error = folder.write(stored.record, stored.arrays).expect_err("a refusal").to_string();
    assert!(
        error.contains("could not create the results folder") && error.contains("file/sample"),
        "{error}"
    );
}

#[test]
fn a_crash_between_the_renames_loses_nothing() {
    let (_temp, folder, stored) = written();
    fs::rename(folder.record_dir(), folder.aside()).expect("a rename");
    assert!(folder.exists());
    assert_eq!(folder.read().expect("the old record"), stored);
}

#[test]
fn timing_and_provenance() {
    let (_temp, folder, _) = written();
    assert_eq!(folder.read_timing().expect("no timing"), None);
    let mut timing = Timing::default();
    timing.add(
        "smooth",
        "mis",
        TimeSpent { cpu_seconds: 0.1, set_up_seconds: 0.0, wall_seconds: 0.1, passes: 1, paths: 6 },
    );
    folder.write_timing(&timing).expect("a write");
    assert_eq!(folder.read_timing().expect("a timing"), Some(timing));
    let provenance = Provenance::collect(1);
    folder.write_provenance(&provenance).expect("a write");
    assert_eq!(folder.read_provenance().expect("a provenance"), Some(provenance));
    fs::write(folder.root().join("timing.json"), "{").expect("a write");
    assert!(folder.read_timing().expect_err("a refusal").to_string().contains("timing.json"));
}
