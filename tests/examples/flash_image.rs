//! The camera's image as its flash holds it, for boards that take a file copied onto their drive:
//!
//! `cargo run -p system-tests --example flash_image` builds it and writes `target/camera.bin`.

use object::Endianness;
use object::read::elf::{ElfFile32, ProgramHeader};
use oracle::board;
use std::path::Path;

fn main() {
    let Some(elf) = board::build("camera", "h743") else { std::process::exit(1) };
    let bytes = std::fs::read(elf).expect("it was just built");
    let file = ElfFile32::<Endianness>::parse(&*bytes).expect("an ELF file");
    let endian = file.endian();
    let loaded = file.elf_program_headers().iter().filter(|header| header.p_filesz(endian) > 0);
    let mut pieces: Vec<_> = loaded
        .map(|header| (header.p_paddr(endian), header.data(endian, &*bytes).expect("a whole file")))
        .collect();
    pieces.sort();
    let first = pieces[0].0;
    let mut image = Vec::new();
    for (address, piece) in pieces {
        // What lies between stays as erased flash is.
        image.resize((address - first) as usize, 0xFF);
        image.extend_from_slice(piece);
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../target/camera.bin");
    std::fs::write(&path, &image).expect("target/ can be written");
    println!("target/camera.bin: {} bytes, for flash from {first:#010x} on", image.len());
}
