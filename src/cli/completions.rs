//! `scatterproof completions`: prints a completion script for a shell. The only module that uses `clap_complete`.

use std::io::Write;

use clap_complete::Shell;

use super::output::unwritable;
use crate::error::Result;

/// Print a shell completion script, for example `scatterproof completions bash >
/// ~/.bash_completion.d/scatterproof`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Shell that the script is for.
    pub shell: Shell,
}

/// Prints the script for `command`, the whole command line, of the program that is called `name`.
///
/// # Errors
/// The output cannot be written.
pub(super) fn run(
    args: &Args,
    mut command: clap::Command,
    name: &str,
    out: &mut dyn Write,
) -> Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut command, name, &mut script);
    out.write_all(&script).map_err(unwritable)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Args as _;

    #[test]
    fn scripts_name_the_subcommands() {
        let check = super::super::check::Args::augment_args(clap::Command::new("check"));
        let command = clap::Command::new("scatterproof").subcommand(check);
        for shell in [Shell::Bash, Shell::Zsh, Shell::Fish] {
            let mut out = Vec::new();
            run(&Args { shell }, command.clone(), "own-program", &mut out).expect("it prints");
            let script = String::from_utf8(out).expect("it is text");
            assert!(script.contains("check") && script.contains("setting"), "{shell}");
            assert!(script.contains("own-program"), "{shell}: {script}");
        }
    }
}
