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
//! --record keeps what came, byte for byte; `host replay FILE` makes the same models of it again.
//!
//! With --json, every pair is a line of JSON when it is done, and the last line is about the link.
//!
//! Examples:
//!   host listen --calib calib.yaml
//!   host listen --port /dev/ttyACM0 --calib calib.yaml --frames 10 --out models
//!   host listen --calib calib.yaml --view
//!   host listen --port unix:/tmp/camera --calib calib.yaml --record cup.link --json

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use clap::builder::ArgPredicate;
use indicatif::ProgressBar;
use serde_json::{Value, json};
use shared::camera::PairModel;
use shared::stage::binarise::{Polarity, Threshold};
use shared::wire::{self, Decoder, ExposureSetting, MAX_FRAME, ToDevice};

use super::connect::{
    PortArgs, check_calibration, hello_as_json, link_as_json, link_in_words, model_of, progress, version,
};
use super::model::{self, Model, NoModel, Place};
use super::options::GrowArgs;
use super::table::{count, sides};
use super::timings::Timings;
use super::view::{self, Beside, Pace, ViewArgs};
use super::{Failure, interruption, note, say, words_of};
use crate::live::View;
use crate::live::control::{Limits, Settings};
use crate::reconstruct::{Options, Workspace};
use crate::report::record::Record;
use crate::report::words::{parse_polarity, parse_threshold};
use crate::source::exposure::{Exposure, Range};
use crate::source::serial::inbox::{Hello, Inbox, Message, Pair};
use crate::source::serial::link::frames;
use crate::source::serial::recording::{Recording, Writer};
use crate::source::serial::session::{Session, SessionError, Tally};

/// Longest that is waited for a frame before time is looked at.
const LOOK: Duration = Duration::from_millis(250);

/// Lines that a device's sensors can expose.
const LINES: Range = Range { least: 1, most: 670, unit: "lines", auto: true };
/// What a device can be told of how it looks.
const ORDERS: [&str; 3] = ["threshold", "polarity", "exposure"];
/// What a line of a sensor is amplified by before a pair has come that says so, 1/256.
const GAIN: u16 = 256;

/// Arguments of `listen`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    port: PortArgs,
    /// Calibration that the device keeps: OpenCV (M1 D1 M2 D2 R T), ROS or Kalibr
    #[arg(long, value_name = "FILE")]
    calib: PathBuf,
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
        default_value_if("view", ArgPredicate::IsPresent, None),
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
}

/// Listens.
///
/// # Errors
///
/// If there is no device, its calibration is another, or no pair gives a model.
pub fn run(args: &Args) -> Result<(), Failure> {
    let model = model_of(&args.calib)?;
    let options = Options { draft: args.out.is_none(), ..args.grow.device_options() };
    let wanted = Wanted { page: args.report, json: args.json, timings: args.timings };
    let asked = Settings {
        threshold: args.threshold.unwrap_or_default(),
        polarity: args.polarity.unwrap_or_default(),
        ..Settings::default()
    };
    let view = args.view.open("a camera device", asked, limits)?;
    let mut desk = Desk::new((&model, &options), (args.out.as_deref(), wanted), view);
    let end = args.seconds.map(|seconds| Instant::now() + Duration::from_secs(seconds.into()));
    let stop = interruption()?;
    let mut session = begin(args, &model, &mut desk)?;
    let mut orders = Orders::new(args, asked);
    let heard = listen(args, (&mut session, &mut orders), &mut desk, || {
        stop.load(Ordering::Relaxed) || end.is_some_and(|end| Instant::now() >= end)
    });
    // The device may be gone; it stops by itself when it starts anew.
    let stopped = heard.as_ref().map_or(Ok(()), |()| session.order(&ToDevice::Stop));
    if stopped.is_err() {
        desk.remark("the device was not there any more to be told to stop");
    }
    heard?;
    desk.close(&session.tally())
}

