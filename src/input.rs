//! Files that are read as input: regular files up to a stated size. Reading a device or a pipe might never end, or might
//! block before signals are checked.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::Path;

/// Longest text: experiment files and tables.
pub(crate) const LONGEST_TEXT: u64 = 64 << 20;
/// Largest mesh or image.
pub(crate) const LARGEST_DATA: u64 = 4 << 30;
/// Largest file of a record.
pub(crate) const LARGEST_ARRAY: u64 = 64 << 30;

/// Opens a regular file of at most `most` bytes; its length is the second value.
pub(crate) fn open(path: &Path, most: u64) -> io::Result<(File, u64)> {
    let about = fs::metadata(path)?;
    if !about.is_file() {
        return Err(io::Error::other("not a regular file; copy what it holds into one"));
    }
    if about.len() > most {
        let (has, limit) = (about.len(), most >> 20);
        return Err(io::Error::other(format!("it has {has} bytes, and at most {limit} MiB are read")));
    }
    Ok((File::open(path)?, about.len()))
}

/// The bytes of a regular file of at most `most` bytes.
pub(crate) fn read(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let (file, length) = open(path, most)?;
    let mut bytes = Vec::with_capacity(length as usize);
    file.take(most).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// The text of a regular file of at most `most` bytes.
pub(crate) fn read_text(path: &Path, most: u64) -> io::Result<String> {
    String::from_utf8(read(path, most)?)
        .map_err(|_| io::Error::new(io::ErrorKind::InvalidData, "it is no UTF-8 text"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_regular_files_of_a_stated_size_are_read() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a");
        fs::write(&path, b"abc").expect("a file");
        assert_eq!(read_text(&path, 3).expect("a text"), "abc");
        let refusal = |path: &Path| read(path, 2).expect_err("refused").to_string();
        assert!(refusal(&path).contains("3 bytes"), "{}", refusal(&path));
        for path in [folder.path(), Path::new("/dev/zero")] {
            assert!(refusal(path).contains("not a regular file"), "{}", refusal(path));
        }
        fs::write(&path, b"\xff").expect("a file");
        assert!(read_text(&path, 3).expect_err("no text").to_string().contains("UTF-8"));
    }
}
