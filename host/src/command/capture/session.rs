//! A run of `capture`: what is done with each pair, and what is told of it.

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use image::GrayImage;
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::{Value, json};

use super::super::model::{self, Model, Order, warnings};
use super::super::table::{Table, count, sides};
use super::super::{Failure, note, say, say_json, words_of};
use super::Args;
use crate::calibration::StereoCamera;
use crate::reconstruct::{Options, Refusal, reconstruct};
use crate::source::recording::Recording;
use crate::source::scene::Scene;
use crate::source::v4l::device::{Device, now};
use crate::source::v4l::errors::CameraError;
use crate::source::v4l::live::{self, Live, Optics, Tally};
use crate::source::v4l::pair::Pairs;

/// Cameras that are set, and what their pixels mean.
pub(super) struct Rig<D> {
    pub(super) pairs: Pairs<D>,
    pub(super) optics: Optics,
    pub(super) calibration: StereoCamera,
    /// The file that the calibration comes from.
    pub(super) file: Option<PathBuf>,
}

/// A run.
pub(super) struct Session<'a> {
    args: &'a Args,
    options: &'a Options,
    calibration: StereoCamera,
    scene: Scene,
    recording: Option<Recording>,
    /// Pairs still to be thrown away.
    skip: u64,
    begun: Instant,
    bar: ProgressBar,
    done: Vec<Done>,
    best: Option<Best>,
    /// What went wrong on this side of the camera.
    failure: Option<Failure>,
}

/// What became of a pair.
struct Done {
    name: String,
    result: Result<Success, String>,
    /// From the arrival of its last frame to its files.
    latency: Duration,
    gap: Option<f64>,
}

struct Success {
    /// In a few words.
    size: String,
    warnings: Vec<String>,
}

/// The best pair so far, as it was taken.
struct Best {
    index: usize,
    views: [GrayImage; 2],
    /// Warnings, and the part of the outline without counterpart: less is better.
    worth: (usize, f64),
}

impl<'a> Session<'a> {
    /// Nothing done yet. The folder of the recording is made here, if there is to be one.
    pub(super) fn begin<D>(
        args: &'a Args,
        options: &'a Options,
        scene: Scene,
        rig: &Rig<D>,
    ) -> Result<Self, Failure> {
        let record = |folder| Recording::begin(folder, &rig.calibration, rig.file.as_deref());
        let recording = args.record.as_deref().map(record).transpose()?;
        let bar = ProgressBar::new_spinner();
        if let Ok(style) = ProgressStyle::with_template("{spinner} {msg}") {
            bar.set_style(style);
        }
        Ok(Self {
            args,
            options,
            calibration: rig.calibration,
            scene,
            recording,
            skip: args.skip,
            begun: Instant::now(),
            bar,
            done: Vec::new(),
            best: None,
            failure: None,
        })
    }

    /// Works on pairs until enough is done, and tells.
    pub(super) fn run<D: Device + Send>(mut self, mut rig: Rig<D>, stop: &AtomicBool) -> Result<(), Failure> {
        let result = live::run(&mut rig.pairs, &rig.optics, stop, |live, tally| self.take(live, tally));
        self.bar.finish_and_clear();
        let (tally, mut failure) = result_of(result);
        let mut best = None;
        if failure.is_none() && self.failure.is_none() {
            match self.make_best() {
                Ok(made) => best = made,
                Err(error) => self.failure = Some(error),
            }
        }
        failure = failure.or(self.failure.take()).or_else(|| self.nothing());
        if self.args.json {
            say_json(&self.as_json(&tally, best.as_ref(), failure.as_ref()))?;
        } else {
            say(&self.as_text(&tally, best.as_ref()))?;
        }
        failure.map_or(Ok(()), Err)
    }