/// Find the device and greet it. The recording has to be new before anything comes, and is taken away again if
/// there is nothing to record.
fn begin(args: &Args, model: &PairModel, desk: &mut Desk<'_>) -> Result<Session, Failure> {
    let recording = args.record.as_ref().map(|path| Writer::begin(path, model)).transpose()?;
    let tap = recording.map(|writer| Arc::new(Mutex::new(writer)));
    let begun = args.port.begin(tap).map_err(Failure::from);
    let greeted = begun.and_then(|(session, hello)| desk.greeted(&hello).map(|()| session));
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
                let lost = session.tally().frames.missing;
                desk.take(session.inbox(), message, lost)?;
            }
            Ok(None) => {}
            Err(error) if error.is_loss() => {
                desk.remark(&format!("{}; waiting for the device", words_of(&error)));
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
    Limits { threshold: Ok(()), polarity: Ok(()), region, exposure: Ok(LINES) }
}

/// What the device is to be told: nothing that nobody has said.
struct Orders {
    /// For a device that begins, one of each of [`ORDERS`]: what was asked for at first, and what it obeyed since.
    kept: [Option<ToDevice>; ORDERS.len()],
    /// What of the page the device was told.
    settings: Settings,
}

impl Orders {
    /// What the flags say, and with a page all that it shows as set.
    fn new(args: &Args, settings: Settings) -> Self {
        let shown = args.view.is_wanted();
        let threshold = args.threshold.or_else(|| shown.then_some(settings.threshold));
        let polarity = args.polarity.or_else(|| shown.then_some(settings.polarity));
        Self { kept: [threshold.map(ToDevice::Threshold), polarity.map(ToDevice::Polarity), None], settings }
    }

    /// Has a device that was greeted begin.
    fn start(&self, session: &mut Session, desk: &mut Desk<'_>) -> Result<(), SessionError> {
        for (which, order) in self.kept.iter().enumerate() {
            if let Some(order) = order {
                desk.give(session, which, order)?;
            }
        }
        session.order_cameras(&ToDevice::Start)
    }

    /// Passes on what was changed on the page.
    fn follow(&mut self, session: &mut Session, desk: &mut Desk<'_>) -> Result<(), SessionError> {
        let Some(view) = &desk.view else { return Ok(()) };
        let ((settings, _), before) = (view.control().settings(), self.settings);
        let exposure = settings.exposure.filter(|_| settings.exposure != before.exposure);
        let exposure = exposure.map(|exposure| match exposure {
            Exposure::Auto => ExposureSetting::Auto,
            Exposure::Fixed(lines) => ExposureSetting::Fixed(desk.gains.map(|gain| {
                let lines = u16::try_from(lines).unwrap_or(u16::MAX);
                wire::Exposure { lines, gain }
            })),
        });
        let changed = [
            (settings.threshold != before.threshold).then_some(ToDevice::Threshold(settings.threshold)),
            (settings.polarity != before.polarity).then_some(ToDevice::Polarity(settings.polarity)),
            exposure.map(ToDevice::Exposure),
        ];
        for (which, order) in changed.into_iter().enumerate() {
            if let Some(order) = order
                && desk.give(session, which, &order)?
            {
                self.kept[which] = Some(order);
            }
        }
        // Not before: what a device did not hear, because it was lost, it is told when it is back.
        self.settings = settings;
        Ok(())
    }
}

/// What is wanted beside the models.
#[derive(Clone, Copy)]
pub(super) struct Wanted {
    /// A page about each.
    pub(super) page: bool,
    /// JSON in place of text.
    pub(super) json: bool,
    /// How long each stage took.
    pub(super) timings: bool,
}

/// Makes the models of a recording again, on a live page at a rate if there is one.
///
/// # Errors
///
/// If the recording cannot be read, or no pair gives a model.
pub(super) fn replay(
    path: &Path,
    options: &Options,
    place: (Option<&Path>, Wanted),
    view: Option<(View, Option<f64>)>,
) -> Result<(), Failure> {
    let recording = Recording::read(path)?;
    let (view, rate) = view.map_or((None, None), |(view, rate)| (Some(view), rate));
    let stop = if view.is_some() { interruption()? } else { Arc::default() };
    let mut pace = Pace::new(rate);
    let mut desk = Desk::new((&recording.calibration, options), place, view);
    let (mut inbox, mut tally) = (Inbox::new()?, Tally::default());
    for (k, bytes) in recording.connections.iter().enumerate() {
        let mut buffer = vec![0; MAX_FRAME];
        let mut decoder = Decoder::new(&mut buffer);
        let mut arrived = Vec::new();
        frames(&mut decoder, bytes, |frame| arrived.push(frame));
        let mut greeted = false;
        for frame in arrived {
            match inbox.read(&frame.frame()) {
                // What a device said before it was greeted is of another time.
                Ok(Message::Hello(hello)) if !greeted => {
                    greeted = true;
                    desk.greeted(&hello)?;
                }
                Ok(message) if greeted && !stop.load(Ordering::Relaxed) => {
                    if matches!(message, Message::Pair(_)) {
                        pace.wait(&stop);
                    }
                    desk.take(&mut inbox, message, 0)?;
                }
                Ok(_) => {}
                Err(_) => tally.unreadable = tally.unreadable.saturating_add(1),
            }
        }
        tally.add(decoder.counters());
        tally.reconnections = u32::try_from(k).unwrap_or(u32::MAX);
    }
    desk.hold(&stop);
    desk.close(&tally)
}

