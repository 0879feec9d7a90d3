//! Ossature's core, in the order in which data flows.
#![no_std]
#![forbid(unsafe_code)]

// Foundation.
pub mod limits;
pub mod arena;
pub mod fixed;
pub mod point;
pub mod bitmap;
pub mod pack;
pub mod lanes;
pub mod pattern;
pub mod envelope;
pub mod strips;
pub mod camera;

// What happens to a picture.
pub mod stage;
pub mod pipeline;

// What of it goes over a link.
pub mod wire;
