//! Models from a camera device, as it describes one pair after the other.
//!
//! The device finds the object in its pictures, matches the views and sends a description of some kilobytes; this
//! end grows the solid from it. What the pictures mean is the calibration that the device keeps; the same file
//! must be given here (`host device calibrate` uploads it, and check sums tell one from another).
//!
//! Each pair leaves a folder of its own in --out, numbered as they come, as `host replay` does; what does not
//! give a trustworthy model is refused with the reason, and the others go on. A device that is unplugged or
//! starts anew is waited for. It goes on until --frames pairs have come, --seconds have passed, or Ctrl-C, which
//! ends after the model at hand; a second one ends at once.
//!
//! --view shows each pair on a page in the browser, where threshold, polarity and exposure can be set, which the device is
//! then told; it begins with otsu and bright unless the flags say otherwise. Models are written only if --out is given.
//! docs/live.md tells more.
//!
//! With --front grey or auto the device sends the pictures of each pair as well, 150 KB, in which the visible side is
//! measured; a pair whose pictures did not come is made of balls, with a warning.
//!
//! --record keeps what came, byte for byte; `host replay FILE` makes the same models of it again.
//!
//! --publish tells a fleet of shapes, models and how the device fares, and takes orders from it (docs/fleet.md). Several
//! devices are listened to side by side when each has its own --port, --calib and --publish; their models are then below
//! --out/SITE/BOARD.
//!
//! With --json, every pair is a line of JSON when it is done, and the last line is about the link.
//!
//! Examples:
//!   host listen --calib calib.yaml
//!   host listen --port /dev/ttyACM0 --calib calib.yaml --frames 10 --out models
//!   host listen --calib calib.yaml --view
//!   host listen --port unix:/tmp/camera --calib calib.yaml --record cup.link --json
//!   host listen --port /dev/ttyACM0 --calib calib.yaml --publish ossature/lab/left

mod desk;
mod orders;
mod recording;

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use clap::builder::ArgPredicate;
use shared::camera::PairModel;
use shared::stage::binarise::{Polarity, Threshold};
use shared::wire::ToDevice;

use super::connect::{PortArgs, model_of};
use super::options::{GrowArgs, usage};
use super::publish::PublishArgs;
use super::view::ViewArgs;
use super::{Failure, interruption, note, words_of};
use crate::fleet::Link;
use crate::fleet::key::Board;
use crate::live::control::{Control, Limits, Settings};
use crate::reconstruct::Options;
use crate::report::words::{parse_polarity, parse_threshold};
use crate::source::exposure::Range;
use crate::source::serial::inbox::Message;
use crate::source::serial::link::Tap;
use crate::source::serial::port::Address;
use crate::source::serial::recording::Writer;
use crate::source::serial::session::Session;
pub(super) use desk::Wanted;
use desk::{Audience, Desk};
use orders::Orders;
pub(super) use recording::replay;

/// Longest that is waited for a frame before time is looked at.
const LOOK: Duration = Duration::from_millis(250);

/// Lines that a device's sensors can expose.
const LINES: Range = Range { least: 1, most: 670, unit: "lines", auto: true };

/// Arguments of `listen`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    port: PortArgs,
    /// Calibration that the device keeps: OpenCV (M1 D1 M2 D2 R T), ROS or Kalibr
    #[arg(long, value_name = "FILE", required = true)]
    calib: Vec<PathBuf>,
    /// Have the device part object and background here, instead of as it was told before
    #[arg(long, value_parser = parse_threshold, value_name = "otsu|N")]
    threshold: Option<Threshold>,
    /// Have the device look for a brighter or a darker object, instead of as it was told before
    #[arg(long, value_parser = parse_polarity, value_name = "bright|dark|auto")]
    polarity: Option<Polarity>,
    #[command(flatten)]
    grow: GrowArgs,
    /// Stop after so many pairs
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    frames: Option<u32>,
    /// Stop after so many seconds
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    seconds: Option<u32>,
    /// Keep what comes in a new file
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    #[command(flatten)]
    view: ViewArgs,
    /// Folder for the results
    #[arg(
        long,
        value_name = "DIR",
        default_value_ifs([("view", ArgPredicate::IsPresent, None), ("publish", ArgPredicate::IsPresent, None)]),
        default_value = "ossature-out"
    )]
    out: Option<PathBuf>,
    /// Tell on standard error how long each stage took
    #[arg(long)]
    timings: bool,
    /// Leave report.html as well, a page that shows all of it in a browser
    #[arg(long)]
    report: bool,
    /// Print lines of JSON instead of text
    #[arg(long)]
    pub(super) json: bool,
    #[command(flatten)]
    publish: PublishArgs,
}

