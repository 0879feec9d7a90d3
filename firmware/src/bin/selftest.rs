//! The self-test on an emulated board of 128 KB of RAM: exits with 0 when the core gives what it must.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod board {
    use firmware::board::mps2::refuse;
    use firmware::memory::Small;
    use firmware::selftest::run;
    use semihosting::{println, process};
    use static_cell::ConstStaticCell;

    static STORAGE: ConstStaticCell<Small> = ConstStaticCell::new(Small::new());

    #[cortex_m_rt::entry]
    fn main() -> ! {
        match run(STORAGE.take()) {
            Ok(disparity) => println!("disparity {disparity}"),
            Err(finding) => refuse(format_args!("{finding:?}")),
        }
        process::exit(0)
    }
}

#[cfg(not(target_os = "none"))]
fn main() {
    println!("this runs on an emulated board: see firmware/README.md");
}
