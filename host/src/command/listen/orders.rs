//! What a device is told of how to look: by flags at first, and then by those who look on.

use super::Args;
use super::desk::Desk;
use crate::command::words_of;
use crate::live::control::Settings;
use crate::reconstruct::{Front, Options};
use crate::source::exposure::Exposure;
use crate::source::serial::inbox::Message;
use crate::source::serial::session::{CAMERAS, Session, SessionError};
use shared::wire::{self, ErrorCode, ExposureSetting, PictureKind, ToDevice};
use std::mem::take;
use std::time::{Duration, Instant};

/// What a device can be told of how it looks.
pub(super) const ORDERS: [&str; 3] = ["threshold", "polarity", "exposure"];

/// From one order to start to the next.
const START_AGAIN: Duration = Duration::from_millis(500);

/// Cameras that do not answer: they may still be starting, or the device tries them again by itself.
struct Blind {
    since: Instant,
    again: Instant,
    is_told: bool,
}

/// What the device is to be told: nothing that nobody has said.
pub(super) struct Orders {
    /// For a device that begins, one of each of [`ORDERS`]: what was asked for at first, and what it obeyed since.
    kept: [Option<ToDevice>; ORDERS.len()],
    /// What of the page the device was told.
    settings: Settings,
    /// Whether threshold and polarity were among it.
    said: [bool; 2],
    /// Whether it takes pairs, and ever has.
    runs: bool,
    has_run: bool,
    /// Its cameras do not answer.
    blind: Option<Blind>,
    /// Whether the pictures of each pair are wanted, and of the next one are to be asked for.
    pictures: bool,
    due: bool,
    /// The pair that was heard of last.
    pair: Option<u32>,
}

impl Orders {
    /// What the flags say, and all that is shown to others as set.
    pub(super) fn new(args: &Args, settings: Settings, options: &Options, shown: bool) -> Self {
        let threshold = args.threshold.or_else(|| shown.then_some(settings.threshold));
        let polarity = args.polarity.or_else(|| shown.then_some(settings.polarity));
        let kept = [threshold.map(ToDevice::Threshold), polarity.map(ToDevice::Polarity), None];
        let said = [threshold.is_some(), polarity.is_some()];
        let pictures = options.front != Front::Balls;
        let (runs, has_run, blind) = (false, false, None);
        Self { kept, settings, said, runs, has_run, blind, pictures, due: false, pair: None }
    }

    /// Has a device that was greeted begin.
    pub(super) fn start(&mut self, session: &mut Session, desk: &mut Desk<'_>) -> Result<(), SessionError> {
        for (which, order) in self.kept.iter().enumerate() {
            if let Some(order) = order {
                desk.give(session, which, order)?;
            }
        }
        (self.runs, self.blind) = (false, None);
        self.run(session, desk)
    }

    /// Has the device take pairs, or none. Cameras that ran before are waited for.
    fn run(&mut self, session: &mut Session, desk: &Desk<'_>) -> Result<(), SessionError> {
        let runs = desk.audience.control.as_ref().is_none_or(|control| control.wants_pairs());
        match (self.runs, runs) {
            (false, true) if self.blind.as_ref().is_some_and(|blind| Instant::now() < blind.again) => Ok(()),
            (false, true) => match session.order(&ToDevice::Start) {
                Ok(()) => {
                    (self.runs, self.has_run, self.blind) = (true, true, None);
                    (self.due, self.pair) = (self.pictures, None);
                    self.ask_for_pictures(session)
                }
                Err(error @ SessionError::Refused(ErrorCode::Camera)) => self.wait_for_cameras(error, desk),
                Err(error) => Err(error),
            },
            (true, false) => {
                self.runs = false;
                session.order(&ToDevice::Stop)
            }
            _ => Ok(()),
        }
    }

    fn wait_for_cameras(&mut self, error: SessionError, desk: &Desk<'_>) -> Result<(), SessionError> {
        let now = Instant::now();
        let blind = self.blind.get_or_insert(Blind { since: now, again: now, is_told: false });
        blind.again = now + START_AGAIN;
        if blind.since + CAMERAS <= now {
            if !self.has_run {
                return Err(error);
            }
            if !blind.is_told {
                desk.remark(&format!("{}; waiting for it", words_of(&error)));
                blind.is_told = true;
            }
        }
        Ok(())
    }

    /// Hears what the device says: when it has begun another pair, the pictures of the next one can be asked for. It
    /// takes such an order once a pair, and keeps one.
    pub(super) fn note(&mut self, message: &Message) {
        let pair = match message {
            Message::Picture(part) => part.pair,
            Message::Pair(pair) => pair.number,
            _ => return,
        };
        self.due |= self.pictures && self.pair.replace(pair) != Some(pair);
    }

    fn ask_for_pictures(&mut self, session: &mut Session) -> Result<(), SessionError> {
        // Who is stopped would go on with a pair for each order; a start asks anew.
        if !take(&mut self.due) || !self.runs {
            return Ok(());
        }
        match session.order(&ToDevice::Grab(PictureKind::Grey)) {
            // It has this order already, or its cameras are being started again: it is asked at the next pair.
            Err(SessionError::Refused(ErrorCode::Busy | ErrorCode::Camera)) => Ok(()),
            result => result,
        }
    }

    /// Asks for pictures that are due, and passes on what was changed by those who look on.
    pub(super) fn follow(&mut self, session: &mut Session, desk: &mut Desk<'_>) -> Result<(), SessionError> {
        self.ask_for_pictures(session)?;
        self.pass_on(session, desk)?;
        self.run(session, desk)
    }

    fn pass_on(&mut self, session: &mut Session, desk: &mut Desk<'_>) -> Result<(), SessionError> {
        let Some(control) = &desk.audience.control else { return Ok(()) };
        let ((settings, _), before) = (control.settings(), self.settings);
        let said = control.said();
        // What is said for the first time may be what it would be otherwise, but not what the device has.
        let [threshold, polarity] = [0, 1].map(|k| said[k] && !self.said[k]);
        let exposure = settings.exposure.filter(|_| settings.exposure != before.exposure);
        let exposure = exposure.map(|exposure| match exposure {
            Exposure::Auto => ExposureSetting::Auto,
            Exposure::Fixed(lines) => ExposureSetting::Fixed(desk.gains.map(|gain| {
                let lines = u16::try_from(lines).unwrap_or(u16::MAX);
                wire::Exposure { lines, gain }
            })),
        });
        let changed = [
            (threshold || settings.threshold != before.threshold)
                .then_some(ToDevice::Threshold(settings.threshold)),
            (polarity || settings.polarity != before.polarity)
                .then_some(ToDevice::Polarity(settings.polarity)),
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
        (self.settings, self.said) = (settings, said);
        Ok(())
    }
}
