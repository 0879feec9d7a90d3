//! Ossature on a microcontroller: the core of `shared`, run where the pictures are taken.
//!
//! What stands so far is what the device needs from its board ([`ports`]), a driver for two camera modules
//! ([`camera`]), the memory that the core borrows ([`memory`]) and a self-test that runs the whole pipeline on
//! drawn pictures ([`selftest`]). [`stages`] holds boards against a PC, [`record`] keeps a calibration in flash, and
//! `board/`, which alone may touch registers, makes ports of what boards have. The device's event loop
//! (`device.rs`) comes beside them.
#![no_std]

#[cfg(target_os = "none")]
pub mod board;
pub mod camera;
pub mod memory;
pub mod ports;
pub mod record;
pub mod selftest;
pub mod stages;
