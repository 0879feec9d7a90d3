//! `host`: parse, run, exit code.
fn main() {}
