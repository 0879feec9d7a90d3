//! Renews the pictures and the quoted sentences of the pages about gates:
//! `cargo run --release -p system-tests --example gates -- docs/gates`.

use host::report::words::sentence;
use oracle::gates::{all, picture, renewed};
use std::error::Error;
use std::fs;
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).ok_or("give the folder of the pages")?);
    for gate in all() {
        let tripped = gate.trip()?;
        picture(&gate, &tripped).save(folder.join(gate.name).with_extension("png"))?;
        let page = folder.join(gate.name).with_extension("md");
        let sentence = sentence(&tripped.finding);
        println!("{}: {sentence}", gate.name);
        fs::write(&page, renewed(&fs::read_to_string(&page)?, &sentence))?;
    }
    Ok(())
}
