//! What the firmware takes of a board: flash and memory of every image, read from the image itself, within
//! bounds; and that the smallest profile runs in 128 KB, stack and all.
//!
//! `cargo test --release -p system-tests --test footprint -- --nocapture` prints the table of docs/numbers.md.
//! Says loudly when the target is not installed, and fails then if `CI=true`.

use object::{Object, ObjectSection, ObjectSymbol, SectionFlags, elf};
use oracle::board;
use std::path::Path;
use std::time::Duration;

const KB: u64 = 1024;

/// Bytes of a board that an image takes.
struct Footprint {
    /// Code, constants, and what variables start with.
    flash: u64,
    /// Variables, without the stack.
    memory: u64,
    /// The stack: beyond it lies no memory.
    stack: u64,
}

fn footprint(image: &Path) -> Footprint {
    let bytes = std::fs::read(image).unwrap();
    let file = object::File::parse(&*bytes).unwrap();
    let mut footprint = Footprint { flash: 0, memory: 0, stack: 0 };
    for section in file.sections() {
        let SectionFlags::Elf { sh_flags, .. } = section.flags() else { panic!("no ELF file") };
        let is = |flag: elf::SectionFlags| sh_flags.0 & flag.0 != 0;
        let zeroed = section.kind().is_bss();
        if is(elf::SHF_ALLOC) {
            footprint.flash += if zeroed { 0 } else { section.size() };
            footprint.memory += if is(elf::SHF_WRITE) { section.size() } else { 0 };
        }
    }
    let symbol = |name: &str| file.symbol_by_name(name).unwrap_or_else(|| panic!("no {name}")).address();
    footprint.stack = symbol("_stack_start") - symbol("_stack_end");
    let name = image.file_name().unwrap().to_string_lossy();
    println!("| {name} | {} | {} | {} |", footprint.flash, footprint.memory, footprint.stack);
    footprint
}

#[test]
fn the_cameras_image_leaves_room() {
    let Some(image) = board::build("camera", "h743") else { return };
    let camera = footprint(&image);
    assert!(camera.flash <= 256 * KB, "{} bytes of flash", camera.flash);
    assert!(camera.memory <= 400 * KB, "{} bytes of memory", camera.memory);
}

#[test]
fn the_smallest_profile_runs_in_128_kb() {
    let Some(image) = board::build("selftest", "mps2") else { return };
    let small = footprint(&image);
    assert!(small.memory + small.stack <= 128 * KB, "{} + {} bytes", small.memory, small.stack);
    assert!(small.flash <= 256 * KB, "{} bytes of flash", small.flash);
    for machine in board::MACHINES {
        let Some(said) = board::run(machine, &image, &[], Duration::from_secs(60)) else { return };
        assert_eq!(said, "disparity 5119\n", "{machine}: what the test of firmware/src/selftest.rs has");
    }
}
