//! Where messages become models and words.

use super::orders::ORDERS;
use crate::command::connect::{
    check_calibration, health_as_json, hello_as_json, link_as_json, link_in_words, progress, version,
};
use crate::command::model::{self, Model, NoModel, Place};
use crate::command::publish::Voice;
use crate::command::table::{count, sides};
use crate::command::timings::Timings;
use crate::command::view::{self, Beside};
use crate::command::{Failure, note, say, words_of};
use crate::live::View;
use crate::live::control::Control;
use crate::reconstruct::{Front, Options, Workspace};
use crate::report::record::Record;
use crate::source::serial::inbox::{Hello, Inbox, Message, Pair};
use crate::source::serial::mosaic::Mosaic;
use crate::source::serial::session::{Session, SessionError, Tally};
use indicatif::ProgressBar;
use serde_json::{Value, json};
use shared::camera::PairModel;
use shared::wire::{PictureKind, ToDevice};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// What a line of a sensor is amplified by before a pair has come that says so, 1/256.
const GAIN: u16 = 256;

/// What is wanted beside the models.
#[derive(Clone, Copy)]
pub(crate) struct Wanted {
    /// A page about each.
    pub(crate) page: bool,
    /// JSON in place of text.
    pub(crate) json: bool,
    /// How long each stage took.
    pub(crate) timings: bool,
}

/// Who looks on beside the one who started it, and may set things.
#[derive(Default)]
pub(super) struct Audience {
    /// The live page, if it is wanted.
    pub(super) view: Option<View>,
    /// A fleet, if it is wanted.
    pub(super) voice: Option<Voice>,
    /// What they set.
    pub(super) control: Option<Arc<Control>>,
    /// The device's name among others that are listened to.
    pub(super) name: Option<String>,
}

/// Where messages become models and words.
pub(super) struct Desk<'a> {
    model: &'a PairModel,
    options: &'a Options,
    /// None if models are only looked at.
    out: Option<&'a Path>,
    page: bool,
    json: bool,
    pub(super) audience: Audience,
    /// Of both eyes in the last pair, 1/256.
    pub(super) gains: [u16; 2],
    /// What the device refused of what was set last: one of each of [`ORDERS`].
    refusals: [Option<String>; ORDERS.len()],
    /// If they are wanted.
    timings: Option<Timings>,
    /// The pictures that came last.
    mosaic: Mosaic,
    workspace: Workspace,
    bar: ProgressBar,
    start: Instant,
    pub(super) pairs: u32,
    models: u32,
}

