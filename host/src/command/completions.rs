//! Completions for a shell, on standard output.
//!
//! Examples:
//!   host completions bash > ~/.local/share/bash-completion/completions/host
//!   host completions fish > ~/.config/fish/completions/host.fish

use clap::CommandFactory;
use clap_complete::Shell;

use super::{Cli, Failure, say};

/// Arguments of `completions`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The shell
    shell: Shell,
}

/// Prints the completions.
///
/// # Errors
///
/// If standard output cannot be written.
pub fn run(args: &Args) -> Result<(), Failure> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "host", &mut script);
    say(&String::from_utf8_lossy(&script))
}
