//! Ossature on a microcontroller: the core of `shared`, run where the pictures are taken.
//!
//! [`device`] decides: events in, actions out, no I/O. [`drive`] carries its actions out through the traits
//! of [`ports`], on a board, in an emulator and on a PC alike. [`memory`] is what the core borrows, [`record`]
//! keeps a calibration in flash, [`camera`] drives the eyes over embedded-hal 1.0, [`send`] waits for a host so
//! long and no longer, [`reset`] reads why a chip has started, and [`endpoints`] keeps a USB host to what is
//! there. [`selftest`] runs the core on drawn pictures, [`stages`] holds a board's bits against a PC's. `board/`, which alone may touch registers, makes ports of what boards have.
#![no_std]

#[cfg(target_os = "none")]
pub mod board;
pub mod camera;
pub mod device;
pub mod drive;
pub mod endpoints;
pub mod memory;
pub mod ports;
pub mod record;
pub mod reset;
pub mod selftest;
pub mod send;
pub mod stages;
