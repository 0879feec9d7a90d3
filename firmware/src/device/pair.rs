//! A pair under way: from the capture to what is said of it, a step at a time.
//!
//! ```text
//! scratch  | the core's picture | the raw picture, then the core's scratch |
//! ```
//!
//! Rows of an eye go to the second place and are warped into the first, or straight there where raw pictures
//! are rectified already. What the core makes of it stays in lists and mask, so the next eye has the block.

use super::command::told;
use super::exposure::steps;
use super::{Decision, Device, Eyes};
use crate::ports::{CameraFault, Exposure, Side, Stamps};
use shared::arena::Arena;
use shared::bitmap::{Bitmap, Grey, Size};
use shared::fixed::PX;
use shared::limits::CapacityError;
use shared::pipeline::{Finding, Observer, Product, Run, Settings};
use shared::stage::binarise::Histogram;
use shared::stage::depth::Optics;
use shared::wire::{PairReport, PictureKind, PicturePart, Shape, ToHost, pack_mask};

/// Bytes of a part of a picture: what a frame holds beside its own, in whole rows.
const PART: usize = 3840;

/// What is done next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    /// Take a picture with both eyes.
    Capture,
    /// Fetch an eye's picture.
    Fetch(Side),
    /// Find the object.
    Outline(Side),
    /// Send an eye's picture from a row on.
    Send(PictureKind, Side, usize),
    /// Thin the left mask.
    Skeleton,
    /// Match both views.
    Match,
}

/// A pair of pictures and what becomes of it.
pub(super) struct Job {
    number: u32,
    stamps: Stamps,
    exposure: Exposure,
    levels: [u8; 2],
    /// Whether the pair is described and reported, or its pictures are all that is wanted.
    described: bool,
    /// What of it is sent beside.
    pub(super) grab: Option<PictureKind>,
    run: Run,
    refused: Option<Finding>,
    step: Step,
}

impl Job {
    /// What follows when an eye is done.
    const fn after(&self, side: Side) -> Option<Step> {
        match side {
            Side::Left => Some(Step::Fetch(Side::Right)),
            Side::Right if self.described && self.refused.is_none() => Some(Step::Skeleton),
            Side::Right => None,
        }
    }

    /// What follows when an eye's picture is sent.
    const fn sent(&self, kind: PictureKind, side: Side) -> Option<Step> {
        match kind {
            PictureKind::Grey if self.described => Some(Step::Outline(side)),
            _ => self.after(side),
        }
    }
}

/// Looks at rows as they come: how many there were, and how bright.
#[derive(Debug)]
pub(super) struct Meter {
    rows: usize,
    histogram: Histogram,
    /// By how many rungs each eye's exposure is off.
    steps: [i32; 2],
}

impl Meter {
    /// Nothing seen yet.
    pub(super) const fn new() -> Self {
        Self { rows: 0, histogram: [0; 256], steps: [0; 2] }
    }

    fn clear(&mut self) {
        (self.rows, self.histogram) = (0, [0; 256]);
    }

    fn take(&mut self, row: &[u8]) {
        self.rows += 1;
        for &value in row {
            self.histogram[usize::from(value)] += 1;
        }
    }
}

/// What of a run is told beside its result.
#[derive(Default)]
struct Witness {
    level: u8,
    masked: bool,
}

impl Observer for Witness {
    fn saw(&mut self, _: Option<Side>, product: Product<'_>) {
        match product {
            Product::Threshold(_, _, level, _) => self.level = level,
            Product::Mask(..) => self.masked = true,
            _ => (),
        }
    }
}

/// The core's picture in a block, and the rest of the block.
fn places(block: &mut [u64], size: Size) -> Result<(&mut [u8], Arena<'_>), CapacityError> {
    let mut arena = Arena::new(block);
    Ok((arena.take(size.pixels(), "pixels in a picture")?, arena))
}

