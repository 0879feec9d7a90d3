//! What a device wants done, and what it is told of it.

use crate::ports::{CameraError, Exposure, FlashError, Identity, LinkError, Side, Stamps};

/// What a device is to do next.
#[derive(Debug, PartialEq, Eq)]
#[must_use]
pub enum Action<'a> {
    /// Fill the buffer with the record in flash: [`Event::Loaded`].
    Load(&'a mut [u8]),
    /// Make this the record in flash; an empty one stands for none: [`Event::Saved`].
    Save(&'a [u8]),
    /// Fill the buffer with bytes that have come: [`Event::Received`].
    Receive(&'a mut [u8]),
    /// Send a frame: [`Event::Sent`].
    Send(&'a [u8]),
    /// Start both eyes: [`Event::Started`].
    Start(Exposure),
    /// Change the exposure of both eyes: [`Event::Exposed`].
    Expose(Exposure),
    /// Take a picture with both eyes: [`Event::Captured`].
    Capture,
    /// Hand every row of an eye's picture to [`Device::line`](super::Device::line): [`Event::Read`].
    Read(Side),
    /// Ask again at once; there is nothing to report.
    Continue,
    /// Ask again when bytes or some milliseconds have come; there is nothing to report.
    Rest,
}

/// What came of an action.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// Length of the record in the buffer, 0 for none.
    Loaded(Result<usize, FlashError>),
    /// Whether the record stands.
    Saved(Result<(), FlashError>),
    /// Number of bytes in the buffer.
    Received(Result<usize, LinkError>),
    /// Whether the frame went out.
    Sent(Result<(), LinkError>),
    /// What the eyes are.
    Started(Result<[Identity; 2], CameraError>),
    /// Whether the exposure is the one ordered.
    Exposed(Result<(), CameraError>),
    /// When the pictures were taken.
    Captured(Result<Stamps, CameraError>),
    /// Whether all rows were handed over.
    Read(Result<(), CameraError>),
}
