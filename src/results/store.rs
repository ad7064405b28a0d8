//! A record's folder, `results/<experiment>/`:
//!
//! ```text
//! record/record.json              everything except the arrays (see results::record)
//! record/record.json.b3           its hash, as b3sum writes and checks it
//! record/cells/<CELL>/<RUN>.observables.npy, .costs.npy, .pixels.npy, .spread.npy, .guide.npy
//! record/samplers/<NNN>.coarse.npy, .fine.npy, .serial.npy
//! timing.json, provenance.json    beside the record, never byte-identical
//! pictures.json                   pictures that are requested in addition to those of every run
//! ```
//! and the derived views. The record appears whole or not at all.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Component, Path, PathBuf};

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::json::{canonical, hash_hex};
use super::npy::Array;
use super::pictures::Wanted;
use super::record::{EstimatorRun, Quantity, Record, SCHEMA_VERSION};
use super::{atomic, provenance::Provenance, timing::Timing};
use crate::error::{Error, Result};
use crate::input;
use crate::stats::moments::Moments;

/// The manifest's name in a results folder.
pub const MANIFEST: &str = "manifest.json";

/// Files that a report writes beside a record, except pictures.
const VIEW_FOLDERS: [&str; 2] = ["plots", "tables"];
const VIEW_FILES: [&str; 9] = [
    "comparisons.csv",
    MANIFEST,
    "measurements.csv",
    "model_errors.csv",
    "report.html",
    "report.md",
    "report.tex",
    "summary.json",
    "verdicts.csv",
];

/// Arrays by their path relative to the record's folder.
pub type Arrays = BTreeMap<String, Array>;

/// A record with its arrays.
#[derive(Clone, Debug, PartialEq)]
pub struct Stored {
    /// Content of `record.json`.
    pub record: Record,
    /// Arrays of the record.
    pub arrays: Arrays,
    /// Times, if they were measured; they are not part of the record and have no checksum.
    pub timing: Option<Timing>,
    /// True if `timing.json` belongs to another record, as after a crash, and was left out.
    pub has_foreign_timing: bool,
}

/// Path of a run's moments of the observables, relative to the record's folder: `run` is its index
/// among the cell's runs. Files are numbered, so that no name is ever a path.
pub fn observables_path(cell: usize, run: usize) -> String {
    array_path(cell, run, "observables")
}

/// Path of a run's counts of work.
pub fn costs_path(cell: usize, run: usize) -> String {
    array_path(cell, run, "costs")
}

/// Path of a run's pixels.
pub fn pixels_path(cell: usize, run: usize) -> String {
    array_path(cell, run, "pixels")
}

/// Path of the guide of a run's walks.
pub fn guide_path(cell: usize, run: usize) -> String {
    array_path(cell, run, "guide")
}

/// Path of the spread of a run's pixels.
pub fn spread_path(cell: usize, run: usize) -> String {
    array_path(cell, run, "spread")
}

fn array_path(cell: usize, run: usize, what: &str) -> String {
    format!("cells/{cell:03}/{run:03}.{what}.npy")
}

impl Stored {
    /// The run that measured a quantity.
    pub fn run(&self, quantity: &Quantity) -> Option<&EstimatorRun> {
        let cell = self.record.cells.get(quantity.cell)?;
        cell.runs.iter().find(|run| run.estimator == quantity.estimator)
    }

    /// blake3 hash of the checksums of all arrays, hex: equal if all numbers are equal.
    pub fn numbers(&self) -> String {
        hash_hex(canonical(&self.record.checksums).as_bytes())
    }

    /// The moments of every batch of a quantity; nothing where the record does not hold it.
    pub fn batches(&self, quantity: &Quantity) -> Option<Vec<Moments>> {
        let run = self.run(quantity)?;
        let observable = run.observables.iter().position(|o| *o == quantity.observable)?;
        self.moments(run, observable, quantity.band)
    }

    /// The moments of every batch of one observable of a run, both by index.
    pub fn moments(&self, run: &EstimatorRun, observable: usize, band: usize) -> Option<Vec<Moments>> {
        let array = self.arrays.get(&run.moments)?;
        let [batches, observables, bands, 5] = array.shape[..] else { return None };
        if observable >= observables || band >= bands {
            return None;
        }
        let rows = array.data.as_chunks::<5>().0;
        let row = |batch| rows[(batch * observables + observable) * bands + band];
        Some((0..batches).map(|batch| Moments::from_array(row(batch))).collect())
    }