/// The raw picture in a block.
fn raw_place(block: &mut [u64], size: Size, warped: bool) -> Result<&mut [u8], CapacityError> {
    let (first, mut rest) = places(block, size)?;
    if warped { rest.take(size.pixels(), "pixels in a picture") } else { Ok(first) }
}

impl Device<'_> {
    /// The next step of the pair under way, or the first of a new one if one is wanted.
    pub(super) fn go_on(&mut self) -> Decision {
        let Eyes::Up { exposure, .. } = self.eyes else { return Decision::Rest };
        let mut job = match self.job.take() {
            Some(job) => job,
            None if !self.orders.running && self.orders.grab.is_none() => return Decision::Rest,
            None if exposure != self.control.exposure() => return Decision::Expose,
            None => self.begin(exposure),
        };
        let next = match job.step {
            Step::Capture => {
                self.job = Some(job);
                return Decision::Capture;
            }
            Step::Fetch(side) => {
                self.meter.clear();
                self.job = Some(job);
                return Decision::Read(side);
            }
            Step::Outline(side) => self.outline(&mut job, side),
            Step::Send(kind, side, row) => self
                .send_rows((job.number, kind, side), row)
                .map(|next| next.map_or(job.sent(kind, side), |row| Some(Step::Send(kind, side, row))))
                .map_err(Finding::from),
            Step::Skeleton => {
                let [left, _] = &mut self.memory.eyes;
                let scratch = Arena::new(self.memory.scratch);
                job.run.skeleton(Side::Left, left, scratch, &mut ()).map(|()| Some(Step::Match))
            }
            Step::Match => Ok(None),
        };
        match next {
            Ok(Some(step)) => {
                job.step = step;
                self.job = Some(job);
            }
            Ok(None) => self.conclude(job),
            Err(finding) => {
                job.refused.get_or_insert(finding);
                self.conclude(job);
            }
        }
        Decision::Out
    }

    /// A pair with a number of its own, of eyes with this exposure.
    fn begin(&mut self, exposure: Exposure) -> Job {
        // Without a calibration only steps of single eyes are gone, to which the optics do not matter.
        let optics = self.calibration.optics().unwrap_or(Optics { focal: PX, disparity_offset: 0 });
        let settings = Settings {
            threshold: self.orders.threshold,
            polarity: self.orders.polarity,
            ..Settings::device(optics)
        };
        self.pairs_begun = self.pairs_begun.wrapping_add(1);
        Job {
            number: self.pairs_begun,
            stamps: Stamps { done: [0; 2] },
            exposure,
            levels: [0; 2],
            described: self.orders.running,
            grab: self.orders.grab.take(),
            run: Run::new(&mut self.memory, &settings),
            refused: None,
            step: Step::Capture,
        }
    }

    /// Both eyes hold a picture.
    pub(super) fn captured(&mut self, stamps: Stamps) {
        if let Some(job @ Job { step: Step::Capture, .. }) = &mut self.job {
            (job.stamps, job.step) = (stamps, Step::Fetch(Side::Left));
        }
    }

    /// Take a row of the picture that is fetched.
    pub fn line(&mut self, row: usize, luma: &[u8]) {
        let Some(Job { step: Step::Fetch(side), .. }) = self.job else { return };
        let warped = self.calibration.warp(side).is_some();
        let Ok(raw) = raw_place(self.memory.scratch, self.size, warped) else { return };
        let Some(place) = raw.chunks_exact_mut(self.size.width.max(1)).nth(row) else { return };
        if luma.len() == place.len() && row == self.meter.rows {
            place.copy_from_slice(luma);
            self.meter.take(luma);
        }
    }

    /// A picture has been fetched.
    pub(super) fn read(&mut self) {
        let Some(Job { step, grab, .. }) = &mut self.job else { return };
        let Step::Fetch(side) = *step else { return };
        if self.meter.rows != self.size.height {
            return self.fault(CameraFault::Length((self.meter.rows * self.size.width) as u32));
        }
        *step = match grab {
            Some(PictureKind::Grey) => Step::Send(PictureKind::Grey, side, 0),
            _ => Step::Outline(side),
        };
        self.meter.steps[side as usize] = steps(&self.meter.histogram);
        if side == Side::Right {
            self.control.follow(self.meter.steps);
            if let Eyes::Up { faults, .. } = &mut self.eyes {
                *faults = 0;
            }
        }
    }

    /// From the raw picture to the rectified one, and on to mask and contour.
    fn outline(&mut self, job: &mut Job, side: Side) -> Result<Option<Step>, Finding> {
        let (picture, mut rest) = places(self.memory.scratch, self.size)?;
        if let Some(warp) = self.calibration.warp(side) {
            let raw = rest.fork().take(self.size.pixels(), "pixels in a picture")?;
            let raw = Grey::new(self.size, self.size.width, raw)?;
            for (v, row) in picture.chunks_exact_mut(self.size.width.max(1)).enumerate() {
                warp.row(v, raw, row);
            }
        }
        let grey = Grey::new(self.size, self.size.width, picture)?;
        let mut witness = Witness::default();
        let outlined = job.run.outline(side, grey, &mut self.memory.eyes[side as usize], rest, &mut witness);
        job.levels[side as usize] = witness.level;
        if job.grab == Some(PictureKind::Mask) {
            // A mask that is refused shows why, and the other eye's may be good.
            job.refused = job.refused.or(outlined.err());
            let sent = witness.masked.then_some(Step::Send(PictureKind::Mask, side, 0));
            return Ok(sent.or_else(|| job.after(side)));
        }
        outlined.map(|()| job.after(side))
    }

    /// Put rows of a picture that was asked for, from this one on, into the buffer that is sent next; the row
    /// behind them, if there is one.
    fn send_rows(
        &mut self,
        (pair, kind, eye): (u32, PictureKind, Side),
        first: usize,
    ) -> Result<Option<usize>, CapacityError> {
        let Size { width, height } = self.size;
        let (width, height) = (width as u16, height as u16);
        let bytes = kind.row_bytes(width);
        let end = self.size.height.min(first + (PART / bytes.max(1)).max(1));
        let rows = match kind {
            PictureKind::Grey => {
                let raw = raw_place(self.memory.scratch, self.size, self.calibration.warp(eye).is_some())?;
                raw.get(first * bytes..end * bytes).unwrap_or_default()
            }
            PictureKind::Mask => {
                let mask = Bitmap::over(self.size, self.memory.eyes[eye as usize].mask)?;
                let packed =
                    Arena::new(self.memory.scratch).take((end - first) * bytes, "bytes in a frame")?;
                for (v, row) in (first as u16..).zip(packed.chunks_exact_mut(bytes.max(1))) {
                    pack_mask(&mask, v, row)?;
                }
                packed
            }
        };
        let first_row = first as u16;
        self.outbox.say(&ToHost::Picture(PicturePart { pair, eye, kind, width, height, first_row, rows }));
        Ok((end < self.size.height).then_some(end))
    }

    /// A pair has come to its end. Say what became of it, if it was to be described or cannot even be looked at.
    fn conclude(&mut self, job: Job) {
        let count = |counter: &mut u32| *counter = counter.saturating_add(1);
        count(&mut self.health.pairs);
        let result = match job.refused {
            Some(finding) => Err(finding),
            None if job.described => job.run.pair(&mut self.memory, &mut ()),
            None => return,
        };
        if result.is_err() {
            count(&mut self.health.refused);
        }
        self.outbox.say(&ToHost::Pair(PairReport {
            number: job.number,
            stamps: job.stamps.done,
            levels: job.levels,
            exposures: [told(job.exposure); 2],
            result: result
                .as_ref()
                .map(|outcome| Shape::of(&self.memory, outcome))
                .map_err(|finding| *finding),
        }));
    }
}
