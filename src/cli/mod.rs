//! Stub.

/// `check`.
pub mod check;

/// `completions`.
pub mod completions;

/// `init`.
pub mod init;

/// `list`.
pub mod list;

/// `schema`.
pub mod schema;