    /// By batch, the moments of the pixels' variance in one band of a run, by index: see
    /// [`super::record::Image::spread`].
    pub fn spread(&self, run: &EstimatorRun, band: usize) -> Option<Vec<Moments>> {
        let array = self.arrays.get(&run.image.as_ref()?.spread)?;
        let [batches, bands, 5] = array.shape[..] else { return None };
        let rows = array.data.as_chunks::<5>().0;
        let row = |batch| Moments::from_array(rows[batch * bands + band]);
        (band < bands).then(|| (0..batches).map(row).collect())
    }

    /// The bins stored at `path`.
    pub fn bins(&self, path: &str) -> Option<Bins<'_>> {
        let array = self.arrays.get(path)?;
        let n = array.data.len() / 3;
        let row = |i: usize| &array.data[i * n..(i + 1) * n];
        (array.shape.first() == Some(&3)).then(|| Bins { observed: row(0), mass: row(1), bound: row(2) })
    }

    /// The first inconsistency of the record, as a sentence.
    fn defect(&self) -> Option<String> {
        let bands = self.record.bands.len();
        for run in self.record.cells.iter().flat_map(|cell| &cell.runs) {
            let shape = self.arrays.get(&run.moments).map(|a| &a.shape[..]);
            if !matches!(shape, Some(&[_, o, b, 5]) if o == run.observables.len() && b == bands) {
                return Some(format!("moments of {} have shape {shape:?}", run.estimator));
            }
            let batches = shape.map(|shape| shape[0]);
            let shape = self.arrays.get(&run.costs).map(|a| &a.shape[..]);
            if !matches!(shape, Some(&[b, c]) if Some(b) == batches && c == run.cost.len()) {
                return Some(format!("costs of {} have shape {shape:?}", run.estimator));
            }
            if let Some(plane) = &run.guide {
                let shape = self.arrays.get(&plane.array).map(|a| &a.shape[..]);
                if !matches!(shape, Some(&[b, rows, columns, 3]) if b == bands && rows * columns > 0) {
                    return Some(format!("what guides {} has shape {shape:?}", run.estimator));
                }
            }
            let Some(image) = &run.image else { continue };
            let shape = self.arrays.get(&image.pixels).map(|a| &a.shape[..]);
            if shape != Some(&[2, image.height, image.width, bands][..]) {
                return Some(format!("pixels of {} have shape {shape:?}", run.estimator));
            }
            let shape = self.arrays.get(&image.spread).map(|a| &a.shape[..]);
            if !matches!(shape, Some(&[_, b, 5]) if b == bands) {
                return Some(format!("the spread of {} has shape {shape:?}", run.estimator));
            }
        }
        let record = &self.record;
        let claims = record.comparisons.iter().map(|comparison| comparison.claim);
        let of_samplers = record.sampler_comparisons.iter().map(|comparison| comparison.claim);
        let stated = record.statements.len();
        if let Some(claim) = claims.chain(of_samplers).find(|claim| *claim >= stated) {
            return Some(format!("comparisons are of claim {claim}, and there are {stated} claims"));
        }
        sampler_defect(record, &self.arrays)
    }
}

/// Bins of a run: one row each of what was counted, masses, bounds.
#[derive(Clone, Copy, Debug)]
pub struct Bins<'a> {
    /// Number of draws, or of pairs, in each bin.
    pub observed: &'a [f64],
    /// Masses, which sum to 1 where the density is one.
    pub mass: &'a [f64],
    /// Bounds of the errors of the masses.
    pub bound: &'a [f64],
}

/// The first inconsistency in the record of a sampler, as a sentence.
fn sampler_defect(record: &Record, arrays: &Arrays) -> Option<String> {
    record.samplers.iter().find_map(|run| {
        let paths = [Some(&run.coarse), run.fine.as_ref(), run.serial.as_ref()];
        let wrong = |array: Option<&Array>| match array.map(|a| &a.shape[..]) {
            Some([3, n]) => *n == 0,
            Some([3, a, b]) => a != b || *a == 0,
            _ => true,
        };
        let bad = paths.into_iter().flatten().find(|path| wrong(arrays.get(*path)))?;
        Some(format!("bins of {} have no usable array at {bad}", run.sampler))
    })
}

