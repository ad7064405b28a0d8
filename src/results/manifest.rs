//! `manifest.json`: the summary of a result that is kept without its arrays. It holds the passes of
//! every run, for `run --passes-of`; the hash of every array, to tell whether a re-run reproduces it;
//! and the hash of every table, plot and picture, to detect files that were changed by hand.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::json::{canonical, hash_hex};
use super::record::{EstimatorRun, Record};
pub use super::store::MANIFEST;
use super::store::RecordFolder;
use crate::error::{Error, Result};

/// Version of this layout; a reader refuses others. A new layout of records does not change it.
const VERSION: u32 = 1;

/// Folders of views, and the file type of each that is hashed.
const VIEWS: [(&str, &str); 3] = [("images", "png"), ("plots", "svg"), ("tables", "md")];

/// A result without its arrays.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    version: u32,
    /// The experiment's name.
    pub experiment: String,
    /// blake3 of the resolved experiment without claims, hex.
    pub experiment_hash: String,
    /// What fixes the bits: see `results::provenance`.
    pub fingerprint: String,
    /// The runs, in the order of cells and estimators.
    pub runs: Vec<ManifestRun>,
    /// blake3 of tables, plots and pictures, hex, by path relative to the results folder.
    pub views: BTreeMap<String, String>,
}

/// One estimator in one cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ManifestRun {
    /// Index of the cell in the sweep.
    pub cell: usize,
    /// The cell's label.
    pub label: String,
    /// Estimator name.
    pub estimator: String,
    /// Number of independent passes.
    pub passes: u64,
    /// blake3 of every array file, hex, by what the array holds.
    pub arrays: BTreeMap<String, String>,
}

impl Manifest {
    /// The manifest of a record, without hashes of views.
    pub fn of(record: &Record) -> Manifest {
        let cells = record.cells.iter().enumerate();
        let runs = cells.flat_map(|(index, cell)| {
            cell.runs.iter().map(move |run| ManifestRun {
                cell: index,
                label: cell.label.clone(),
                estimator: run.estimator.clone(),
                passes: run.passes,
                arrays: arrays(record, run),
            })
        });
        Manifest {
            version: VERSION,
            experiment: record.experiment.clone(),
            experiment_hash: record.experiment_hash.clone(),
            fingerprint: record.fingerprint.clone(),
            runs: runs.collect(),
            views: BTreeMap::new(),
        }
    }

    /// Passes of an estimator in a cell, where it was run there.
    pub fn passes(&self, cell: usize, estimator: &str) -> Option<u64> {
        let mut runs = self.runs.iter();
        runs.find(|run| run.cell == cell && run.estimator == estimator).map(|run| run.passes)
    }
}

/// The hashes of a run's arrays, by what they hold.
fn arrays(record: &Record, run: &EstimatorRun) -> BTreeMap<String, String> {
    let image =
        run.image.iter().flat_map(|image| [("pixels", &image.pixels), ("spread", &image.spread)]);
    let guide = run.guide.iter().map(|plane| ("guide", &plane.array));
    let paths =
        [("observables", &run.moments), ("costs", &run.costs)].into_iter().chain(image).chain(guide);
    let sums =
        paths.filter_map(|(what, path)| Some((what.to_string(), record.checksums.get(path)?.clone())));
    sums.collect()
}

impl RecordFolder {
    /// Writes `manifest.json` of a record and of the views beside it.
    pub fn write_manifest(&self, record: &Record) -> Result<()> {
        let mut manifest = Manifest::of(record);
        for (folder, extension) in VIEWS {
            manifest.views.extend(hashes(self.root(), folder, extension)?);
        }
        self.write_view(MANIFEST, canonical(&manifest).as_bytes())
    }

    /// The manifest of the record here, or `manifest.json` where there is none.
    ///
    /// # Errors
    /// Neither exists, or it is damaged or of another version.
    pub fn manifest(&self) -> Result<Manifest> {
        let path = self.root().join(MANIFEST);
        if self.exists() || !path.exists() {
            return Ok(Manifest::of(&self.read()?.record));
        }
        let text = fs::read_to_string(&path).map_err(Error::io(&path, "read the manifest"))?;
        let manifest: Manifest = serde_json::from_str(&text).map_err(|e| {
            Error::record(&path, format!("not a manifest of this version ({e}); run it again"))
        })?;
        if manifest.version != VERSION {
            let message =
                format!("version {}, this program reads {VERSION}; run it again", manifest.version);
            return Err(Error::record(&path, message));
        }
        Ok(manifest)
    }
}

/// The hashes of a folder's files of one form, by their path.
fn hashes(root: &Path, folder: &str, extension: &str) -> Result<BTreeMap<String, String>> {
    let path = root.join(folder);
    if !path.exists() {
        return Ok(BTreeMap::new());
    }
    let mut hashes = BTreeMap::new();
    for entry in fs::read_dir(&path).map_err(Error::io(&path, "read the views"))? {
        let file = entry.map_err(Error::io(&path, "read the views"))?.path();
        let Some(name) = file.file_name().filter(|_| file.extension().is_some_and(|e| e == extension))
        else {
            continue;
        };
        let bytes = fs::read(&file).map_err(Error::io(&file, "read the views"))?;
        hashes.insert(format!("{folder}/{}", name.to_string_lossy()), hash_hex(&bytes));
    }
    Ok(hashes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::sample;

    #[test]
    fn a_manifest_replaces_a_missing_record() {
        let temp = tempfile::tempdir().expect("a folder");
        let folder = RecordFolder::new(temp.path().join("sample"));
        let told = folder.manifest().expect_err("nothing is there").to_string();
        assert!(told.contains("no record here"), "{told}");

        let stored = sample::judged(&[("holds", 1.0)]);
        let stored = folder.write(stored.record, stored.arrays).expect("a record");
        folder.write_view("tables/means.md", b"| x |").expect("a table");
        folder.write_view("tables/means.csv", b"x").expect("a table for programs");
        folder.write_manifest(&stored.record).expect("a manifest");
        fs::remove_dir_all(folder.root().join("record")).expect("removed");

        let manifest = folder.manifest().expect("a manifest");
        let views = [("tables/means.md".to_string(), hash_hex(b"| x |"))];
        assert_eq!(manifest.views, BTreeMap::from(views));
        let run = &stored.record.cells[0].runs[0];
        assert_eq!(manifest.passes(0, &run.estimator), Some(run.passes));
        assert_eq!((manifest.passes(0, "none"), manifest.passes(99, &run.estimator)), (None, None));
        assert_eq!(manifest.runs[0].arrays["observables"], stored.record.checksums[&run.moments]);
        let count: usize = manifest.runs.iter().map(|run| run.arrays.len()).sum();
        assert_eq!(count, stored.record.checksums.len(), "every array has a hash");

        let path = folder.root().join(MANIFEST);
        let text = fs::read_to_string(&path).expect("a text");
        for (planted, words) in [
            (text.replace("\"version\": 1", "\"version\": 2"), "version 2"),
            ("{".into(), "not a manifest"),
        ] {
            fs::write(&path, planted).expect("written");
            let told = folder.manifest().expect_err("refused").to_string();
            assert!(told.contains(words), "{told}");
        }
    }
}
