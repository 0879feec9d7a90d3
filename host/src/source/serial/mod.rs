//! Shapes from a camera device at the other end of a serial link.
//!
//! ```text
//! port -> bytes (recording) -> frames (link) -> messages (inbox) -> orders and answers (session)
//! ```
//!
//! Whatever comes over a link is counted and gone on from: damaged frames are lost and nothing else is, and a
//! device that is unplugged or starts anew is waited for.

pub mod inbox;
pub mod link;
pub mod list;
pub mod mosaic;
pub mod port;
pub mod recording;
pub mod session;
