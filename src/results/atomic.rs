//! Files that appear whole or not at all: written next to their final path, flushed, renamed.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};

/// Puts `bytes` at `path`. On failure an earlier file is untouched and nothing else is left.
/// `doing` completes the sentence "could not ..".
pub fn write(path: &Path, bytes: &[u8], doing: &str) -> Result<()> {
    write_with(path, doing, |file| file.write_all(bytes))
}

fn write_with(path: &Path, doing: &str, fill: impl FnOnce(&mut File) -> io::Result<()>) -> Result<()> {
    let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let temporary = path.with_file_name(format!(".{name}.{}.tmp", std::process::id()));
    let put = || {
        let mut file = File::create(&temporary)?;
        fill(&mut file)?;
        file.sync_all()?;
        fs::rename(&temporary, path)?;
        sync_folder(&parent(path))
    };
    put().map_err(|source| {
        let _ = fs::remove_file(&temporary);
        Error::io(path, doing)(source)
    })
}

/// Removes the files that `write` had not finished where its process was killed.
pub fn sweep(folder: &Path) -> Result<()> {
    for entry in fs::read_dir(folder).map_err(Error::io(folder, "read the folder"))?.flatten() {
        let name = entry.file_name();
        let name = name.to_string_lossy();
        if name.starts_with('.') && name.ends_with(".tmp") {
            let path = entry.path();
            fs::remove_file(&path).map_err(Error::io(&path, "remove an unfinished file"))?;
        }
    }
    Ok(())
}

/// Creates a folder and its parents.
pub fn create_folder(path: &Path, doing: &str) -> Result<()> {
    fs::create_dir_all(path).map_err(|source| match dangling(path) {
        Some(link) => {
            Error::record(&link, format!("could not {doing}: the link leads nowhere; remove or mend it"))
        }
        None => Error::io(path, doing)(source),
    })
}

/// The link on the way to `path` whose target does not exist, where there is one.
fn dangling(path: &Path) -> Option<PathBuf> {
    path.ancestors().find(|part| part.is_symlink() && !part.exists()).map(Path::to_path_buf)
}

/// Replaces the folder `path` by the finished folder `stage` beside it. A folder cannot be renamed
/// over another, so the old one first steps aside to `aside`; [`recover`] undoes a crash in between.
pub fn swap_folder(stage: &Path, path: &Path, aside: &Path, doing: &str) -> Result<()> {
    let failed = |source| Error::io(path, doing)(source);
    sync_folder(stage).map_err(failed)?;
    let had_old = path.exists();
    if had_old {
        fs::rename(path, aside).map_err(failed)?;
    }
    if let Err(source) = fs::rename(stage, path) {
        if had_old {
            let _ = fs::rename(aside, path);
        }
        return Err(failed(source));
    }
    sync_folder(&parent(path)).map_err(failed)?;
    if had_old { fs::remove_dir_all(aside).map_err(failed) } else { Ok(()) }
}

/// Brings back the folder that a crash within [`swap_folder`] left aside, or removes it where its
/// successor is in place.
pub fn recover(path: &Path, aside: &Path) -> Result<()> {
    let put = || match (aside.exists(), path.exists()) {
        (false, _) => Ok(()),
        (true, true) => fs::remove_dir_all(aside),
        (true, false) => fs::rename(aside, path),
    };
    put().map_err(Error::io(path, "finish an interrupted write"))
}

/// Flushes a folder's list of names.
pub fn sync_folder(path: &Path) -> io::Result<()> {
    File::open(path)?.sync_all()
}

fn parent(path: &Path) -> PathBuf {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent.to_path_buf(),
        _ => PathBuf::from("."),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).expect("a folder").map(|e| e.expect("an entry"));
        entries.map(|e| e.file_name().to_string_lossy().into_owned()).collect()
    }

    #[test]
    fn replaces_whole_files() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.json");
        write(&path, b"one", "write a test").expect("first write");
        write(&path, b"two", "write a test").expect("second write");
        assert_eq!(fs::read(&path).expect("a file"), b"two");
        assert_eq!(names(folder.path()), ["a.json"]);
    }

    #[test]
    fn a_full_disk_leaves_the_old_file_alone() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.json");
        write(&path, b"old", "write a test").expect("first write");
        let full = |file: &mut File| {
            file.write_all(b"ne")?;
            Err(io::Error::from(io::ErrorKind::StorageFull))
        };
        let error = write_with(&path, "write the record", full).expect_err("a full disk").to_string();
        assert!(error.contains("could not write the record") && error.contains("a.json"), "{error}");
        assert_eq!(fs::read(&path).expect("a file"), b"old");
        assert_eq!(names(folder.path()), ["a.json"]);
    }

    #[test]
    fn an_interrupted_swap_is_recovered() {
        let folder = tempfile::tempdir().expect("a folder");
        let (path, aside) = (folder.path().join("record"), folder.path().join(".record.old"));
        fs::create_dir(&aside).expect("a folder");
        fs::write(aside.join("kept"), b"").expect("a file");
        recover(&path, &aside).expect("recovery");
        assert_eq!(names(&path), ["kept"]);
        fs::create_dir(&aside).expect("a folder");
        recover(&path, &aside).expect("clean up");
        assert!(!aside.exists() && path.exists());
    }
}
