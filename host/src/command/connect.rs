//! What the commands that talk to a device have in common: where it is, its calibration, and how its link fares.

use std::io::IsTerminal;
use std::path::Path;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};
use serde_json::{Value, json};
use shared::camera::PairModel;
use shared::wire::{Health, calibration_crc};

use super::Failure;
use super::options::usage;
use super::table::count;
use crate::calibration::StereoCamera;
use crate::source::serial::inbox::Hello;
use crate::source::serial::link::Tap;
use crate::source::serial::port::Address;
use crate::source::serial::session::{Session, SessionError, Tally};
use crate::stage::rectify::Rectification;

/// Where the device is.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Device")]
pub(super) struct PortArgs {
    /// Port of the device: a serial port, the path of a socket, or auto for the only one plugged in; `host listen` takes
    /// several
    #[arg(long, global = true, value_name = "PATH|auto", default_value = "auto")]
    port: Vec<Address>,
    /// Rate of a serial port with wires; USB has its own
    #[arg(long, global = true, value_name = "BAUD", default_value_t = 921_600, value_parser = clap::value_parser!(u32).range(300..))]
    baud: u32,
}

impl PortArgs {
    /// The ports.
    pub(super) fn all(&self) -> &[Address] {
        &self.port
    }

    /// The only port.
    pub(super) fn only(&self) -> Result<&Address, Failure> {
        match &self.port[..] {
            [port] => Ok(port),
            _ => Err(usage("this is done with one device at a time: give one --port")),
        }
    }

    /// Open a port and exchange hellos; what comes is recorded by `tap`.
    pub(super) fn begin(&self, port: &Address, tap: Option<Tap>) -> Result<(Session, Hello), SessionError> {
        let (port, baud) = (port.clone(), self.baud);
        Session::begin(Box::new(move || port.open(baud)), tap)
    }
}

/// The model that a device makes of a calibration file.
pub(super) fn model_of(path: &Path) -> Result<PairModel, Failure> {
    let model = Rectification::same_size(&StereoCamera::read(path)?)?.model();
    model.check()?;
    Ok(model)
}

/// Holds the calibration of the shapes to come against that of the device.
pub(super) fn check_calibration(model: &PairModel, hello: &Hello) -> Result<(), Failure> {
    let (width, height) = (model.width, model.height);
    let [w, h] = hello.picture;
    if hello.picture != [width, height] {
        return Err(format!(
            "the calibration is of pictures of {width}x{height} px, the device takes {w}x{h}; calibrate its own pictures \
             (`host device grab grey`)"
        )
        .into());
    }
    let ours = calibration_crc(model);
    match hello.calibration {
        Some(theirs) if theirs == ours => Ok(()),
        Some(theirs) => Err(format!(
            "the device keeps another calibration ({theirs:08x}) than this file's ({ours:08x}): give the file that was \
             uploaded, or upload this one with `host device calibrate FILE`"
        )
        .into()),
        None => Err("the device keeps no calibration; upload one with `host device calibrate FILE`".into()),
    }
}

/// A line of progress, on a terminal alone.
pub(super) fn progress() -> ProgressBar {
    if !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new_spinner();
    if let Ok(style) = ProgressStyle::with_template("{spinner} {elapsed} {msg}") {
        bar.set_style(style);
    }
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}

/// How the link fared, in words; nothing where nothing was wrong.
pub(super) fn link_in_words(tally: &Tally) -> Option<String> {
    let frames = &tally.frames;
    let parts = [
        (frames.rejected_frames(), "damaged frame", "damaged frames"),
        (frames.missing, "frame missing", "frames missing"),
        (frames.repeated, "frame sent twice", "frames sent twice"),
        (tally.unreadable, "frame that could not be read", "frames that could not be read"),
        (tally.reconnections, "reconnection", "reconnections"),
    ];
    let told: Vec<String> =
        parts.iter().filter(|(n, ..)| *n > 0).map(|(n, one, many)| count(*n as usize, one, many)).collect();
    (!told.is_empty()).then(|| told.join(", "))
}

/// How the link fared.
pub(super) fn link_as_json(tally: &Tally) -> Value {
    let frames = &tally.frames;
    json!({
        "frames": frames.frames,
        "bad_crc": frames.bad_crc,
        "oversize": frames.oversize,
        "malformed": frames.malformed,
        "partial": frames.partial,
        "missing": frames.missing,
        "repeated": frames.repeated,
        "rejected_bytes": frames.rejected_bytes,
        "unreadable": tally.unreadable,
        "reconnections": tally.reconnections,
    })
}

/// Who a device is.
pub(super) fn hello_as_json(hello: &Hello) -> Value {
    json!({
        "board": hello.board,
        "firmware": version(hello),
        "sensors": hello.sensors,
        "picture_px": hello.picture,
        "most_contour_points": hello.capacities.contour,
        "most_branches": hello.capacities.branches,
        "most_control_points": hello.capacities.controls,
        "reset": reset(hello),
        "calibration_crc": hello.calibration.map(|crc| format!("{crc:08x}")),
    })
}

/// How a device fares.
pub(super) fn health_as_json(health: &Health) -> Value {
    json!({
        "uptime_ms": health.uptime,
        "pairs": health.pairs,
        "refused": health.refused,
        "dropped": health.dropped,
        "timeouts": health.timeouts,
        "restarts": health.restarts,
        "rejected_bytes": health.rejected_bytes,
        "rejected_frames": health.rejected_frames,
        "watchdog_resets": health.watchdog_resets,
        "storage_faults": health.storage_faults,
    })
}

/// The version of its firmware.
pub(super) fn version(hello: &Hello) -> String {
    let [major, minor, patch] = hello.firmware;
    format!("{major}.{minor}.{patch}")
}

/// Why it started.
pub(super) const fn reset(hello: &Hello) -> &'static str {
    use shared::wire::ResetReason;
    match hello.reset {
        ResetReason::Unknown => "unknown",
        ResetReason::Power => "power",
        ResetReason::Pin => "pin",
        ResetReason::Watchdog => "watchdog",
        ResetReason::Software => "software",
        ResetReason::BrownOut => "brown-out",
    }
}
