//! Boards, one a feature: registers, interrupts and `unsafe` live here and nowhere else. What a board gives
//! out is safe, and says nothing of what it does with its parts. [`dsp`] is for all of them.

pub mod dsp;
#[cfg(feature = "h743")]
pub mod h743;
#[cfg(feature = "mps2")]
pub mod mps2;
