//! The wire format: what a camera device and its host say to each other (docs/wire-format.md).
//!
//! ```text
//! message -> bytes -> COBS and CRC-32 -> link -> Decoder -> Frame -> message
//! ```
//!
//! * **Version**: [`VERSION`] stands first in both hellos and goes up when an old decoder would misread a
//!   new message. Until then the format only grows: types and codes are appended, never reused, and fields
//!   are appended to messages; a decoder skips what follows the fields it knows, and reports types and
//!   codes that it does not know.
//! * **Bounds**: nothing is allocated; frames are written into lent bytes, shapes are read into lent
//!   lists. Any bytes give a message or a [`WireError`], never a panic; a message that was read is safe to
//!   use: indices, sizes and coordinates are in their ranges.
//! * **Order of bytes**: little-endian.

mod bytes;
mod calibration;
mod command;
mod curves;
mod error;
mod figures;
mod finding;
mod frame;
mod hello;
mod message;
mod outline;
mod picture;
mod rice;
mod shape;
mod walk;

pub use calibration::calibration_crc;
pub use command::{ExposureSetting, ToDevice};
pub use error::WireError;
pub use finding::finding_code;
pub use frame::{Counters, Decoder, Frame, Sequence};
pub use hello::{Capacities, Hello, MAX_BOARD, ResetReason};
pub use message::{Answer, ErrorCode, Exposure, Health, PairReport, ToHost};
pub use picture::{PictureKind, PicturePart, pack_mask};
pub use shape::{DISPARITY_STEP, POSITION_STEP, Shape, ShapeLists, TURN_STEP};

/// The version of the wire format.
pub const VERSION: u16 = 1;

/// Largest frame that a device sends, both delimiters included, bytes.
pub const MAX_FRAME: usize = 4096;
