//! Files of the PC that the emulator runs on.

use core::ffi::CStr;
use semihosting::experimental::env::args;
use semihosting::fs::File;

/// Bytes of a path and of all arguments.
const LONGEST: usize = 1024;

/// The file that the image's first argument names, open to be read.
///
/// # Panics
/// When there is no argument, or no such file.
pub fn argument() -> File {
    let arguments = args::<LONGEST>().expect("arguments");
    let path = (&arguments).into_iter().nth(1).expect("an argument, a file").expect("text");
    let mut name = [0; LONGEST];
    name[..path.len()].copy_from_slice(path.as_bytes());
    let path = CStr::from_bytes_until_nul(&name).expect("ended by zero");
    File::open(path).unwrap_or_else(|_| panic!("cannot open {path:?}"))
}
