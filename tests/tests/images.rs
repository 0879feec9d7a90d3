//! What the linked images of the boards are made of: no panic in our own code, a list of those in the code of others,
//! and the deepest that their stacks can become. And what follows when it goes wrong all the same: a stack that is
//! too small is a fault, and a board that hangs is reset.
//!
//! Says loudly when QEMU is not there, and fails then if `CI=true`.
//!
//! `cargo test -p system-tests --test images -- --nocapture` prints the figures of docs/reliability.md.
#![cfg(unix)]

use oracle::board;
use oracle::image::{Image, Location, patched};
use oracle::program::within;
use oracle::stack::{Known, deepest, sum};
use oracle::wire::Lists;
use shared::wire::{Decoder, Health, Hello, MAX_FRAME, PictureKind, ResetReason, ToDevice, ToHost};
use std::collections::{BTreeMap, BTreeSet};
use std::io::{Read, Write};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// The images that run for months, and the one for the least memory, with their boards.
const IMAGES: [(&str, &str); 3] = [("camera", "h743"), ("device", "mps2"), ("selftest", "mps2")];

/// All images; none where they cannot be built.
fn images() -> &'static [(PathBuf, Image)] {
    static ALL: LazyLock<Vec<(PathBuf, Image)>> = LazyLock::new(|| {
        let built = IMAGES.map(|(name, board)| board::build(name, board));
        built.into_iter().flatten().map(|path| (path.clone(), Image::read(&path))).collect()
    });
    &ALL
}

fn frozen(name: &str) -> String {
    let path = format!("{}/frozen/{name}", env!("CARGO_MANIFEST_DIR"));
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// A place of ours as an error; else as it is listed: by its package and version, or by the language's file, whose
/// lines differ from one compiler to the next.
fn listed((file, line, column): &Location) -> Result<String, String> {
    if let Some((_, package)) = file.split_once("/registry/src/") {
        let (_, path) = package.split_once('/').unwrap_or_default();
        return Ok(format!("{path}:{line}:{column}"));
    }
    if let Some((_, path)) = file.split_once("/library/") {
        return Ok(format!("library/{path}"));
    }
    Err(format!("{file}:{line}:{column}"))
}

/// Panics by which no code of ours can end an image, and the list of those of others, each for a reason.
#[test]
fn our_own_code_cannot_panic_and_that_of_others_is_on_a_list() {
    let mut found = BTreeMap::<String, BTreeSet<&str>>::new();
    let mut ours = Vec::new();
    for (_, image) in images() {
        let places = image.panics();
        assert!(!places.is_empty(), "{}: the places of panics are not where they were", image.name);
        let logged = image.logged_panics().into_iter().map(|(package, sentence)| {
            let line = format!("{package}: {sentence}");
            if package == "firmware" { Err(line) } else { Ok(line) }
        });
        let all: Vec<_> = places.iter().map(listed).chain(logged).collect();
        println!("{}: {} places of panics", image.name, all.len());
        for panic in all {
            match panic {
                Ok(panic) => drop(found.entry(panic).or_default().insert(&image.name)),
                Err(panic) => ours.push(format!("{}: {panic}", image.name)),
            }
        }
    }
    assert!(ours.is_empty(), "these can panic:\n{}", ours.join("\n"));
    if images().len() < IMAGES.len() {
        return;
    }

    let text = frozen("panics.txt");
    let known: BTreeSet<_> = text.lines().filter(|line| !line.starts_with('#') && !line.is_empty()).collect();
    let line = |(panic, images): (&String, &BTreeSet<&str>)| {
        format!("{} | {panic}", images.iter().copied().collect::<Vec<_>>().join(" "))
    };
    let found: BTreeSet<_> = found.iter().map(line).collect();
    let new: Vec<_> =
        found.iter().filter(|line| !known.contains(line.as_str())).map(String::as_str).collect();
    let gone: Vec<_> = known.into_iter().filter(|line| !found.contains(*line)).collect();
    let (new, gone) = (new.join("\n"), gone.join("\n"));
    assert!(new.is_empty() && gone.is_empty(), "frozen/panics.txt, to be added:\n{new}\nto go:\n{gone}");
    for group in text.split("\n\n") {
        assert!(group.starts_with('#'), "no reason above {group:?}");
    }
}

#[test]
fn no_stack_becomes_deeper_than_it_may() {
    let known = Known::read(&frozen("calls.txt"));
    let mut used = BTreeSet::new();
    for (_, image) in images() {
        let (chains, asked) =
            deepest(image, &known).unwrap_or_else(|error| panic!("{}: {error}", image.name));
        used.extend(asked);
        let (worst, room) = (sum(&chains), image.stack().len() as u32);
        println!(
            "{}: {worst} bytes of {room} at most, in {} handlers and below:",
            image.name,
            chains.len() - 1
        );
        for chain in &chains {
            println!("  {} bytes from", chain.depth);
            chain.calls.iter().for_each(|(name, depth)| println!("    {depth:6} {name}"));
        }
        assert!(worst <= room, "{}: {worst} bytes of {room}", image.name);
    }
    let listed = known.callees.keys().chain(known.callees.values().flatten()).chain(&known.ends);
    let idle: Vec<_> = listed.filter(|name| !used.contains(*name)).collect();
    assert!(
        images().len() < IMAGES.len() || idle.is_empty(),
        "frozen/calls.txt has what nobody calls: {idle:#?}"
    );
}

/// The image of this name; none where it cannot be built.
fn image(name: &str) -> Option<&'static (PathBuf, Image)> {
    images().iter().find(|(_, image)| image.name == name)
}

