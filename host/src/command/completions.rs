//! Completions for a shell, on standard output.
//!
//! Examples:
//!   host completions bash > ~/.local/share/bash-completion/completions/host
//!   host completions fish > ~/.config/fish/completions/host.fish
//!   host completions nushell > ~/.config/nushell/autoload/host.nu

use clap::ValueEnum;
use clap_complete::{Generator, shells};
use clap_complete_nushell::Nushell;

use super::{Failure, line, say};

/// Arguments of `completions`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The shell
    #[arg(value_enum)]
    shell: Shell,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Shell {
    Bash,
    Elvish,
    Fish,
    Nushell,
    Powershell,
    Zsh,
}

/// Prints the completions.
///
/// # Errors
///
/// If standard output cannot be written.
pub fn run(args: &Args) -> Result<(), Failure> {
    say(&match args.shell {
        Shell::Bash => script(shells::Bash),
        Shell::Elvish => script(shells::Elvish),
        Shell::Fish => script(shells::Fish),
        Shell::Nushell => script(Nushell),
        Shell::Powershell => script(shells::PowerShell),
        Shell::Zsh => script(shells::Zsh),
    })
}

fn script(shell: impl Generator) -> String {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut line::command(), "host", &mut script);
    String::from_utf8_lossy(&script).into_owned()
}
