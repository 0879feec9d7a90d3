//! What a device says, in the host's own memory.

use crate::memory::Storage;
use shared::limits::CapacityError;
use shared::pipeline::{Finding, Memory, Outcome, Side};
use shared::wire::{
    Answer, Capacities, Exposure, Frame, Health, MAX_FRAME, PairReport, PictureKind, ResetReason, Shape,
    ShapeLists, ToHost, WireError,
};

/// Who a device is; see [`shared::wire::Hello`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Hello {
    /// Version of the firmware, as in 1.2.3.
    pub firmware: [u16; 3],
    /// Name of the board.
    pub board: String,
    /// What the left and the right image sensor say that they are; 0 for one that is silent.
    pub sensors: [u32; 2],
    /// Width and height of the pictures, px.
    pub picture: [u16; 2],
    /// How much a shape may have.
    pub capacities: Capacities,
    /// Why it started.
    pub reset: ResetReason,
    /// Check sum of the calibration that it keeps, if there is one.
    pub calibration: Option<u32>,
}

/// What became of a pair of pictures; see [`shared::wire::PairReport`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pair {
    /// Its number since the device started.
    pub number: u32,
    /// When the left and the right picture were complete, us since the device started.
    pub stamps: [u64; 2],
    /// Levels between object and background, 0 in an eye that was not looked at.
    pub levels: [u8; 2],
    /// How both pictures were taken.
    pub exposures: [Exposure; 2],
    /// The figures of its shape, whose lists are in [`Inbox::memory`] until the next frame is read, or why there
    /// is none.
    pub result: Result<Outcome, Finding>,
}

/// Some rows of a picture; see [`shared::wire::PicturePart`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    /// Number of the pair that it is of.
    pub pair: u32,
    /// Which eye's it is.
    pub eye: Side,
    /// What it shows.
    pub kind: PictureKind,
    /// Width and height of the picture, px.
    pub size: [u16; 2],
    /// The first row of this part.
    pub first_row: u16,
    /// Whole rows.
    pub rows: Vec<u8>,
}

/// A message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Message {
    /// Who it is.
    Hello(Hello),
    /// What became of a pair.
    Pair(Box<Pair>),
    /// Rows of a picture.
    Picture(Part),
    /// How it fares.
    Health(Health),
    /// What became of a command.
    Answer(Answer),
}

/// Where frames become messages, and shapes stand.
pub struct Inbox {
    storage: Storage,
}

impl Inbox {
    /// An empty one.
    ///
    /// # Errors
    /// None; a picture of one pixel is small enough.
    pub fn new() -> Result<Self, CapacityError> {
        // A shape needs lists, but no pictures.
        Ok(Self { storage: Storage::new(1, 1)? })
    }

    /// Read a frame.
    ///
    /// # Errors
    /// A [`WireError`] that says what is wrong with the message.
    pub fn read(&mut self, frame: &Frame<'_>) -> Result<Message, WireError> {
        let (mut memory, mut outcome) = (self.storage.lend(), Outcome::default());
        let mut lists = ShapeLists::of(&mut memory, &mut outcome);
        Ok(match ToHost::decode(frame, &mut lists)? {
            ToHost::Hello(hello) => Message::Hello(Hello {
                firmware: hello.firmware,
                board: hello.board.to_owned(),
                sensors: hello.sensors,
                picture: hello.picture,
                capacities: hello.capacities,
                reset: hello.reset,
                calibration: hello.calibration,
            }),
            ToHost::Pair(pair) => Message::Pair(Box::new(Pair {
                number: pair.number,
                stamps: pair.stamps,
                levels: pair.levels,
                exposures: pair.exposures,
                result: pair.result.map(|shape| shape.outcome.clone()),
            })),
            ToHost::Picture(part) => Message::Picture(Part {
                pair: part.pair,
                eye: part.eye,
                kind: part.kind,
                size: [part.width, part.height],
                first_row: part.first_row,
                rows: part.rows.to_vec(),
            }),
            ToHost::Health(health) => Message::Health(health),
            ToHost::Answer(answer) => Message::Answer(answer),
        })
    }

    /// The frame of the pair that was read last, as its device sent it but for the number of the frame.
    ///
    /// # Errors
    /// None: what came in a frame fits into one.
    pub fn frame(&mut self, pair: &Pair) -> Result<Vec<u8>, CapacityError> {
        let memory = self.storage.lend();
        let report = ToHost::Pair(PairReport {
            number: pair.number,
            stamps: pair.stamps,
            levels: pair.levels,
            exposures: pair.exposures,
            result: pair
                .result
                .as_ref()
                .map(|outcome| Shape::of(&memory, outcome))
                .map_err(|finding| *finding),
        });
        let mut frame = vec![0; MAX_FRAME];
        let length = report.encode(0, &mut frame)?;
        frame.truncate(length);
        Ok(frame)
    }

    /// The memory that the last shape stands in.
    pub fn memory(&mut self) -> Memory<'_> {
        self.storage.lend()
    }
}
