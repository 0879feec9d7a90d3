//! Ossature on a microcontroller.
#![no_std]
pub use shared;
