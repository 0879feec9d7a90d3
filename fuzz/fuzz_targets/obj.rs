//! Any bytes as a mesh in OBJ.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| fuzz::mesh("mesh.obj", bytes));
