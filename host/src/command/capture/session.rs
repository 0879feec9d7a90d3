//! A run of `capture`: what is done with each pair, and what is told of it.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use image::GrayImage;
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::json;

use super::super::model::{self, Model, NoModel, Order, Place, warnings};
use super::super::options::NoCalibration;
use super::super::publish::Voice;
use super::super::table::{count, sides};
use super::super::timings::Timings;
use super::super::view::{self, Beside};
use super::super::{Failure, say, say_json, words_of};
use super::Args;
use crate::calibration::StereoCamera;
use crate::live::View;
use crate::live::control::{Control, Limits, Settings};
use crate::reconstruct::{Options, Workspace};
use crate::report::record::Record;
use crate::source::exposure::Exposure;
use crate::source::recording::Recording;
use crate::source::scene::Scene;
use crate::source::v4l::device::{Device, now};
use crate::source::v4l::dial::Dial;
use crate::source::v4l::live::{self, Live, Optics, Tally};
use crate::source::v4l::pair::Pairs;

/// Why an exposure cannot be set.
const NO_DIAL: &str = "the camera's driver has no control for it";

/// Cameras that are set, and what their pixels mean.
pub(super) struct Rig<D> {
    pub(super) pairs: Pairs<D>,
    pub(super) optics: Optics,
    /// None only if nothing but recording is wanted.
    pub(super) calibration: Option<StereoCamera>,
    /// The file that the calibration comes from.
    pub(super) file: Option<PathBuf>,
    /// What exposures are set by, if that is wanted.
    pub(super) dials: Vec<Dial>,
}

/// A run.
pub(super) struct Session<'a> {
    pub(super) args: &'a Args,
    options: Options,
    calibration: Option<StereoCamera>,
    scene: Scene,
    /// The live page, if it is wanted.
    view: Option<View>,
    /// A fleet, if it is wanted.
    voice: Option<Voice>,
    /// What those who look on set.
    control: Option<Arc<Control>>,
    dials: Vec<Dial>,
    /// What the first pair and the last one were made with.
    first: Settings,
    settings: Settings,
    /// What the cameras said to the exposure that was set last.
    answers: Vec<String>,
    workspace: Workspace,
    /// If they are wanted.
    timings: Option<Timings>,
    recording: Option<Recording>,
    /// Pairs still to be thrown away.
    skip: u64,
    begun: Instant,
    pub(super) bar: ProgressBar,
    pub(super) done: Vec<Done>,
    best: Option<Best>,
    /// What went wrong on this side of the camera.
    failure: Option<Failure>,
}

/// What became of a pair.
pub(super) struct Done {
    pub(super) name: String,
    pub(super) result: Result<Success, String>,
    /// From the arrival of its last frame to its files.
    pub(super) latency: Duration,
    /// Right less left time, seconds, of two cameras.
    pub(super) gap: Option<f64>,
}

pub(super) struct Success {
    /// In a few words.
    pub(super) size: String,
    pub(super) warnings: Vec<String>,
}

/// The best pair so far, as it was taken.
struct Best {
    index: usize,
    views: [GrayImage; 2],
    /// Warnings, and the part of the outline without counterpart: less is better.
    worth: (usize, f64),
}