/// The folder of one experiment's results.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordFolder {
    root: PathBuf,
}

impl RecordFolder {
    /// The folder `results/<experiment>`; nothing is read or created yet.
    pub fn new(root: impl Into<PathBuf>) -> RecordFolder {
        RecordFolder { root: root.into() }
    }

    /// The folder itself.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Is there a record?
    pub fn exists(&self) -> bool {
        self.record_dir().join("record.json").exists() || self.aside().join("record.json").exists()
    }

    /// Writes a record, with the checksums of its arrays filled in, and returns it as written. An earlier
    /// record is kept until this one is complete, and is then removed together with its views.
    pub fn write(&self, mut record: Record, arrays: Arrays) -> Result<Stored> {
        let checksums = arrays.iter().map(|(name, array)| (name.clone(), hash_hex(&array.to_npy())));
        record.checksums = checksums.collect();
        let stored = Stored { record, arrays, timing: None, has_foreign_timing: false };
        if let Some(defect) = stored.defect() {
            return Err(Error::record(&self.root, format!("will not write a record whose {defect}")));
        }
        let (path, stage) = (self.record_dir(), self.stage());
        atomic::create_folder(&self.root, "create the results folder")?;
        atomic::recover(&path, &self.aside())?;
        let written = write_stage(&stage, &stored)
            .and_then(|()| atomic::swap_folder(&stage, &path, &self.aside(), "put the record in place"));
        if written.is_err() {
            let _ = fs::remove_dir_all(&stage);
        }
        written?;
        self.clear_views()?;
        Ok(stored)
    }

    /// Removes a record that a killed run had not finished.
    pub fn remove_unfinished(&self) -> Result<()> {
        remove_folder(&self.stage(), "remove an unfinished record")
    }

    /// Reads a record and checks version, checksums and shapes.
    pub fn read(&self) -> Result<Stored> {
        // A writer may replace the record meanwhile: if it has, a record that seems damaged is read again.
        let mut stored = loop {
            let before = self.checksum_line();
            let stored = self.read_as_it_is();
            if stored.is_ok() || self.checksum_line() == before {
                break stored?;
            }
        };
        let timing = self.read_timing()?;
        let numbers = stored.numbers();
        let is_own = |timing: &Timing| timing.record.as_ref().is_none_or(|timed| *timed == numbers);
        stored.has_foreign_timing = timing.as_ref().is_some_and(|timing| !is_own(timing));
        stored.timing = timing.filter(is_own);
        Ok(stored)
    }

    /// The record without its timing.
    fn read_as_it_is(&self) -> Result<Stored> {
        let dir = self.readable_dir();
        let path = dir.join("record.json");
        if !path.exists() {
            return Err(Error::record(&self.root, "no record here; `scatterproof run` makes one"));
        }
        let record = read_record(&path)?;
        let mut arrays = Arrays::new();
        for (name, checksum) in &record.checksums {
            arrays.insert(name.clone(), read_array(&dir, name, checksum)?);
        }
        let stored = Stored { record, arrays, timing: None, has_foreign_timing: false };
        match stored.defect() {
            Some(defect) => Err(Error::record(&path, format!("inconsistent: {defect}"))),
            None => Ok(stored),
        }
    }

    /// The line of the record's checksum, where there is one.
    fn checksum_line(&self) -> Option<Vec<u8>> {
        fs::read(self.readable_dir().join("record.json.b3")).ok()
    }

    /// The present path of the record. After a crash during the replacement of a record this is a temporary path, until
    /// the next run completes the replacement. Readers repair nothing, because a writer may be at work.
    fn readable_dir(&self) -> PathBuf {
        let (dir, aside) = (self.record_dir(), self.aside());
        if !dir.exists() && aside.exists() { aside } else { dir }
    }

    /// Folder of the second look at this record.
    pub fn retest(&self) -> RecordFolder {
        RecordFolder::new(self.root.join("retest"))
    }

