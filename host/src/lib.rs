//! Ossature on a PC, in the order in which data flows: a source gives a stereo pair, the calibration
//! says what its pixels mean, the core of `shared` describes and matches it, the stages here grow the
//! solid, and exports and reports write it down.
//!
//! Lengths are millimetres in the left camera's axes (x right, y down, z forward), images 8-bit grey, pixel centres at
//! whole numbers. A pair to a mesh in a file:
//!
//! ```no_run
//! use host::calibration::StereoCamera;
//! use host::reconstruct::{Options, reconstruct};
//! use host::source::picture::load_view;
//! use std::path::Path;
//!
//! let [left, right] = ["left.png", "right.png"].map(|name| load_view(Path::new(name)));
//! let camera = StereoCamera::read("calib.yaml")?;
//! let model = reconstruct(left?.image, right?.image, &camera, &Options::default(), &mut ())?;
//! host::export::write(Path::new("model.stl"), &model.mesh.into())?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! A pair that is not to be trusted is a [`Refusal`](reconstruct::Refusal), whose sentence says what to do. For many pairs,
//! [`Workspace`](reconstruct::Workspace) does the same without allocating anew. `host/examples/` has both as programs.

// What goes in.
pub mod source;
pub mod calibration;

// What happens to it.
pub mod memory;
mod lanes;
pub mod wide;
pub mod runs;
pub mod stage;
pub mod reconstruct;

// What comes out.
pub mod mesh;
pub mod curves;
pub mod geometry;
pub mod export;
pub mod report;
pub mod output;
mod unfinished;
pub mod live;
pub mod fleet;

// Many pairs on many machines.
#[cfg(feature = "batch")]
pub mod batch;

// What the user asks for.
pub mod config;
pub mod command;

// What it is compared with: built-in solids, rendered and measured, and simpler methods.
pub mod shape;
pub mod view;
pub mod bvh;
pub mod random;
pub mod render;
pub mod evaluate;
pub mod baseline;
pub mod experiment;

// For tests.
#[cfg(test)]
mod damaged;
