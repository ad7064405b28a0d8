//! `scatterproof schema`: prints the JSON Schema of experiment files.

use std::io::Write;

use super::output::unwritable;
use crate::error::Result;
use crate::experiment::Registry;
use crate::experiment::schema_json::editor_schema;

/// Print the JSON Schema of experiment files, for completion and checks in editors.
#[derive(Debug, clap::Args)]
pub(super) struct Args {}

/// Prints the schema with the registered estimators and samplers.
///
/// # Errors
/// The output cannot be written.
pub(super) fn run(_: &Args, registry: &Registry, out: &mut dyn Write) -> Result<()> {
    writeln!(out, "{:#}", editor_schema(registry)).map_err(unwritable)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_prints_json() {
        let mut out = Vec::new();
        run(&Args {}, &crate::experiment::tests::registry(), &mut out).expect("it prints");
        let schema: serde_json::Value = serde_json::from_slice(&out).expect("it is JSON");
        assert_eq!(schema["title"], "scatterproof experiment");
    }
}
