//! Ossature on a PC, in the order in which data flows: a source gives a stereo pair, the calibration
//! says what its pixels mean, the core of `shared` describes and matches it, the stages here grow the
//! solid, and exports and reports write it down.

// What goes in.
pub mod source;
pub mod calibration;

// What happens to it.
pub mod memory;
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

// What the user asks for.
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
