//! Standard output and standard error.

use std::fmt;
use std::io::{self, ErrorKind, Stdout, Write};
use std::path::Path;

use crate::error::Error;

/// Standard output. Once its reader has gone (`| head`), what it is given is dropped: a closed pipe ends no run
/// and changes no exit code. Any other failure, as of a full disk, is an error.
#[derive(Debug)]
pub(super) struct StandardOutput(Stdout);

impl StandardOutput {
    pub(super) fn new() -> StandardOutput {
        StandardOutput(io::stdout())
    }
}

impl Write for StandardOutput {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        or_if_closed(self.0.write(bytes), bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        or_if_closed(self.0.flush(), ())
    }
}

fn or_if_closed<T>(result: io::Result<T>, closed: T) -> io::Result<T> {
    match result {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(closed),
        other => other,
    }
}

/// The error of a command that could not print its result.
pub(super) fn unwritable(source: io::Error) -> Error {
    Error::io(Path::new("standard output"), "write")(source)
}

/// A line on standard error. There is nobody left to tell where it cannot be written.
pub(crate) fn say(line: impl fmt::Display) {
    let _ = writeln!(io::stderr(), "{line}");
}
