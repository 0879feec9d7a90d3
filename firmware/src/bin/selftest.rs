//! The self-test on an emulated board of 128 KB of RAM: exits with 0 when the core gives what it must.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod board {
    use firmware::memory::Small;
    use firmware::selftest::run;
    use semihosting::{println, process};
    use static_cell::ConstStaticCell;

    static STORAGE: ConstStaticCell<Small> = ConstStaticCell::new(Small::new());

    #[cortex_m_rt::entry]
    fn main() -> ! {
        let disparity = run(STORAGE.take()).expect("the ring is found");
        println!("disparity {disparity}");
        process::exit(0)
    }
}

#[cfg(not(target_os = "none"))]
fn main() {
    println!("this runs on an emulated board: see firmware/README.md");
}