/// One device among those that are listened to.
struct Seat<'a> {
    port: &'a Address,
    calib: &'a Path,
    /// What a fleet knows it as.
    board: Option<&'a Board>,
    /// None if models are only looked at.
    out: Option<PathBuf>,
    /// Whether it has to be told from others.
    is_named: bool,
}

impl Args {
    fn seats(&self) -> Result<Vec<Seat<'_>>, Failure> {
        let (ports, boards) = (self.port.all(), self.publish.boards());
        if let ([port], [calib], [] | [_]) = (ports, &self.calib[..], boards) {
            let (board, out) = (boards.first(), self.out.clone());
            return Ok(vec![Seat { port, calib, board, out, is_named: false }]);
        }
        if [self.calib.len(), boards.len()] != [ports.len(); 2] {
            return Err(usage(
                "each device has its own --port, --calib and --publish, in the same order: give as many of each",
            ));
        }
        if (1..boards.len()).any(|k| boards[..k].contains(&boards[k])) {
            return Err(usage("two devices are published under one name: give each its own"));
        }
        if self.view.is_wanted() || self.record.is_some() {
            return Err(usage(
                "--view and --record are for one device; `host subscribe --view` shows several",
            ));
        }
        Ok(ports
            .iter()
            .zip(&self.calib)
            .zip(boards)
            .map(|((port, calib), board)| {
                let out = self.out.as_ref().map(|out| out.join(board.site()).join(board.name()));
                Seat { port, calib, board: Some(board), out, is_named: true }
            })
            .collect())
    }
}

/// Listens.
///
/// # Errors
///
/// If there is no device, its calibration is another, or no pair gives a model.
pub fn run(args: &Args) -> Result<(), Failure> {
    let seats = args.seats()?;
    let (stop, link) = (interruption()?, args.publish.meet()?);
    if let [seat] = &seats[..] {
        return one(args, seat, link.as_ref(), &stop);
    }
    // What one of them fails by is told at once, and the others go on.
    let failed = |seat: &Seat<'_>| {
        let failure = one(args, seat, link.as_ref(), &stop).err()?;
        let name = seat.board.map_or_else(String::new, Board::to_string);
        note(&format!("{name}: {}", words_of(&*failure)));
        Some(name)
    };
    let failed: Vec<String> = thread::scope(|scope| {
        let threads: Vec<_> = seats.iter().map(|seat| scope.spawn(|| failed(seat))).collect();
        let joined = threads.into_iter().map(|thread| thread.join());
        joined.filter_map(|name| name.unwrap_or_else(|panic| std::panic::resume_unwind(panic))).collect()
    });
    if failed.is_empty() {
        return Ok(());
    }
    Err(format!("{} of {} devices failed: {}", failed.len(), seats.len(), failed.join(", ")).into())
}