    /// The second look at `main`, if there is one of the same experiment and build.
    ///
    /// # Errors
    /// It is there and damaged.
    pub fn retest_of(&self, main: &Stored) -> Result<Option<Stored>> {
        let folder = self.retest();
        if !folder.exists() {
            return Ok(None);
        }
        let stored = folder.read()?;
        let same = |f: fn(&Record) -> &str| f(&stored.record) == f(&main.record);
        let fits = same(|r| &r.experiment_hash) && same(|r| &r.claims_hash) && same(|r| &r.fingerprint);
        Ok(fits.then_some(stored))
    }

    /// Writes `timing.json`.
    pub fn write_timing(&self, timing: &Timing) -> Result<()> {
        self.write_view("timing.json", canonical(timing).as_bytes())
    }

    /// Reads `timing.json`, if it exists.
    pub fn read_timing(&self) -> Result<Option<Timing>> {
        self.read_json("timing.json")
    }

    /// Writes `pictures.json`, or removes it if no picture is requested.
    pub fn write_pictures(&self, pictures: &[Wanted]) -> Result<()> {
        let path = self.root.join("pictures.json");
        if !pictures.is_empty() {
            return self.write_view("pictures.json", canonical(&pictures).as_bytes());
        }
        match fs::remove_file(&path) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                Err(Error::io(&path, "remove the pictures of an earlier run")(error))
            }
            _ => Ok(()),
        }
    }

    /// Reads `pictures.json`; nothing if it does not exist.
    pub fn read_pictures(&self) -> Result<Vec<Wanted>> {
        Ok(self.read_json("pictures.json")?.unwrap_or_default())
    }

    /// Writes `provenance.json`.
    pub fn write_provenance(&self, provenance: &Provenance) -> Result<()> {
        self.write_view("provenance.json", canonical(provenance).as_bytes())
    }

    /// Reads `provenance.json`, if it exists.
    pub fn read_provenance(&self) -> Result<Option<Provenance>> {
        self.read_json("provenance.json")
    }

    /// Writes a file beside the record, and creates its folders.
    pub fn write_view(&self, name: &str, bytes: &[u8]) -> Result<()> {
        let path = self.root.join(name);
        atomic::create_folder(path.parent().unwrap_or(&self.root), "create the results folder")?;
        atomic::write(&path, bytes, "write results")
    }

    /// Removes every view beside the record, so that no view of an earlier record remains.
    pub fn clear_views(&self) -> Result<()> {
        if self.root.is_dir() {
            atomic::sweep(&self.root)?;
        }
        for folder in VIEW_FOLDERS {
            remove_folder(&self.root.join(folder), "remove the views of an earlier record")?;
        }
        for path in VIEW_FILES.map(|name| self.root.join(name)).iter().filter(|path| path.exists()) {
            fs::remove_file(path).map_err(Error::io(path, "remove a view of an earlier record"))?;
        }
        self.clear_pictures()
    }

    /// Removes the pictures of an earlier record from `images/`: files whose names begin with the number of a
    /// cell or with `split-`, as those of all pictures of a report do, and the lead picture.
    fn clear_pictures(&self) -> Result<()> {
        let folder = self.root.join("images");
        let Ok(entries) = fs::read_dir(&folder) else { return Ok(()) };
        atomic::sweep(&folder)?;
        for entry in entries.flatten() {
            let name = entry.file_name();
            let name = name.to_string_lossy();
            let number = name.split_once('-').map_or("", |(number, _)| number);
            let is_cell = number.len() >= 3 && number.bytes().all(|b| b.is_ascii_digit());
            if is_cell || number == "split" || name == "lead.png" {
                let path = entry.path();
                fs::remove_file(&path)
                    .map_err(Error::io(&path, "remove a picture of an earlier record"))?;
            }
        }
        Ok(())
    }

    fn read_json<T: DeserializeOwned>(&self, name: &str) -> Result<Option<T>> {
        let path = self.root.join(name);
        if !path.exists() {
            return Ok(None);
        }
        let text =
            input::read_text(&path, input::LARGEST_DATA).map_err(Error::io(&path, "read results"))?;
        let value = serde_json::from_str(&text);
        value.map(Some).map_err(|e| Error::record(&path, format!("{e}; remove the file or run again")))
    }

    fn record_dir(&self) -> PathBuf {
        self.root.join("record")
    }

    /// Where a record is written before it is moved to its final path.
    fn stage(&self) -> PathBuf {
        self.root.join(".record.new")
    }

    /// Where an earlier record is kept while a new one is moved to its path.
    fn aside(&self) -> PathBuf {
        self.root.join(".record.old")
    }
}

