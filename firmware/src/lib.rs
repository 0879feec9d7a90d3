//! Ossature on a microcontroller: the core of `shared`, run where the pictures are taken.
//!
//! What stands so far is the memory that the core borrows ([`memory`]) and a self-test that runs the
//! whole pipeline on drawn pictures ([`selftest`], `src/bin/selftest.rs`). Camera drivers, the serial link
//! and the board's registers come beside them: `ports.rs` (camera, link, clock), `device.rs` (event to
//! action), `camera/` (sensor drivers over embedded-hal 1.0) and `board/`, which alone may touch registers.
#![no_std]

#[cfg(target_os = "none")]
pub mod board;
pub mod camera;
pub mod memory;
pub mod ports;
pub mod record;
pub mod selftest;
pub mod stages;