/// Listens to one device.
fn one(args: &Args, seat: &Seat<'_>, link: Option<&Link>, stop: &AtomicBool) -> Result<(), Failure> {
    let model = model_of(seat.calib)?;
    let draft = seat.out.is_none() && link.is_none();
    let options = Options { draft, ..args.grow.device_options() };
    let wanted = Wanted { page: args.report, json: args.json, timings: args.timings };
    let asked = Settings {
        threshold: args.threshold.unwrap_or_default(),
        polarity: args.polarity.unwrap_or_default(),
        ..Settings::default()
    };
    let view = args.view.open("a camera device", asked, limits)?;
    let fleet = link.zip(seat.board);
    let control = match &view {
        Some(view) => Some(Arc::clone(view.control())),
        None => fleet.map(|_| {
            // A fleet shows and sends what somebody has said, not what the device has from before.
            let said = [args.threshold.is_some(), args.polarity.is_some()];
            Arc::new(Control::new(asked, limits()).knowing(said))
        }),
    };
    let voice =
        fleet.zip(control.as_ref()).map(|((link, board), control)| args.publish.voice(link, board, control));
    let name = seat.board.filter(|_| seat.is_named).map(Board::to_string);
    let audience = Audience { view, voice: voice.transpose()?, control, name };
    let mut desk = Desk::new((&model, &options), (seat.out.as_deref(), wanted), audience);
    let end = args.seconds.map(|seconds| Instant::now() + Duration::from_secs(seconds.into()));
    let (mut session, tap) = begin(args, seat.port, &model, &mut desk)?;
    let mut orders = Orders::new(args, asked, &options, desk.audience.view.is_some());
    let heard = listen(args, (&mut session, &mut orders), &mut desk, || {
        stop.load(Ordering::Relaxed) || end.is_some_and(|end| Instant::now() >= end)
    });
    // The device may be gone; it stops by itself when it starts anew.
    let stopped = heard.as_ref().map_or(Ok(()), |()| session.order(&ToDevice::Stop));
    if stopped.is_err() {
        desk.remark("the device was not there any more to be told to stop");
    }
    let tally = session.tally();
    // Nothing comes after it.
    drop(session);
    let recorded = tap.map_or(Ok(()), |tap| tap.lock().unwrap_or_else(PoisonError::into_inner).finish());
    heard?;
    recorded?;
    desk.close(&tally)
}

/// Find the device and greet it. The recording has to be new before anything comes, and is taken away again if
/// there is nothing to record.
fn begin(
    args: &Args,
    port: &Address,
    model: &PairModel,
    desk: &mut Desk<'_>,
) -> Result<(Session, Option<Tap>), Failure> {
    let recording = args.record.as_ref().map(|path| Writer::begin(path, model)).transpose()?;
    let tap = recording.map(|writer| Arc::new(Mutex::new(writer)));
    let begun = args.port.begin(port, tap.clone()).map_err(Failure::from);
    let greeted = begun.and_then(|(session, hello)| desk.greeted(&hello).map(|()| (session, tap)));
    if let (Err(_), Some(path)) = (&greeted, &args.record) {
        // Why there is no device matters more than a file that stays.
        let _ = fs::remove_file(path);
    }
    greeted
}

fn listen(
    args: &Args,
    (session, orders): (&mut Session, &mut Orders),
    desk: &mut Desk<'_>,
    over: impl Fn() -> bool,
) -> Result<(), Failure> {
    let mut started = false;
    while args.frames.is_none_or(|frames| desk.pairs < frames) && !over() {
        let came = if started {
            orders.follow(session, desk).and_then(|()| session.receive(LOOK))
        } else {
            orders.start(session, desk).map(|()| None)
        };
        started = true;
        match came {
            Ok(Some((message, first))) => {
                if first && let Message::Hello(hello) = &message {
                    desk.remark("the device has started anew");
                    desk.greeted(hello)?;
                    started = false;
                }
                orders.note(&message);
                let lost = session.tally().frames.missing;
                desk.take(session.inbox(), message, lost)?;
            }
            Ok(None) => {}
            Err(error) if error.is_loss() => {
                desk.lost(&words_of(&error), &session.tally());
                let Some(hello) = session.resume(&over, |error| desk.remark(&words_of(error)))? else {
                    break;
                };
                desk.greeted(&hello)?;
                started = false;
            }
            Err(error) => return Err(error.into()),
        }
        desk.show(&session.tally());
    }
    Ok(())
}

/// What can be set of a device.
fn limits() -> Limits {
    let region = Err("a device looks at all of its pictures");
    Limits { threshold: Ok(()), polarity: Ok(()), region, exposure: Ok(LINES), pairs: Ok(()) }
}