    /// One pair.
    fn take(&mut self, live: Live, tally: &Tally) -> ControlFlow<()> {
        if self.skip > 0 {
            self.skip -= 1;
            return ControlFlow::Continue(());
        }
        match self.work_on(live) {
            Ok(()) => {}
            Err(failure) => {
                self.failure = Some(failure);
                return ControlFlow::Break(());
            }
        }
        self.show(tally);
        let enough = self.args.frames.is_some_and(|frames| self.done.len() as u64 >= frames)
            || self.args.seconds.is_some_and(|seconds| self.begun.elapsed().as_secs_f64() >= seconds);
        if enough { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    /// Records a pair and makes its model. That a pair is refused is no failure.
    fn work_on(&mut self, live: Live) -> Result<(), Failure> {
        let Live { views, gap, arrived } = live;
        if self.args.scene.takes_first() && self.scene.background.is_none() {
            if let Some(recording) = &self.recording {
                recording.add(0, &views.images)?;
            }
            self.scene.background = Some(views.images);
            self.tell("the background is taken: put the object in its place");
            return Ok(());
        }
        let number = self.done.len() as u64 + 1;
        let name = format!("{number:06}");
        if let Some(recording) = &self.recording {
            recording.add(number, &views.images)?;
        }
        let result = if self.args.best {
            self.weigh(views.images)
        } else {
            let folder = self.args.out.join(&name);
            self.make(views.images, folder)
                .map(|model| Success { size: sides(model.size()), warnings: model.warnings() })
        };
        let result = match result {
            Ok(mut success) => {
                success.warnings.splice(0..0, views.warnings);
                Ok(success)
            }
            Err(failure) if failure.is::<Refusal>() => Err(words_of(&*failure)),
            Err(failure) => return Err(failure),
        };
        self.done.push(Done { name, result, latency: now().saturating_sub(arrived), gap });
        Ok(())
    }

    /// The model of a pair, in its folder.
    fn make(&self, views: [GrayImage; 2], folder: PathBuf) -> Result<Model, Failure> {
        let (images, calibration) = self.scene.apply(views, &self.calibration)?;
        model::make(Order {
            images,
            calibration: &calibration,
            options: self.options,
            pictures: !self.args.no_pictures,
            truth: None,
            folder: &folder,
        })
    }

    /// Keeps a pair if it is the best so far; the first of equals stays.
    fn weigh(&mut self, views: [GrayImage; 2]) -> Result<Success, Failure> {
        let ([left, right], calibration) = self.scene.apply(views.clone(), &self.calibration)?;
        let made = reconstruct(left, right, &calibration, self.options, &mut ())?;
        let warnings = warnings(&made);
        let rows = made.outcome.rows;
        let worth = (warnings.len(), f64::from(rows.unmatched) / f64::from(rows.crossings.max(1)));
        if self.best.as_ref().is_none_or(|best| worth < best.worth) {
            self.best = Some(Best { index: self.done.len(), views, worth });
        }
        let size = made.mesh.bounds().map_or_else(nalgebra::Vector3::zeros, |[low, high]| high - low);
        Ok(Success { size: sides(size), warnings })
    }

    /// Makes the model of the best pair, if that is what is wanted.
    fn make_best(&mut self) -> Result<Option<(String, Model)>, Failure> {
        let Some(best) = self.best.take() else { return Ok(None) };
        let model = self.make(best.views, self.args.out.clone())?;
        Ok(Some((self.done[best.index].name.clone(), model)))
    }

    /// That pairs came, but no model, is a failure.
    fn nothing(&self) -> Option<Failure> {
        let mut refused = self.done.iter().map(|done| done.result.as_ref().err());
        let last = refused.clone().next_back()??;
        refused.all(|refusal| refusal.is_some()).then(|| {
            let pairs = count(self.done.len(), "pair", "pairs");
            format!("none of {pairs} gave a model; the last: {last}").into()
        })
    }

    /// Tells of the newest pair.
    fn show(&self, tally: &Tally) {
        let Some(done) = self.done.last() else { return };
        let good = self.done.iter().filter(|done| done.result.is_ok()).count();
        let bad = self.done.len() - good;
        let (ms, dropped) = (done.latency.as_millis(), tally.dropped);
        self.bar.set_message(format!("{good} models, {bad} refused, {dropped} pairs dropped, last {ms} ms"));
        self.bar.tick();
        if !self.args.json {
            let line = match &done.result {
                Ok(success) => {
                    let warnings = match success.warnings.as_slice() {
                        [] => String::new(),
                        all => format!(", warning: {}", all.join("; ")),
                    };
                    format!("{}  {}, {ms} ms{warnings}\n", done.name, success.size)
                }
                Err(refusal) => format!("{}  refused: {refusal}\n", done.name),
            };
            // That nobody reads on is no reason to end.
            let _ = self.bar.suspend(|| say(&line));
        }
    }

    fn tell(&self, line: &str) {
        self.bar.suspend(|| note(line));
    }

    fn as_text(&self, tally: &Tally, best: Option<&(String, Model)>) -> String {
        let mut table = Table::new("capture");
        let good = self.done.iter().filter(|done| done.result.is_ok()).count();
        table.row("pairs", &format!("{}, of which {good} have a model", self.done.len()));
        let mut latencies: Vec<Duration> = self.done.iter().map(|done| done.latency).collect();
        latencies.sort();
        if let (Some(middle), Some(most)) = (latencies.get(latencies.len() / 2), latencies.last()) {
            table.row("latency", &format!("{} ms, at most {}", middle.as_millis(), most.as_millis()));
        }
        let losses = tally.losses;
        for (what, number) in [
            ("dropped", count(tally.dropped as usize, "pair", "pairs")),
            ("unpaired", count(losses.unpaired as usize, "frame", "frames")),
            ("unreadable", count(tally.unreadable as usize, "frame", "frames")),
            ("damaged", count(tally.damaged as usize, "frame", "frames")),
            ("broken", count(losses.broken as usize, "frame", "frames")),
            ("stalled", count(losses.stalls as usize, "time", "times")),
        ] {
            if !number.starts_with("0 ") {
                table.row(what, &number);
            }
        }
        let gaps = self.done.iter().filter_map(|done| done.gap).map(f64::abs);
        if let Some(most) = gaps.reduce(f64::max) {
            table.row("apart", &format!("left and right at most {:.1} ms", 1e3 * most));
        }
        if let Some(recording) = &self.args.record {
            table.row("recording", &recording.display().to_string());
        }
        if let Some((name, model)) = best {
            table.row("best", name);
            model.tell(&mut table);
            model.warnings().iter().for_each(|warning| table.row("warning", warning));
        }
        if good > 0 {
            table.row("files", &self.args.out.display().to_string());
        }
        table.text().to_owned()
    }

    fn as_json(&self, tally: &Tally, best: Option<&(String, Model)>, failure: Option<&Failure>) -> Value {
        let ms = |time: Duration| (time.as_secs_f64() * 1e6).round() / 1e3;
        let pair = |done: &Done| {
            let (warnings, error) = match &done.result {
                Ok(success) => (Some(&success.warnings), None),
                Err(refusal) => (None, Some(refusal)),
            };
            json!({
                "name": done.name,
                "warnings": warnings,
                "error": error,
                "latency_ms": ms(done.latency),
                "gap_ms": done.gap.map(|gap| (gap * 1e6).round() / 1e3),
            })
        };
        let losses = tally.losses;
        json!({
            "pairs": self.done.iter().map(pair).collect::<Vec<_>>(),
            "folder": self.args.out,
            "recording": self.args.record,
            "best": best.map(|(name, model)| json!({ "name": name, "report": model.report })),
            "dropped_pairs": tally.dropped,
            "unpaired_frames": losses.unpaired,
            "unreadable_frames": tally.unreadable,
            "damaged_frames": tally.damaged,
            "broken_frames": losses.broken,
            "stalls": losses.stalls,
            "error": failure.map(|failure| words_of(&**failure)),
        })
    }
}

/// What was counted, and what went wrong with the camera.
fn result_of(result: (Tally, Result<(), CameraError>)) -> (Tally, Option<Failure>) {
    (result.0, result.1.err().map(Into::into))
}

#[cfg(test)]
mod tests;
