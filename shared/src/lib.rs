//! Ossature's core, in the order in which data flows.
#![no_std]
#![forbid(unsafe_code)]

pub mod bitmap;
pub mod envelope;
pub mod fixed;
pub mod limits;
pub mod point;

pub mod stage;
