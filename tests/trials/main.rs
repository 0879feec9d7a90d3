//! Long trials: so many pairs, faults, kills or machines that something rare would show. A few of each are run by
//! `tests/tests/trials.rs`; docs/reliability.md tells what the long ones gave.

mod device;
mod kills;
mod memory;
mod pairs;
mod same;
mod worker;

use clap::Parser;
use std::path::PathBuf;

/// What is to be tried. It panics at the first thing that is not as it should be.
#[derive(Parser)]
enum Trial {
    /// So many pairs, good and bad, through `host replay` in one process
    Pairs {
        /// How many
        count: usize,
    },
    /// So many pairs from a device on an emulated board whose link and eyes fail at random
    Device {
        /// How many
        count: usize,
    },
    /// Whoever writes is killed so often, at any moment
    Kills {
        /// How often each
        count: u64,
    },
    /// So many pairs, in several memories, by several kernels, on several threads and on emulated boards
    Same {
        /// How many
        count: u64,
        /// Hold what came of each against this file, or make it
        sums: Option<PathBuf>,
    },
    /// Play a part in another trial
    #[command(subcommand, hide = true)]
    Play(worker::Part),
}

fn main() {
    match Trial::parse() {
        Trial::Pairs { count } => pairs::run(count),
        Trial::Device { count } => device::run(count),
        Trial::Kills { count } => kills::run(count),
        Trial::Same { count, sums } => same::run(count, sums.as_deref()),
        Trial::Play(part) => part.play(),
    }
}
