//! Independent oracles: naive twins, shapes with known truth, a mesh checker.

pub mod board;
pub mod browser;
pub mod camera;
pub mod cases;
pub mod confidence;
pub mod core;
pub mod device;
pub mod emulated;
pub mod gates;
pub mod generated;
pub mod graph;
pub mod image;
pub mod images;
pub mod kernels;
pub mod link;
pub mod looks;
pub mod matching;
pub mod mesh_checker;
pub mod nurbs;
pub mod program;
pub mod raster;
pub mod scene;
#[cfg(unix)]
pub mod socket;
pub mod stack;
pub mod sums;
pub mod thumb;
pub mod wire;
