//! Ossature on a microcontroller: the core of `shared`, run where the pictures are taken.
//!
//! [`device`] decides: events in, actions out, no I/O. [`drive`] carries its actions out through the traits
//! of [`ports`], on a board, in an emulator and on a PC alike. [`memory`] is what the core borrows, `camera`
//! drives the eyes over embedded-hal 1.0, and [`selftest`] runs the core on drawn pictures. Registers belong
//! to `board/` alone.
#![no_std]

pub mod camera;
pub mod device;
pub mod drive;
pub mod memory;
pub mod ports;
pub mod selftest;