/// Where messages become models and words.
struct Desk<'a> {
    model: &'a PairModel,
    options: &'a Options,
    /// None if models are only looked at.
    out: Option<&'a Path>,
    page: bool,
    json: bool,
    /// The live page, if it is wanted.
    view: Option<View>,
    /// Of both eyes in the last pair, 1/256.
    gains: [u16; 2],
    /// What the device refused of what was set last: one of each of [`ORDERS`].
    refusals: [Option<String>; ORDERS.len()],
    /// If they are wanted.
    timings: Option<Timings>,
    workspace: Workspace,
    bar: ProgressBar,
    start: Instant,
    pairs: u32,
    models: u32,
}

impl<'a> Desk<'a> {
    fn new(
        (model, options): (&'a PairModel, &'a Options),
        (out, wanted): (Option<&'a Path>, Wanted),
        view: Option<View>,
    ) -> Self {
        let Wanted { page, json, timings } = wanted;
        Self {
            model,
            options,
            out,
            page,
            json,
            view,
            gains: [GAIN; 2],
            refusals: Default::default(),
            timings: timings.then(Timings::begin),
            workspace: Workspace::default(),
            bar: progress(),
            start: Instant::now(),
            pairs: 0,
            models: 0,
        }
    }

    /// Keeps the last pair on the page until the end.
    fn hold(&self, stop: &AtomicBool) {
        let Some(view) = &self.view else { return };
        if self.pairs == 0 {
            return;
        }
        if !stop.load(Ordering::Relaxed) {
            self.remark("that was the last pair, which stays on the page until Ctrl-C");
        }
        let (_, mut version) = view.control().settings();
        while view::wait(view, version, stop) {
            version = view.control().settings().1;
        }
    }

    /// Gives the device one of [`ORDERS`]; returns whether it obeys. With a page, a refusal is told and goes on.
    fn give(&mut self, session: &mut Session, which: usize, order: &ToDevice) -> Result<bool, SessionError> {
        let refusal = match session.order(order) {
            Ok(()) => None,
            Err(error @ SessionError::Refused(_)) if self.view.is_some() => {
                Some(format!("{}: {}", ORDERS[which], words_of(&error)))
            }
            Err(error) => return Err(error),
        };
        if let Some(words) = &refusal
            && refusal != self.refusals[which]
        {
            self.remark(words);
        }
        let obeys = refusal.is_none();
        self.refusals[which] = refusal;
        Ok(obeys)
    }

    /// A line to standard error.
    fn remark(&self, line: &str) {
        self.bar.suspend(|| note(line));
    }

    /// A line to standard output.
    fn line(&self, json: impl FnOnce() -> Value, text: impl FnOnce() -> String) -> Result<(), Failure> {
        let line = if self.json { json().to_string() } else { text() };
        self.bar.suspend(|| say(&format!("{line}\n")))
    }

    fn greeted(&mut self, hello: &Hello) -> Result<(), Failure> {
        check_calibration(self.model, hello)?;
        self.line(
            || json!({ "device": hello_as_json(hello) }),
            || {
                format!(
                    "{}, firmware {}, {}x{} px",
                    hello.board,
                    version(hello),
                    hello.picture[0],
                    hello.picture[1]
                )
            },
        )
    }

    /// One message; so many before it were lost.
    fn take(&mut self, inbox: &mut Inbox, message: Message, lost: u32) -> Result<(), Failure> {
        let Message::Pair(pair) = message else { return Ok(()) };
        self.pairs += 1;
        let name = format!("{:06}", self.pairs);
        let folder = self.out.map(|out| out.join(&name));
        let told = heading(&pair);
        self.gains = pair.exposures.map(|exposure| exposure.gain);
        match self.make((inbox, *pair), (name, folder.as_deref()), lost) {
            Ok(model) => {
                self.models += 1;
                if let Some(timings) = &mut self.timings {
                    timings.add(None, &model);
                }
                let warnings = &model.warnings;
                self.line(
                    || {
                        let (mut told, more) = (
                            told.clone(),
                            json!({
                                "folder": folder.as_ref().map(|folder| folder.display().to_string()),
                                "warnings": warnings,
                                "report": model.report,
                            }),
                        );
                        merge(&mut told, more);
                        told
                    },
                    || described(&told, &model, warnings, folder.as_deref()),
                )
            }
            Err(failure) if failure.is::<NoModel>() => {
                let sentence = words_of(&*failure);
                self.line(
                    || {
                        let mut told = told.clone();
                        merge(&mut told, json!({ "error": sentence }));
                        told
                    },
                    || format!("pair {}: refused: {sentence}", told["pair"]),
                )
            }
            Err(failure) => Err(failure),
        }
    }

    /// The model of a pair, in its folder if there is one, and on the page if there is one.
    fn make(
        &mut self,
        pair: (&mut Inbox, Pair),
        (name, folder): (String, Option<&Path>),
        lost: u32,
    ) -> Result<Model, Failure> {
        let arrived = Instant::now();
        let mut record = Record::figures_only();
        let place = Place { folder, report: self.json, page: self.page };
        let made = model::receive(pair, (self.model, self.options), place, &mut record, &mut self.workspace);
        let Some(view) = &mut self.view else {
            let (model, made) = made?;
            self.workspace.recycle(made);
            return Ok(model);
        };
        let remarks = self.refusals.iter().flatten().cloned().collect();
        let beside = Beside { name, pictures: None, remarks, dropped: lost.into(), arrived };
        let choices = (self.model.into(), *self.options);
        view::show((made, record), choices, beside, view, &mut self.workspace)
    }

    /// How it goes, on a terminal.
    fn show(&self, tally: &Tally) {
        let rate = f64::from(self.pairs) / self.start.elapsed().as_secs_f64().max(1e-3);
        let link = link_in_words(tally).map_or_else(String::new, |words| format!("; {words}"));
        let (models, pairs) = (self.models, self.pairs);
        self.bar.set_message(format!("{models} models of {pairs} pairs, {rate:.2} a second{link}"));
    }

    fn close(self, tally: &Tally) -> Result<(), Failure> {
        self.bar.finish_and_clear();
        if let Some(timings) = &self.timings {
            timings.tell();
        }
        let (models, pairs) = (self.models, self.pairs);
        self.line(
            || json!({ "pairs": pairs, "models": models, "link": link_as_json(tally) }),
            || {
                let link = link_in_words(tally).map_or_else(String::new, |words| format!("; {words}"));
                format!("{models} of {} have a model{link}", count(pairs as usize, "pair", "pairs"))
            },
        )?;
        match (pairs, models) {
            (0, _) => Err("no pair came; look at the device's cameras (`host device info`)".into()),
            (_, 0) => Err("no pair gave a model".into()),
            _ => Ok(()),
        }
    }
}

/// What a device says of a pair beside its shape.
fn heading(pair: &Pair) -> Value {
    let exposure = |k: usize| {
        let exposure = pair.exposures[k];
        json!({ "lines": exposure.lines, "gain": f64::from(exposure.gain) / 256.0 })
    };
    json!({
        "pair": pair.number,
        "stamps_us": pair.stamps,
        "gap_us": pair.stamps[1].wrapping_sub(pair.stamps[0]).cast_signed(),
        "levels_grey": pair.levels,
        "exposures": [exposure(0), exposure(1)],
    })
}

/// Adds the fields of one object to another.
fn merge(into: &mut Value, from: Value) {
    if let (Some(into), Value::Object(from)) = (into.as_object_mut(), from) {
        into.extend(from);
    }
}

fn described(told: &Value, model: &Model, warnings: &[String], folder: Option<&Path>) -> String {
    let mut text = format!("pair {}: {}", told["pair"], sides(model.size));
    if let Some(folder) = folder {
        text.push_str(&format!(": {}", folder.display()));
    }
    for warning in warnings {
        text.push_str(&format!("\n  warning: {warning}"));
    }
    text
}
