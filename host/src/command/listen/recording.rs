//! A recording, listened to again.

use super::desk::{Audience, Desk, Wanted};
use crate::command::view::Pace;
use crate::command::{Failure, interruption};
use crate::live::View;
use crate::reconstruct::Options;
use crate::source::serial::inbox::{Inbox, Message};
use crate::source::serial::link::frames;
use crate::source::serial::recording::Recording;
use crate::source::serial::session::Tally;
use shared::wire::{Decoder, MAX_FRAME};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// Makes the models of a recording again, on a live page at a rate if there is one.
///
/// # Errors
///
/// If the recording cannot be read, or no pair gives a model.
pub(crate) fn replay(
    path: &Path,
    options: &Options,
    place: (Option<&Path>, Wanted),
    view: Option<(View, Option<f64>)>,
) -> Result<(), Failure> {
    let recording = Recording::read(path)?;
    let (view, rate) = view.map_or((None, None), |(view, rate)| (Some(view), rate));
    let stop = if view.is_some() { interruption()? } else { Arc::default() };
    let mut pace = Pace::new(rate);
    let audience = Audience { view, ..Audience::default() };
    let mut desk = Desk::new((&recording.calibration, options), place, audience);
    if let [first, others @ ..] = &recording.damaged[..] {
        let more =
            if others.is_empty() { String::new() } else { format!(" and in {} more places", others.len()) };
        desk.remark(&format!(
            "warning: {} is damaged at byte {}{more}: {} bytes are lost; copy it again from where it was made",
            path.display(),
            first.start,
            recording.damaged.iter().map(ExactSizeIterator::len).sum::<usize>()
        ));
    }
    if recording.cut > 0 {
        desk.remark(&format!(
            "{} was cut off: its last {} bytes are left out",
            path.display(),
            recording.cut
        ));
    }
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
