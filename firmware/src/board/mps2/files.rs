//! Files of the PC that the emulator runs on.

use core::ffi::CStr;
use core::fmt::Display;
use semihosting::experimental::env::args;
use semihosting::fs::File;
use semihosting::{eprintln, process::exit};

/// Bytes of a path and of all arguments.
const LONGEST: usize = 1024;

/// Exit code of an image that cannot run like this.
const REFUSED: i32 = 1;

/// End the image with a sentence.
pub fn refuse(why: impl Display) -> ! {
    eprintln!("{why}");
    exit(REFUSED)
}

/// The file that the image's first argument names, open to be read. The image ends when there is none.
pub fn argument() -> File {
    let Ok(arguments) = args::<LONGEST>() else {
        refuse(format_args!("the arguments cannot be read: at most {LONGEST} bytes"))
    };
    let Some(Ok(path)) = (&arguments).into_iter().nth(1) else {
        refuse("the first argument must be a file's path, in UTF-8")
    };
    let mut name = [0; LONGEST];
    name.iter_mut().zip(path.bytes()).for_each(|(place, byte)| *place = byte);
    let file = CStr::from_bytes_until_nul(&name).ok().and_then(|name| File::open(name).ok());
    file.unwrap_or_else(|| refuse(format_args!("cannot open {path}")))
}
