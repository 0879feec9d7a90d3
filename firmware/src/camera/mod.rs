//! Two ArduCAM Mini 2MP Plus modules as the device's eyes: a sensor OV2640 on a control bus, and the
//! ArduChip, which keeps one frame, on a picture bus.
//!
//! Generic over embedded-hal 1.0: [`registers`] says what the sensor is told and why, [`ov2640`] tells it,
//! [`control`] frees its wires, [`arducam`] fetches frames, [`test_picture`] judges colour bars, and [`pair`]
//! makes two modules one [`CameraPair`](crate::ports::CameraPair). `docs/camera.md` has the arithmetic and the
//! pitfalls.
//!
//! Written from the meanings of the registers and held against a model; not yet run on silicon.

pub mod registers;
pub mod control;
pub mod ov2640;
pub mod arducam;
pub mod test_picture;
pub mod pair;
