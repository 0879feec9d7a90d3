//! `--view`: a live page beside what a command does.

use std::ops::RangeInclusive;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use image::GrayImage;

use super::model::{self, Model, NoModel, Order};
use super::options::SceneArgs;
use super::{Failure, note};
use crate::calibration::StereoCamera;
use crate::live::control::{Limits, Settings};
use crate::live::{LiveError, Shot, View};
use crate::reconstruct::{Options, Reconstruction, Workspace};
use crate::report::record::Record;
use crate::source::scene::{Known, Scene};

/// Pairs a second that can be asked for.
const RATES: RangeInclusive<f64> = 0.001..=1000.0;
/// Longest that is waited without a look at whether to stop.
const LOOK: Duration = Duration::from_millis(50);

/// The flag.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct ViewArgs {
    /// Show each pair on a page in a browser of this machine, at this port [default: any free one]; files are left
    /// only if --out is given
    #[arg(long, value_name = "PORT", num_args = 0..=1, default_missing_value = "0", value_parser = port)]
    view: Option<u16>,
}

impl ViewArgs {
    /// Serves the page, if it is wanted, and says where.
    pub(super) fn open(
        &self,
        title: &str,
        settings: Settings,
        limits: impl FnOnce() -> Limits,
    ) -> Result<Option<View>, LiveError> {
        let Some(port) = self.view else { return Ok(None) };
        let view = View::open(port, title, settings, limits())?;
        note(&format!("live at {}", view.address()));
        Ok(Some(view))
    }

    pub(super) const fn is_wanted(&self) -> bool {
        self.view.is_some()
    }
}

fn port(text: &str) -> Result<u16, String> {
    text.parse()
        .map_err(|_| "give a port from 1 to 65535, or none; what is no port goes before --view".into())
}

/// How many pairs a second are shown at most.
pub(super) fn rate(text: &str) -> Result<f64, String> {
    let rate = text.parse::<f64>().ok().filter(|rate| RATES.contains(rate));
    rate.ok_or_else(|| format!("must be {} to {}", RATES.start(), RATES.end()))
}

/// What of a pair is not its model.
pub(super) struct Beside {
    pub(super) name: String,
    /// As they were taken.
    pub(super) pictures: Option<[GrayImage; 2]>,
    pub(super) remarks: Vec<String>,
    /// Pairs that the source had to drop so far.
    pub(super) dropped: u64,
    pub(super) arrived: Instant,
}

/// Reconstructs, writes if there is a place, and shows it, whether it is refused or not.
pub(super) fn make(
    order: Order<'_>,
    beside: Beside,
    view: &mut View,
    workspace: &mut Workspace,
) -> Result<Model, Failure> {
    let choices = (*order.calibration, *order.options);
    let mut record = Record::new();
    let made = model::make_recorded(order, &mut record, workspace);
    show((made, record), choices, beside, view, workspace)
}

/// Shows what was made of a pair, or why nothing was; what the page no longer needs goes back to the workspace.
pub(super) fn show(
    (made, record): (Result<(Model, Reconstruction), Failure>, Record),
    (calibration, options): (StereoCamera, Options),
    beside: Beside,
    view: &mut View,
    workspace: &mut Workspace,
) -> Result<Model, Failure> {
    let (told, made) = match made {
        Ok((model, made)) => (Ok(model), Ok(made)),
        Err(failure) => {
            let refused: Box<NoModel> = failure.downcast()?;
            let refusal = Arc::clone(&refused.refusal);
            (Err(refused.into()), Err(refusal))
        }
    };
    let Beside { name, pictures, remarks, dropped, arrived } = beside;
    let shot = Shot { name, pictures, calibration, options, record, made, remarks, dropped, arrived };
    if let Some(Ok(before)) = view.show(shot).map(|before| before.made) {
        workspace.recycle(before);
    }
    told
}

/// What the next pair of pictures is to be made with.
pub(super) fn obey(settings: &Settings, options: &mut Options, scene: &mut Scene) {
    (options.threshold, options.polarity) = (settings.threshold, settings.polarity);
    scene.region = settings.region;
    options.scene = Known { region: settings.region, ..options.scene };
}

/// Whether the object's side of the level can be set.
pub(super) fn polarity(scene: &SceneArgs) -> Result<(), &'static str> {
    if scene.takes_background() { Err("what --background leaves is always bright") } else { Ok(()) }
}

/// The settings to begin with.
pub(super) fn settings(options: &Options) -> Settings {
    let Options { threshold, polarity, .. } = *options;
    Settings { threshold, polarity, region: options.scene.region, exposure: None }
}

/// Says which flags would have set what was set at last.
pub(super) fn tell_flags(view: &View, before: &Settings) {
    let settings = view.control().settings().0;
    if settings.flags() != before.flags() {
        let flags = settings.flags();
        note(&format!(
            "set on the page: {}",
            if flags.is_empty() { "nothing that is not so anyway" } else { &flags }
        ));
    }
}

/// A pace at which to go through what waits.
pub(super) struct Pace {
    period: Option<Duration>,
    next: Instant,
}

impl Pace {
    /// So many steps a second, as [`rate`] takes them, or as fast as it goes.
    pub(super) fn new(rate: Option<f64>) -> Self {
        Self { period: rate.map(|rate| Duration::from_secs_f64(1.0 / rate)), next: Instant::now() }
    }

    /// Waits for the next step, or until `stop` is set.
    pub(super) fn wait(&mut self, stop: &AtomicBool) {
        let Some(period) = self.period else { return };
        while !stop.load(Ordering::Relaxed) {
            let left = self.next.saturating_duration_since(Instant::now());
            if left.is_zero() {
                break;
            }
            thread::sleep(left.min(LOOK));
        }
        // Who is late does not hurry afterwards.
        self.next = (self.next + period).max(Instant::now());
    }
}

/// Waits until something is set or `stop` is; returns whether there is something to be done.
pub(super) fn wait(view: &View, version: u64, stop: &AtomicBool) -> bool {
    while !stop.load(Ordering::Relaxed) {
        if view.control().wait(version, LOOK) {
            return true;
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rate_is_one_that_can_be_waited_for() {
        for text in ["0.001", "5", "1000"] {
            Pace::new(Some(rate(text).unwrap())).wait(&AtomicBool::new(false));
        }
        for text in ["1e-300", "1e-19", "0", "-1", "1001", "inf", "nan", "x", ""] {
            assert_eq!(rate(text).unwrap_err(), "must be 0.001 to 1000", "{text}");
        }
    }
}