/// The bound is one, and its measure: with so much stack the self-test runs on the boards, with less it does until it
/// faults, and never does anything else.
#[test]
fn a_stack_that_is_too_small_is_a_fault() {
    const ENOUGH: Duration = Duration::from_secs(60);
    let Some((path, image)) = image("selftest") else { return };
    let (chains, _) = deepest(image, &Known::read(&frozen("calls.txt"))).unwrap();
    // What runs before an interrupt, of which the self-test has none.
    let bound = chains[0].depth.next_multiple_of(8);
    let machine = board::MACHINES[0];
    let runs = |bytes: u32| {
        let top = (image.stack().start + bytes).to_le_bytes();
        let status = board::ending(machine, patched(path, image.vectors(), &top).path(), ENOUGH)?;
        let faulted =
            std::os::unix::process::ExitStatusExt::signal(&status) == Some(6) || status.code() == Some(70);
        assert!(status.success() || faulted, "with {bytes} bytes of stack: {status}");
        Some(status.success())
    };
    let Some(enough) = runs(bound) else { return };
    assert!(enough, "{bound} bytes are not enough, which were said to be");
    let (mut less, mut more) = (0, bound);
    while more - less > 64 {
        let middle = (less + more) / 16 * 8;
        *(if runs(middle) == Some(true) { &mut more } else { &mut less }) = middle;
    }
    println!("selftest: {bound} bytes of stack computed, {more} measured");
}

/// A board that waits for ever is reset by its watchdog, and says so when it is asked next.
#[test]
fn a_board_that_hangs_is_reset_and_says_so() {
    let Some((path, device)) = image("device") else { return };
    let read = device
        .functions()
        .find(|function| function.name.contains("mps2::eyes::Eyes") && function.name.ends_with("::read"));
    // It goes round and round where it would read a picture: b .
    let hanging = patched(path, read.expect("eyes that read").start, &0xE7FEu16.to_le_bytes());
    let folder = TempDir::new().unwrap();
    let pictures = folder.path().join("pictures");
    std::fs::write(&pictures, vec![0; 2 * 320 * 240]).unwrap();
    let port = within(folder.path(), "board.socket");
    let socket = format!("socket,id=line,path={port},server=on,wait=on");
    // The minute of the emulated watchdog is one of emulated time, which goes by the instructions.
    let quick = ["-icount", "shift=10,align=off,sleep=off", "-chardev", &socket, "-serial", "chardev:line"];
    for machine in board::MACHINES {
        let Some(_board) = board::start(machine, hanging.path(), &[&pictures], &quick) else { return };
        let mut line = Line::to(Path::new(&port));
        let hello = |message: &ToHost<'_>| match message {
            ToHost::Hello(Hello { reset, .. }) => Some(*reset),
            _ => None,
        };
        let bites = |message: &ToHost<'_>| match message {
            ToHost::Health(Health { watchdog_resets, .. }) => Some(*watchdog_resets),
            _ => None,
        };
        assert_eq!(line.wait(hello), ResetReason::Unknown, "{machine}");
        for bitten in 1..=2 {
            line.say(&ToDevice::Grab(PictureKind::Grey));
            assert_eq!(line.wait(hello), ResetReason::Watchdog, "{machine}");
            line.say(&ToDevice::Health);
            assert_eq!(line.wait(bites), bitten, "{machine}");
        }
        std::fs::remove_file(&port).unwrap();
    }
}

/// The host's end of a board's serial line.
struct Line(UnixStream);

impl Line {
    fn to(port: &Path) -> Self {
        let end = Instant::now() + Duration::from_secs(30);
        loop {
            match UnixStream::connect(port) {
                Ok(stream) => return Self(stream),
                Err(error) => assert!(Instant::now() < end, "{error}"),
            }
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    fn say(&mut self, command: &ToDevice) {
        let mut frame = [0; 64];
        let length = command.encode(1, &mut frame).unwrap();
        self.0.write_all(&frame[..length]).unwrap();
    }

    /// What `take` makes of the first message that it takes.
    fn wait<T>(&mut self, take: impl Fn(&ToHost<'_>) -> Option<T>) -> T {
        let (mut buffer, mut byte) = (vec![0; MAX_FRAME], [0]);
        let (mut decoder, mut lists) = (Decoder::new(&mut buffer), Lists::default());
        self.0.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
        loop {
            self.0.read_exact(&mut byte).expect("the board speaks");
            let frame = decoder.push(byte[0]);
            if let Some(taken) =
                frame.and_then(|frame| take(&ToHost::decode(&frame, &mut lists.lend()).ok()?))
            {
                return taken;
            }
        }
    }
}
