//! Generated pairs on every way there is: memory of the host and of boards, wide kernels and portable ones, one thread
//! and five, emulated boards of two processors, whose words have 32 bits. Builds are held against each other by a file.

use oracle::board;
use oracle::emulated::{self, Case};
use oracle::generated::case;
use oracle::sums::Bench;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::thread;
use std::time::Instant;

/// Cases that a board is given at once.
const BATCH: u64 = 250;

/// Goes all ways with so many pairs.
pub(crate) fn run(count: u64, sums: Option<&Path>) {
    let begun = Instant::now();
    let found = thread::scope(|scope| {
        let image = board::build("stages", "mps2");
        let boards = board::MACHINES.map(|machine| {
            let image = image.clone();
            scope.spawn(move || image.map(|image| on_a_board(machine, &image, count)))
        });
        let found = on_this_machine(count);
        for board in boards {
            board.join().expect("it agrees, or was said to be missing");
        }
        found
    });
    println!("{count} pairs in {:.1} min", begun.elapsed().as_secs_f64() / 60.0);
    let Some(file) = sums else { return };
    match fs::read_to_string(file) {
        Ok(other) => {
            let differ = found.lines().zip(other.lines()).find(|(one, other)| one != other);
            assert!(differ.is_none(), "not what {} has: {differ:?}", file.display());
            assert_eq!(found.len(), other.len(), "{} is of another number of pairs", file.display());
            println!("the same as in {}", file.display());
        }
        Err(_) => fs::write(file, found).expect("a file"),
    }
}

/// The sums of each pair.
fn on_this_machine(count: u64) -> String {
    let (mut bench, mut found) = (Bench::default(), String::new());
    for number in 0..count {
        // Text takes every text.
        let _ = writeln!(found, "{number} {}", bench.sums(&case(number)));
    }
    println!(
        "this machine: {count} pairs, {} surfaces; {} are too much for a board's memory",
        bench.models, bench.short
    );
    found
}

/// A board makes the same of each pair, if it is there.
fn on_a_board(machine: &str, image: &Path, count: u64) {
    let (mut bench, mut stages) = (Bench::default(), 0);
    for first in (0..count).step_by(BATCH as usize) {
        let cases: Vec<Case> = (first..count.min(first + BATCH)).map(case).collect();
        let Some(found) = emulated::run(machine, image, &cases) else { return };
        for (case, found) in cases.iter().zip(found) {
            let found: Vec<String> = found.into_iter().map(|(line, _)| line).collect();
            let (expected, short) = bench.as_a_board(case);
            let told = found.len() - usize::from(short);
            let same = found.len() == expected.len() && found[..told] == expected[..told];
            assert!(same, "{machine}, {}: {found:#?} is not {expected:#?}", case.name);
            stages += found.len();
        }
    }
    println!("{machine}: {count} pairs, {stages} products of stages");
}
