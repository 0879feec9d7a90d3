//! Shapes from a camera device at the other end of a serial link.
//!
//! ```text
//! port -> bytes (recording) -> frames (link) -> messages (inbox) -> crate::reconstruct
//! ```

pub mod inbox;
