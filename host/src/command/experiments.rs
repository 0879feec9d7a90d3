//! The paper's experiments on the built-in shapes, with simpler methods beside.
//!
//! Makes every shape in five ways (default, default along the fitted curves, the paper's mode, two-view
//! visual hull, one silhouette inflated) and measures them against the truth; repeats the paper's tables of
//! cross-sections and parts, its noise and its plot over the number of branches. Leaves experiments.md to
//! read, experiments.json, figures/ and a folder a shape.
//!
//! Examples:
//!   host experiments
//!   host experiments --quick --out look
//!   host experiments --json

use std::io::IsTerminal;
use std::path::PathBuf;
use std::time::Instant;

use indicatif::{ProgressBar, ProgressStyle};

use super::table::Table;
use super::{Failure, say, say_json};
use crate::experiment::{self, Effort, Experiments, Way};
use crate::reconstruct::Front;

/// Arguments of `experiments`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "ossature-experiments")]
    out: PathBuf,
    /// Two shapes, coarser meshes, fewer samples
    #[arg(long)]
    quick: bool,
    /// The visible side of the default's models: from balls, from the grey levels of both images, or from these
    /// where they are to be trusted
    #[arg(
        long,
        value_enum,
        hide_possible_values = true,
        default_value = "balls",
        value_name = "balls|grey|auto"
    )]
    front: Front,
    /// Print one JSON document instead of text
    #[arg(long)]
    pub(super) json: bool,
}

/// Runs all experiments.
///
/// # Errors
///
/// If the results cannot be written.
pub fn run(args: &Args) -> Result<(), Failure> {
    let start = Instant::now();
    let effort = if args.quick { Effort::quick() } else { Effort::full() };
    let effort = Effort { front: args.front, ..effort };
    let bar = if std::io::stderr().is_terminal() {
        ProgressBar::new(effort.steps() as u64)
    } else {
        ProgressBar::hidden()
    };
    if let Ok(style) = ProgressStyle::with_template("{bar:40} {pos}/{len} experiments, {eta} left") {
        bar.set_style(style);
    }
    let found = experiment::run(&args.out, &effort, &|| bar.inc(1))?;
    bar.finish_and_clear();
    if args.json {
        return say_json(&serde_json::to_value(&found)?);
    }
    let mut table = tell(&found);
    table.row("time", &format!("{:.1} s", start.elapsed().as_secs_f64()));
    table.row("page", &args.out.join("experiments.md").display().to_string());
    say(table.text())
}

/// The table of all shapes.
fn tell(found: &Experiments) -> Table {
    let mut table = Table::new("mean error in mm");
    table.row("", &Way::ALL.map(|way| format!("{:>16}", way.name())).concat());
    for study in &found.shapes {
        let cell = |way| study.error(way).map_or("-".to_owned(), |[mm, _]| format!("{mm:.2}"));
        table.row(&study.name, &Way::ALL.map(|way| format!("{:>16}", cell(way))).concat());
    }
    table
}
