//! Ossature on a PC, in the order in which data flows: a source gives a stereo pair, the calibration
//! says what its pixels mean, the core of `shared` describes and matches it, the stages here grow the
//! solid, and exports and reports write it down.

pub mod bvh;
pub mod calibration;
pub mod evaluate;
pub mod export;
pub mod memory;
pub mod mesh;
pub mod random;
pub mod reconstruct;
pub mod render;
pub mod report;
pub mod shape;
pub mod stage;
pub mod view;