impl<'a> Desk<'a> {
    pub(super) fn new(
        (model, options): (&'a PairModel, &'a Options),
        (out, wanted): (Option<&'a Path>, Wanted),
        audience: Audience,
    ) -> Self {
        let Wanted { page, json, timings } = wanted;
        Self {
            model,
            options,
            out,
            page,
            json,
            bar: if audience.name.is_none() { progress() } else { ProgressBar::hidden() },
            audience,
            gains: [GAIN; 2],
            refusals: Default::default(),
            timings: timings.then(Timings::begin),
            mosaic: Mosaic::new(PictureKind::Grey),
            workspace: Workspace::default(),
            start: Instant::now(),
            pairs: 0,
            models: 0,
        }
    }

    /// Keeps the last pair on the page until the end.
    pub(super) fn hold(&self, stop: &AtomicBool) {
        let Some(view) = &self.audience.view else { return };
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

    /// Gives the device one of [`ORDERS`]; returns whether it obeys. With an audience, a refusal is told and goes on.
    pub(super) fn give(
        &mut self,
        session: &mut Session,
        which: usize,
        order: &ToDevice,
    ) -> Result<bool, SessionError> {
        let refusal = match session.order(order) {
            Ok(()) => None,
            Err(error @ SessionError::Refused(_)) if self.audience.control.is_some() => {
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
    pub(super) fn remark(&self, line: &str) {
        let line = self.named(line);
        self.bar.suspend(|| note(&line));
    }

    /// The device is gone, and is waited for.
    pub(super) fn lost(&mut self, why: &str, tally: &Tally) {
        self.remark(&format!("{why}; waiting for the device"));
        if let Some(voice) = &mut self.audience.voice {
            voice.gone(why, link_as_json(tally));
        }
    }

    /// Whose line it is, if there are several devices.
    fn named(&self, line: &str) -> String {
        self.audience.name.as_ref().map_or_else(|| line.to_owned(), |name| format!("{name}: {line}"))
    }

    /// A line to standard output.
    fn line(&self, json: impl FnOnce() -> Value, text: impl FnOnce() -> String) -> Result<(), Failure> {
        let line = if self.json {
            let mut told = json();
            if let Some(name) = &self.audience.name {
                merge(&mut told, json!({ "board": name }));
            }
            told.to_string()
        } else {
            self.named(&text())
        };
        self.bar.suspend(|| say(&format!("{line}\n")))
    }

    pub(super) fn greeted(&mut self, hello: &Hello) -> Result<(), Failure> {
        check_calibration(self.model, hello)?;
        // It numbers its pairs anew.
        self.mosaic = Mosaic::new(PictureKind::Grey);
        if let Some(voice) = &mut self.audience.voice {
            voice.greeted(hello_as_json(hello));
            voice.calibration(self.model);
        }
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
    pub(super) fn take(&mut self, inbox: &mut Inbox, message: Message, lost: u32) -> Result<(), Failure> {
        let pair = match (message, &mut self.audience.voice) {
            (Message::Pair(pair), _) => pair,
            (Message::Picture(part), _) if self.options.front != Front::Balls => {
                self.mosaic.add(&part);
                return Ok(());
            }
            (Message::Health(health), Some(voice)) => {
                voice.health(&health_as_json(&health));
                return Ok(());
            }
            _ => return Ok(()),
        };
        // One that was under way when no more were wanted is of no use.
        if self.audience.control.as_ref().is_some_and(|control| !control.take_pair()) {
            return Ok(());
        }
        self.pairs += 1;
        let name = format!("{:06}", self.pairs);
        let folder = self.out.map(|out| out.join(&name));
        let told = heading(&pair);
        self.gains = pair.exposures.map(|exposure| exposure.gain);
        if let Some(voice) = &mut self.audience.voice {
            voice.begin();
            voice.shape(inbox.frame(&pair)?);
        }
        match self.make((inbox, *pair), (name, folder.as_deref()), lost) {
            Ok(model) => {
                self.models += 1;
                if let Some(timings) = &mut self.timings {
                    timings.add(None, &model);
                }
                let warnings = &model.warnings;
                self.publish(&told, json!({ "warnings": warnings }), warnings);
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
                let error = json!({ "error": sentence });
                self.publish(&told, error.clone(), std::slice::from_ref(&sentence));
                self.line(
                    || {
                        let mut told = told.clone();
                        merge(&mut told, error);
                        told
                    },
                    || format!("pair {}: refused: {sentence}", told["pair"]),
                )
            }
            Err(failure) => Err(failure),
        }
    }

    /// Tells a fleet what became of a pair.
    fn publish(&mut self, told: &Value, more: Value, warnings: &[String]) {
        let Some(voice) = &mut self.audience.voice else { return };
        let mut told = told.clone();
        merge(&mut told, more);
        voice.pair(&told, warnings);
    }

    /// The model of a pair, in its folder if there is one, and on the page if there is one.
    fn make(
        &mut self,
        (inbox, pair): (&mut Inbox, Pair),
        (name, folder): (String, Option<&Path>),
        lost: u32,
    ) -> Result<Model, Failure> {
        let arrived = Instant::now();
        let mut record = Record::figures_only();
        let place = Place { folder, report: self.json, page: self.page };
        let pictures = self.mosaic.pictures_of(pair.number);
        let sent = (inbox, pair, pictures);
        let made = model::receive(sent, (self.model, self.options), place, &mut record, &mut self.workspace);
        let Audience { view, voice, .. } = &mut self.audience;
        if let (Some(voice), Ok((_, made))) = (voice, &made) {
            voice.model(made);
        }
        let Some(view) = view else {
            let (model, made) = made?;
            self.workspace.recycle(made);
            return Ok(model);
        };
        let remarks = self.refusals.iter().flatten().cloned().collect();
        let beside = Beside { name, pictures: None, remarks, dropped: lost.into(), arrived };
        let choices = (self.model.into(), *self.options);
        view::show((made, record), choices, beside, view, &mut self.workspace)
    }

    /// How it goes, on a terminal and in a fleet.
    pub(super) fn show(&mut self, tally: &Tally) {
        let rate = f64::from(self.pairs) / self.start.elapsed().as_secs_f64().max(1e-3);
        let link = link_in_words(tally).map_or_else(String::new, |words| format!("; {words}"));
        let (models, pairs) = (self.models, self.pairs);
        self.bar.set_message(format!("{models} models of {pairs} pairs, {rate:.2} a second{link}"));
        if let Some(voice) = &mut self.audience.voice {
            voice.status(link_as_json(tally));
        }
    }

    pub(super) fn close(mut self, tally: &Tally) -> Result<(), Failure> {
        self.bar.finish_and_clear();
        if let Some(voice) = &mut self.audience.voice {
            voice.end(link_as_json(tally));
        }
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
