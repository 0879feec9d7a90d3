//! How long the stages of a run took.

use super::Run;
use super::record::{Lap, Record};
use super::words::view;
use shared::pipeline::Side;
use std::time::Duration;

/// What a stage works on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// One view, in the core.
    Eye(Side),
    /// Both views, in the core.
    Pair,
    /// What comes before and after the core.
    Host,
}

impl Part {
    /// What it is called.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Eye(side) => view(&side),
            Self::Pair => "pair",
            Self::Host => "host",
        }
    }
}

/// A stage of a run.
#[derive(Clone, Copy, Debug)]
pub struct Stage {
    /// What it works on.
    pub part: Part,
    /// Its name in the report.
    pub name: &'static str,
    /// How long it took.
    pub time: Duration,
}

/// The host's stage that holds all of the core's.
pub const CORE: &str = "core";

/// The stages in their order; the core's are followed by [`CORE`].
pub fn stages(run: &Run<'_>) -> Vec<Stage> {
    let host = run.reconstruction.times.iter().map(|&(name, time)| Stage { part: Part::Host, name, time });
    let host: Vec<Stage> = host.collect();
    let core = host.iter().position(|stage| stage.name == CORE).unwrap_or_default();
    // The record's clock runs since before the images were rectified, if they were.
    let mut before = host[..core].iter().map(|stage| stage.time).sum();
    let mut stages = host[..core].to_vec();
    stages.extend(of_core(run.record).into_iter().map(|stage| {
        let time = stage.time.saturating_sub(std::mem::take(&mut before));
        Stage { time, ..stage }
    }));
    stages.extend(&host[core..]);
    stages
}

/// The core's stages that a record saw; the first holds what came before it.
pub fn of_core(record: &Record) -> Vec<Stage> {
    let stage =
        |lap: &Lap| Stage { part: lap.side.map_or(Part::Pair, Part::Eye), name: lap.stage, time: lap.time };
    record.laps.iter().map(stage).collect()
}
