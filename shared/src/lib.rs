//! Ossature's core: from two grey pictures of one object to its described, matched skeleton.
//!
//! * **In**: a rectified pair of 8-bit grey images, up to [`limits::MAX_SIDE`] px a side, and memory that the caller lends.
//! * **Out**: for each eye a mask and a sub-pixel contour, for the left one a skeleton as a graph; for the pair the depth
//!   of every medial ball and the skeleton's branches as NURBS in (u, v, radius, disparity). A pair that is not to be trusted gives a
//!   [`Finding`](pipeline::Finding) instead.
//! * **How**: `no_std`, without allocation, without `unsafe`, without a panic on any input; integers in the formats of
//!   [`fixed`], so that every machine gives the same bits. [`camera`] alone computes in floating point, once a calibration.
//! * **Units**: columns `u` and rows `v` in 1/256 px, pixel centres at whole numbers, `v` downwards; disparity
//!   `u_left - u_right`; depth is `f B / d` and left to the caller, who knows the baseline.
//!
//! Whoever wants it all calls [`pipeline::run`], or [`pipeline::Run`] for one picture at a time.
//! `shared/examples/sketch.rs` does so with all memory in a `static`; `shared/examples/watch.rs` looks on and lends a
//! loop. Each [`stage`] can be had by itself:
//!
//! ```
//! use shared::arena::Arena;
//! use shared::bitmap::{Grey, Size};
//! use shared::limits::CapacityError;
//! use shared::stage::binarise::{Tone, binarise, histogram, otsu};
//! use shared::stage::parallel_thinning::{Parallel, scratch_words, thin};
//!
//! const SIZE: Size = Size { width: 40, height: 20 };
//!
//! // A bright bar of 30 x 5 px on a dark ground.
//! let mut picture = [10; SIZE.pixels()];
//! for row in picture.chunks_mut(SIZE.width).skip(8).take(5) {
//!     row[5..35].fill(200);
//! }
//! let grey = Grey::new(SIZE, SIZE.width, &picture)?;
//!
//! let mut words = [0; SIZE.words()];
//! let mut mask = binarise(grey, otsu(&histogram(grey)), Tone::Bright, &mut words)?;
//! assert_eq!(mask.count(), 150);
//!
//! let mut scratch = [0; scratch_words(SIZE)];
//! thin(&mut mask, Parallel::GuoHall, Arena::new(&mut scratch))?;
//! let line = mask.bounds().expect("thinning leaves a line");
//! assert_eq!((line.min.v, line.max.v), (10, 10));
//! # Ok::<(), CapacityError>(())
//! ```
//!
//! Modules stand in the order in which data flows; `docs/algorithm.md` says which section of the paper each stage is,
//! and what was chosen where the paper is silent.
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

/// How many of a test's samples are taken: all, or by an interpreter, which is thousands of times slower, so few that
/// still take every path.
#[cfg(test)]
pub(crate) const fn samples(all: usize, interpreted: usize) -> usize {
    if cfg!(miri) { interpreted } else { all }
}
