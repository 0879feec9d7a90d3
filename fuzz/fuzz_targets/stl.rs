//! Any bytes as a mesh in STL.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| fuzz::mesh("mesh.stl", bytes));
