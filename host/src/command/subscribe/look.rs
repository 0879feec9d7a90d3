//! Shapes of boards on a live page: each is grown here, with the calibration that its board publishes.

use std::collections::BTreeMap;
use std::time::Instant;

use shared::camera::PairModel;
use shared::wire::{Decoder, MAX_FRAME, ToDevice};

use crate::command::Failure;
use crate::command::model::{self, NoModel, Place};
use crate::command::view::{self, Beside, ViewArgs};
use crate::fleet::Message;
use crate::fleet::key::{Board, Leaf};
use crate::live::View;
use crate::live::control::{Limits, Settings};
use crate::reconstruct::{Options, Workspace};
use crate::report::record::Record;
use crate::source::serial::inbox::{self, Inbox};
use crate::source::serial::link::frames;

/// A live page, and what is needed for it.
pub(super) struct Looker {
    view: View,
    options: Options,
    inbox: Inbox,
    workspace: Workspace,
    /// What the pixels of each board's shapes mean, in which run.
    calibrations: BTreeMap<Board, (String, PairModel)>,
}

impl Looker {
    /// Serves the page, if it is wanted.
    pub(super) fn open(args: &ViewArgs, boards: &Board, options: Options) -> Result<Option<Self>, Failure> {
        let Some(view) = args.open(&boards.to_string(), Settings::default(), limits)? else {
            return Ok(None);
        };
        let (inbox, workspace) = (Inbox::new()?, Workspace::default());
        let options = Options { draft: true, ..options };
        Ok(Some(Self { view, options, inbox, workspace, calibrations: BTreeMap::new() }))
    }

    /// Shows a message, if it is a shape; so many were lost before. Returns whether the meaning of its pixels is known.
    pub(super) fn see(&mut self, message: &Message, lost: u64) -> Result<bool, Failure> {
        let (arrived, Message { board, leaf, envelope, .. }) = (Instant::now(), message);
        if !matches!(leaf, Leaf::Calibration | Leaf::Shape) {
            return Ok(true);
        }
        let mut buffer = vec![0; MAX_FRAME];
        let (mut decoder, mut frame) = (Decoder::new(&mut buffer), None);
        frames(&mut decoder, &message.bytes, |arrived| frame = Some(arrived));
        let Some(frame) = frame else { return Ok(true) };
        if *leaf == Leaf::Calibration {
            if let Ok(ToDevice::Calibration(model)) = ToDevice::decode(&frame.frame()) {
                self.calibrations.insert(board.clone(), (envelope.run.clone(), model));
            }
            return Ok(true);
        }
        let known = self.calibrations.get(board).filter(|(run, _)| *run == envelope.run);
        let Some((_, model)) = known else { return Ok(false) };
        let Ok(inbox::Message::Pair(pair)) = self.inbox.read(&frame.frame()) else { return Ok(true) };
        let (mut record, place) =
            (Record::figures_only(), Place { folder: None, report: false, page: false });
        let (sent, how) = ((&mut self.inbox, *pair, None), (model, &self.options));
        let made = model::receive(sent, how, place, &mut record, &mut self.workspace);
        let name = format!("{}/{} {:06}", board.site(), board.name(), envelope.pair);
        let beside = Beside { name, pictures: None, remarks: Vec::new(), dropped: lost, arrived };
        let choices = (model.into(), self.options);
        match view::show((made, record), choices, beside, &mut self.view, &mut self.workspace) {
            Err(failure) if !failure.is::<NoModel>() => Err(failure),
            _ => Ok(true),
        }
    }
}

/// Nothing: a page of several boards would have to say which.
fn limits() -> Limits {
    let order = "this page shows several boards: set it with `host fleet order`";
    let no = Err(order);
    Limits { threshold: no, polarity: no, region: no, exposure: Err(order.into()), pairs: no }
}
