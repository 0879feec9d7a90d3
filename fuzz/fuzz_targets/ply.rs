//! Any bytes as a mesh in PLY.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| fuzz::mesh("mesh.ply", bytes));
