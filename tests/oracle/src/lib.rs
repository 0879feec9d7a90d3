//! Independent oracles: naive twins, shapes with known truth, a mesh checker.

pub mod graph;
pub mod mesh_checker;
pub mod nurbs;
pub mod raster;
