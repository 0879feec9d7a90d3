//! Manual pages: one for the program, one a command.
//!
//! Examples:
//!   host man ~/.local/share/man/man1
//!   man host-replay

use std::path::PathBuf;

use clap::CommandFactory;

use super::{Cli, Failure, say};

/// Arguments of `man`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder for the pages, which is created if it is missing
    folder: PathBuf,
}

/// Writes the pages.
///
/// # Errors
///
/// If the folder or a page cannot be written.
pub fn run(args: &Args) -> Result<(), Failure> {
    let told = |error| format!("cannot write {}: {error}", args.folder.display());
    std::fs::create_dir_all(&args.folder).map_err(told)?;
    clap_mangen::generate_to(Cli::command(), &args.folder).map_err(told)?;
    say(&format!("{}\n", args.folder.display()))
}
