//! One writer at a time in a results folder: an advisory lock that the kernel releases with the process, however that
//! ends.

use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Read, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::thread::sleep;
use std::time::Duration;

use super::{atomic, provenance};
use crate::error::{Error, Result};

/// The lock's file in a results folder. It stays there: removing it would let two processes hold two locks.
const NAME: &str = ".lock";

/// Locks that this process holds, by folder: who holds one may take it again.
static HELD: Mutex<BTreeMap<PathBuf, Weak<FolderLock>>> = Mutex::new(BTreeMap::new());

/// A results folder that no other process writes to. Dropping the last clone releases it.
#[derive(Debug)]
pub(crate) struct FolderLock {
    _file: File,
}

/// Locks the results folder `root`, which is made where it does not exist.
///
/// # Errors
/// Another process works there; the folder cannot be written.
pub(crate) fn lock(root: &Path) -> Result<Arc<FolderLock>> {
    atomic::create_folder(root, "create the results folder")?;
    let path = root.join(NAME);
    let failed = |source| Error::io(&path, "lock the results folder")(source);
    let key = fs::canonicalize(root).map_err(failed)?;
    let mut held = HELD.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(lock) = held.get(&key).and_then(Weak::upgrade) {
        return Ok(lock);
    }
    let mut open = OpenOptions::new();
    let mut file =
        open.read(true).write(true).create(true).truncate(false).open(&path).map_err(failed)?;
    match file.try_lock() {
        Ok(()) => sign(&mut file).map_err(failed)?,
        Err(TryLockError::WouldBlock) => return Err(busy(root, file)),
        Err(TryLockError::Error(error)) => {
            // Some network file systems know no locks. Nobody is left to tell where this cannot be written.
            let words = "nothing keeps another process from writing there, too";
            let _ = writeln!(io::stderr(), "note: could not lock {}: {error}; {words}", root.display());
        }
    }
    let lock = Arc::new(FolderLock { _file: file });
    held.retain(|_, lock| lock.strong_count() > 0);
    held.insert(key, Arc::downgrade(&lock));
    Ok(lock)
}

/// Writes who holds the lock into its file, for the message of a process that wants it meanwhile.
fn sign(file: &mut File) -> io::Result<()> {
    let host = fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    let (process, now) = (std::process::id(), provenance::now());
    // In one piece and of one length, so that a reader never finds a part of it.
    let line = format!("process {process} on {}, since {now}", host.trim());
    file.rewind()?;
    file.write_all(format!("{line:<200}\n").as_bytes())
}

fn busy(root: &Path, mut file: File) -> Error {
    let mut holder = String::new();
    // The holder of a new lock has yet to sign it.
    for _ in 0..50 {
        if !matches!(Read::by_ref(&mut file).take(1000).read_to_string(&mut holder), Ok(0)) {
            break;
        }
        sleep(Duration::from_millis(10));
    }
    let holder = match holder.trim() {
        "" => String::new(),
        words => format!(" ({words})"),
    };
    let help = "wait until it has ended, or choose another folder with --out";
    Error::record(root, format!("another process works in this folder{holder}; {help}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_process_may_take_its_own_lock_again() {
        let folder = tempfile::tempdir().expect("a folder");
        let first = lock(folder.path()).expect("a lock");
        let again = lock(folder.path()).expect("the same");
        assert!(Arc::ptr_eq(&first, &again));
        drop((first, again));
        lock(folder.path()).expect("released");
    }

    // An open file of its own stands for another process: the kernel locks open files.
    #[test]
    fn the_holder_is_named() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join(NAME);
        let mut other = File::create(&path).expect("a file");
        other.lock().expect("locked");
        sign(&mut other).expect("signed");
        let message = lock(folder.path()).expect_err("busy").to_string();
        let own = format!("another process works in this folder (process {} on ", std::process::id());
        assert!(message.contains(&own) && message.contains("choose another folder"), "{message}");
        drop(other);
        lock(folder.path()).expect("released");
    }
}