/// Removes a folder, if it exists.
fn remove_folder(path: &Path, doing: &str) -> Result<()> {
    match fs::remove_dir_all(path) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(Error::io(path, doing)(error)),
        _ => Ok(()),
    }
}

/// Writes all files of a record into a fresh folder.
fn write_stage(stage: &Path, stored: &Stored) -> Result<()> {
    remove_folder(stage, "remove an unfinished record")?;
    for (name, array) in &stored.arrays {
        let path = inside(stage, name)?;
        atomic::create_folder(path.parent().unwrap_or(stage), "create the record's folder")?;
        atomic::write(&path, &array.to_npy(), "write the record")?;
    }
    atomic::create_folder(stage, "create the record's folder")?;
    let text = readable(&stored.record, stage)?;
    let line = format!("{}  record.json\n", hash_hex(text.as_bytes()));
    atomic::write(&stage.join("record.json"), text.as_bytes(), "write the record")?;
    atomic::write(&stage.join("record.json.b3"), line.as_bytes(), "write the record")
}

/// The record's canonical JSON, after a check that reading it gives the same record: JSON has no NaN or infinity.
fn readable<T: Serialize + DeserializeOwned + PartialEq>(value: &T, path: &Path) -> Result<String> {
    let text = canonical(value);
    match serde_json::from_str::<T>(&text) {
        Ok(back) if back == *value => Ok(text),
        _ => Err(Error::record(path, "the record holds a number that is not finite")),
    }
}

fn read_record(path: &Path) -> Result<Record> {
    let bytes = input::read(path, input::LARGEST_DATA).map_err(Error::io(path, "read the record"))?;
    let value: serde_json::Value = serde_json::from_slice(&bytes)
        .map_err(|e| Error::record(path, format!("truncated or not JSON ({e}); run it again")))?;
    // The version is checked first: this program cannot interpret the layout and hash of another version.
    let version = value.get("schema_version").and_then(|v| v.as_u64());
    if version != Some(u64::from(SCHEMA_VERSION)) {
        let found = version.map_or("none".to_string(), |v| v.to_string());
        let message = format!(
            "schema version {found}, this program reads {SCHEMA_VERSION}: the record was written by another \
             version of the program; run it again"
        );
        return Err(Error::record(path, message));
    }
    let sum = path.with_extension("json.b3");
    let line = input::read_text(&sum, input::LONGEST_TEXT)
        .map_err(Error::io(&sum, "read the record's checksum"))?;
    if line.split_whitespace().next() != Some(&hash_hex(&bytes)) {
        return Err(Error::record(path, "checksum mismatch: the file was changed after it was written"));
    }
    serde_json::from_value(value).map_err(|e| Error::record(path, format!("not a record: {e}")))
}

fn read_array(dir: &Path, name: &str, checksum: &str) -> Result<Array> {
    let path = inside(dir, name)?;
    let bytes = input::read(&path, input::LARGEST_ARRAY).map_err(Error::io(&path, "read the record"))?;
    let array = Array::from_npy(&bytes, &path)?;
    if hash_hex(&bytes) != checksum {
        return Err(Error::record(
            &path,
            "checksum mismatch: the file was changed after it was written",
        ));
    }
    Ok(array)
}

/// A path below `dir`; a record cannot name a file outside its folder.
fn inside(dir: &Path, name: &str) -> Result<PathBuf> {
    if Path::new(name).components().all(|c| matches!(c, Component::Normal(_))) {
        return Ok(dir.join(name));
    }
    Err(Error::record(dir, format!("`{name}` is not a path inside the record")))
}

#[cfg(test)]
#[path = "store_tests.rs"]
mod tests;
