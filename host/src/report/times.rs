//! How long the stages of a run took.

use super::Run;
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
    stages.extend(run.record.laps.iter().map(|lap| {
        let time = lap.time.saturating_sub(std::mem::take(&mut before));
        Stage { part: lap.side.map_or(Part::Pair, Part::Eye), name: lap.stage, time }
    }));
    stages.extend(&host[core..]);
    stages
}
