//! Stereo pairs from cameras that Linux knows: Video4Linux.
//!
//! ```text
//! kernel (or a simulated device) -> watch: stalls restarted, broken frames left out, one that was unplugged
//!     waited for -> pair: one frame that holds both eyes, or two that belong together
//!     -> live: the newest pair waits, older ones are dropped -> layout and format: grey views
//! ```
//!
//! Everything but [`kernel`] works on the trait [`device::Device`], and is tested with a simulated one that
//! stalls, breaks and vanishes as real ones do. Which mode a camera is set to is decided in [`choose`],
//! without touching it.

pub mod choose;
pub mod device;
pub mod dial;
pub mod errors;
pub mod format;
pub mod identity;
#[cfg(target_os = "linux")]
pub mod kernel;
#[cfg(not(target_os = "linux"))]
#[path = "no_kernel.rs"]
pub mod kernel;
pub mod layout;
pub mod live;
pub mod pair;
pub mod watch;

#[cfg(test)]
pub(crate) mod simulated;
