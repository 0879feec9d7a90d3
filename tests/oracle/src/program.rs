//! The host's program, run within a test, and the files that it leaves.

use clap::Parser;
use host::command::{Cli, words_of};
use std::fs;
use std::path::Path;

/// Run the program with these arguments.
///
/// # Errors
/// Its sentence, where its exit code is 1.
///
/// # Panics
/// When the arguments are wrong.
pub fn host(args: &[&str]) -> Result<(), String> {
    let cli = Cli::try_parse_from([&["host"], args].concat()).unwrap_or_else(|error| panic!("{error}"));
    cli.run().map_err(|failure| words_of(&*failure))
}

/// The path of a file in a folder, as an argument.
pub fn within(folder: &Path, name: &str) -> String {
    folder.join(name).display().to_string()
}

/// The surface, the skeleton and the boundary of the model in a folder.
///
/// # Panics
/// When there is none.
pub fn model(folder: &Path) -> [Vec<u8>; 3] {
    ["model.ply", "skeleton.ply", "boundary.ply"]
        .map(|name| fs::read(folder.join(name)).unwrap_or_else(|error| panic!("{name}: {error}")))
}