impl<'a> Session<'a> {
    /// Nothing done yet. The folder of a recording must be new or empty.
    pub(super) fn begin<D>(
        args: &'a Args,
        options: &Options,
        scene: Scene,
        rig: &mut Rig<D>,
    ) -> Result<Self, Failure> {
        let (settings, dials) = (view::settings(options), std::mem::take(&mut rig.dials));
        let limits = || Limits {
            threshold: Ok(()),
            polarity: view::polarity(&args.scene),
            region: Ok(()),
            exposure: dials.first().map(|dial| dial.range().clone()).ok_or_else(|| NO_DIAL.into()),
            pairs: Ok(()),
        };
        let link = args.publish.meet()?;
        let view = args.view.open(&args.title(), settings, limits)?;
        let control = match &view {
            Some(view) => Some(Arc::clone(view.control())),
            None => link.as_ref().map(|_| Arc::new(Control::new(settings, limits()))),
        };
        let mut voice = None;
        if let (Some(link), [board, ..], Some(control)) = (&link, args.publish.boards(), &control) {
            let voice = voice.insert(args.publish.voice(link, board, control)?);
            voice.greeted(json!({ "camera": args.title() }));
        }
        let calibration = rig.calibration.map(|calibration| (calibration, rig.file.clone()));
        let record = |folder| Recording::begin(folder, calibration);
        let recording = args.record.as_deref().map(record).transpose()?;
        let bar = ProgressBar::new_spinner();
        if let Ok(style) = ProgressStyle::with_template("{spinner} {msg}") {
            bar.set_style(style);
        }
        Ok(Self {
            args,
            options: *options,
            calibration: rig.calibration,
            scene,
            view,
            voice,
            control,
            dials,
            first: settings,
            settings,
            answers: Vec::new(),
            workspace: Workspace::default(),
            timings: args.timings.then(Timings::begin),
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
        let (tally, result) =
            live::run(&mut rig.pairs, &rig.optics, stop, |live, tally| self.take(live, tally));
        self.bar.finish_and_clear();
        if let Some(voice) = &mut self.voice {
            voice.end(json!({ "dropped": tally.dropped }));
        }
        if let Some(view) = &self.view {
            view::tell_flags(view, &self.first);
        }
        let best = self.make_best().unwrap_or_else(|failure| {
            self.failure.get_or_insert(failure);
            None
        });
        if let Some(timings) = &self.timings {
            timings.tell();
        }
        let failure = result.err().map(Failure::from).or(self.failure.take()).or_else(|| self.nothing());
        if self.args.json {
            say_json(&self.as_json(&tally, best.as_ref(), failure.as_ref()))?;
        } else {
            say(&self.as_text(&tally, best.as_ref()))?;
        }
        failure.map_or(Ok(()), Err)
    }

    /// One pair.
    fn take(&mut self, live: Live, tally: &Tally) -> ControlFlow<()> {
        if let Some(voice) = &mut self.voice {
            voice.heard();
        }
        if self.skip > 0 {
            self.skip -= 1;
        } else if self.control.as_ref().is_some_and(|control| !control.take_pair()) {
            // It is not wanted.
        } else if let Err(failure) = self.work_on(live, tally) {
            self.failure = Some(failure);
            return ControlFlow::Break(());
        } else {
            self.show(tally);
        }
        if let Some(voice) = &mut self.voice {
            voice.status(json!({ "dropped": tally.dropped }));
        }
        let enough = self.args.frames.is_some_and(|frames| self.done.len() as u64 >= frames)
            || self.args.seconds.is_some_and(|seconds| self.begun.elapsed().as_secs_f64() >= seconds);
        if enough { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    /// Records a pair and makes its model. That a pair is refused is no failure.
    fn work_on(&mut self, live: Live, tally: &Tally) -> Result<(), Failure> {
        let Live { views, gap, arrived } = live;
        if self.args.scene.takes_first() && self.scene.background.is_none() {
            if let Some(recording) = &mut self.recording {
                recording.add(0, &views.images)?;
            }
            self.scene.background = Some(views.images);
            self.tell("the background is taken: put the object in its place");
            return Ok(());
        }
        let number = self.done.len() as u64 + 1;
        let name = format!("{number:06}");
        if let Some(recording) = &mut self.recording {
            recording.add(number, &views.images)?;
        }
        if let (Some(control), Some(voice)) = (&self.control, &mut self.voice) {
            control.saw(views.images[0].dimensions());
            voice.begin();
        }
        self.obey();
        let result = if self.args.only_record {
            Ok(Success { size: "recorded".into(), warnings: Vec::new() })
        } else if self.args.best {
            self.weigh(views.images, views.warnings.len())
        } else {
            let remarks = views.warnings.iter().chain(&self.answers).cloned().collect();
            let folder = self.args.out.as_ref().map(|out| out.join(&name));
            let beside = || Beside {
                name: name.clone(),
                pictures: Some(views.images.clone()),
                remarks,
                dropped: tally.dropped,
                arrived: Instant::now().checked_sub(now().saturating_sub(arrived)).unwrap_or(self.begun),
            };
            let beside = self.view.is_some().then(beside);
            self.make(views.images, folder.as_deref(), beside)
                .map(|model| Success { size: sides(model.size), warnings: model.warnings })
        };
        let result = match result {
            Ok(mut success) => {
                success.warnings.splice(0..0, views.warnings);
                Ok(success)
            }
            Err(failure) if failure.is::<NoModel>() => Err(words_of(&*failure)),
            Err(failure) => return Err(failure),
        };
        self.publish(&name, &result);
        self.done.push(Done { name, result, latency: now().saturating_sub(arrived), gap });
        Ok(())
    }

    /// The views as the scene has them, and their calibration.
    fn seen(&self, views: [GrayImage; 2]) -> Result<([GrayImage; 2], StereoCamera), Failure> {
        let calibration = self.calibration.as_ref().ok_or(NoCalibration)?;
        Ok(self.scene.apply(views, calibration)?)
    }

    /// Tells a fleet what became of a pair.
    fn publish(&mut self, name: &str, result: &Result<Success, String>) {
        let Some(voice) = &mut self.voice else { return };
        match result {
            Ok(Success { warnings, .. }) => {
                voice.pair(&json!({ "pair": name, "warnings": warnings }), warnings);
            }
            Err(why) => voice.pair(&json!({ "pair": name, "error": why }), std::slice::from_ref(why)),
        }
    }

    /// Does what those who look on have set.
    fn obey(&mut self) {
        let Some(control) = &self.control else { return };
        let (settings, _) = control.settings();
        let exposure = settings.exposure.filter(|_| settings.exposure != self.settings.exposure);
        self.settings = settings;
        view::obey(&settings, &mut self.options, &mut self.scene);
        let Some(exposure) = exposure else { return };
        let told = |dial: &mut Dial| match (exposure, dial.set(exposure)) {
            (_, Err(error)) => Some(format!("the camera refuses the exposure: {error}")),
            (Exposure::Fixed(asked), Ok(Some(took))) if took != i64::from(asked) => {
                Some(format!("the camera took an exposure of {took}, not {asked}"))
            }
            _ => None,
        };
        self.answers = self.dials.iter_mut().filter_map(told).collect();
    }

    /// The model of a pair, in its folder if there is one, and on the page.
    fn make(
        &mut self,
        views: [GrayImage; 2],
        folder: Option<&Path>,
        beside: Option<Beside>,
    ) -> Result<Model, Failure> {
        let (images, calibration) = self.seen(views)?;
        let order = Order {
            images,
            calibration: &calibration,
            options: &self.options,
            pictures: !self.args.no_pictures,
            truth: None,
            place: Place { folder, report: self.args.json && self.args.best, page: self.args.report },
        };
        let mut record =
            if beside.is_some() || order.pictures { Record::new() } else { Record::figures_only() };
        let made = model::make_recorded(order, &mut record, &mut self.workspace);
        if let (Some(voice), Ok((_, made))) = (&mut self.voice, &made) {
            voice.model(made);
        }
        let model = match (beside, &mut self.view) {
            (Some(beside), Some(view)) => {
                let choices = (calibration, self.options);
                view::show((made, record), choices, beside, view, &mut self.workspace)?
            }
            _ => {
                let (model, made) = made?;
                self.workspace.recycle(made);
                model
            }
        };
        if let Some(timings) = &mut self.timings {
            timings.add(None, &model);
        }
        Ok(model)
    }

    /// Keeps a pair if it is the best so far; the first of equals stays. So many of its frames were damaged.
    fn weigh(&mut self, views: [GrayImage; 2], damaged: usize) -> Result<Success, Failure> {
        let (seen, calibration) = self.seen(views.clone())?;
        let made = self.workspace.reconstruct(seen.each_ref(), &calibration, &self.options, &mut ());
        let made = made.map_err(NoModel::from)?;
        let warnings = warnings(&made);
        let rows = made.outcome.rows;
        let worth = (damaged + warnings.len(), f64::from(rows.unmatched) / f64::from(rows.crossings.max(1)));
        if self.best.as_ref().is_none_or(|best| worth < best.worth) {
            self.best = Some(Best { index: self.done.len(), views, worth });
        }
        let size = made.mesh.bounds().map_or_else(nalgebra::Vector3::zeros, |[low, high]| high - low);
        self.workspace.recycle(made);
        Ok(Success { size: sides(size), warnings })
    }

    /// Makes the model of the best pair, if that is what is wanted.
    fn make_best(&mut self) -> Result<Option<(String, Model)>, Failure> {
        let Some(best) = self.best.take() else { return Ok(None) };
        let model = self.make(best.views, self.args.out.as_deref(), None)?;
        Ok(Some((self.done[best.index].name.clone(), model)))
    }

    /// That no pair was worked on is a failure, and that none of them gave a model.
    fn nothing(&self) -> Option<Failure> {
        if self.done.is_empty() {
            let taken = if self.skip > 0 {
                let skip = self.args.skip;
                format!("while the first {skip} were thrown away; let it run longer, or take a lower --skip")
            } else if self.scene.background.is_some() && self.args.scene.takes_first() {
                "after the background; put the object in its place and let it run longer".into()
            } else {
                "before the end; let it run longer".into()
            };
            return Some(format!("no pair came that could be worked on: the run ended {taken}").into());
        }
        let mut refused = self.done.iter().map(|done| done.result.as_ref().err());
        let last = refused.clone().next_back()??;
        refused.all(|refusal| refusal.is_some()).then(|| {
            let pairs = count(self.done.len(), "pair", "pairs");
            format!("none of {pairs} gave a model; the last: {last}").into()
        })
    }
}

#[cfg(test)]
mod tests;
