//! The wire format: what one end writes is what the other reads, in bytes that are frozen, and any bytes give a
//! message that is safe to use or an error.
//!
//! `REGENERATE=1 cargo test -p system-tests --test wire` writes the frozen bytes anew. That is right only
//! together with a new version of the format: devices in the field do not change with the host.

use oracle::link;
use oracle::raster::Random;
use oracle::wire::{
    bytes, command, command_bytes, decode, each_command, each_message, read, report, survive,
};
use proptest::prelude::*;
use shared::bitmap::{Bitmap, Size};
use shared::limits::CapacityError;
use shared::pipeline::Finding;
use shared::wire::{
    Hello, PairReport, PictureKind, ToDevice, ToHost, VERSION, WireError, calibration_crc, pack_mask,
};
use std::path::Path;

#[test]
fn the_bytes_of_every_message_are_frozen() {
    let hex = |bytes: &[u8]| bytes.iter().map(|b| format!("{b:02x}")).collect::<String>();
    let mut found =
        String::from("# Frames of version 1, as tests/oracle/src/wire.rs names them.\n\n# to the host\n");
    each_message(|name, message| found += &format!("{name}: {}\n", hex(&bytes(&message))));
    found += "\n# to the device\n";
    for (name, command) in each_command() {
        found += &format!("{name}: {}\n", hex(&command_bytes(&command)));
    }
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/frozen/wire.txt");
    if std::env::var_os("REGENERATE").is_some() {
        std::fs::write(file, &found).unwrap();
    }
    assert_eq!(
        found,
        std::fs::read_to_string(file).unwrap_or_default(),
        "devices in the field do not change"
    );
}

#[test]
fn the_worked_bytes_of_the_document_are_right() {
    let page = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/wire-format.md");
    let page = std::fs::read_to_string(page).unwrap();
    let byte = |word: &str| u8::from_str_radix(word, 16).ok().filter(|_| word.len() == 2);
    let rows = page.lines().filter(|line| line.starts_with("00 ") && line.ends_with(" 00"));
    let worked: Vec<Vec<u8>> = rows.map(|line| line.split(' ').map_while(byte).collect()).collect();
    let mut all: Vec<Vec<u8>> = each_command().iter().map(|(_, c)| command_bytes(c)).collect();
    each_message(|_, message| all.push(bytes(&message)));
    assert!(worked.len() >= 3 && worked.iter().all(|frame| all.contains(frame)), "{worked:02x?}");
}

#[test]
fn every_message_comes_back() {
    each_message(|name, message| {
        let sent = bytes(&message);
        let [(kind, 1, payload)] = &link::frames(&sent)[..] else {
            panic!("{name} is no frame: {sent:02x?}")
        };
        assert_eq!(link::frame(*kind, 1, payload), sent, "{name}");
        read(&sent, |read| match (read.unwrap(), message) {
            (ToHost::Pair(read), ToHost::Pair(sent)) if sent.result.is_ok() => {
                // Of shapes, tests/wire_shape.rs.
                assert_eq!(PairReport { result: sent.result, ..read }, sent);
            }
            (read, sent) => assert_eq!(read, sent, "{name}"),
        });
        // What a newer device appends does not matter; what is cut off does.
        let longer = [payload.as_slice(), &[1, 2, 3]].concat();
        decode(*kind, &longer, |read| assert!(read.is_ok(), "{name}: {read:?}"));
        for len in 0..payload.len() {
            decode(*kind, &payload[..len], |read| assert_eq!(read, Err(WireError::Short), "{name} of {len}"));
        }
    });
    for (name, sent) in each_command() {
        let frames = link::frames(&command_bytes(&sent));
        let [(kind, 1, payload)] = &frames[..] else { panic!("{name} is no frame") };
        assert_eq!(command(*kind, &[payload.as_slice(), &[9]].concat()), Ok(sent), "{name}");
        for len in 0..payload.len() {
            assert_eq!(command(*kind, &payload[..len]), Err(WireError::Short), "{name} of {len}");
        }
        if let ToDevice::Calibration(model) = sent {
            assert_eq!(calibration_crc(&model), link::crc32(payload));
        }
    }
}

#[test]
fn another_version_is_named() {
    let other = (VERSION + 1).to_le_bytes();
    let theirs = VERSION + 1;
    decode(1, &other, |read| assert_eq!(read, Err(WireError::Version { theirs })));
    assert_eq!(command(0x81, &other), Err(WireError::Version { theirs }));
    let sentence = WireError::Version { theirs }.to_string();
    assert!(
        sentence.contains(&format!("version {VERSION}")) && sentence.contains(&format!("version {theirs}"))
    );
    decode(0x60, &[], |read| {
        assert_eq!(read, Err(WireError::Unknown { what: "message type", code: 0x60 }));
    });
    assert_eq!(command(0x60, &[]), Err(WireError::Unknown { what: "command", code: 0x60 }));
}

/// A terminal would obey it.
#[test]
fn a_name_of_a_board_is_no_command_to_a_terminal() {
    for board in ["\u{1b}]0;owned\u{7}", "mps2\n", "\u{9b}2J"] {
        let sent = bytes(&ToHost::Hello(Hello { board, ..oracle::wire::hello() }));
        read(&sent, |read| assert_eq!(read, Err(WireError::Invalid("name of a board")), "{board:?}"));
    }
}

#[test]
fn what_a_capacity_is_about_comes_back_by_name() {
    fn visit(folder: &Path, take: &mut impl FnMut(&str)) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                visit(&path, take);
            } else if !path.parent().unwrap().ends_with("wire") {
                take(std::fs::read_to_string(path).unwrap().split("#[cfg(test)]").next().unwrap());
            }
        }
    }
    let mut names = 0;
    visit(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/src"), &mut |code| {
        let direct = code.split("what: \"").skip(1);
        let pushed = code.split("push(").skip(1).filter_map(|call| call.split(';').next()?.split_once('"'));
        for text in direct.chain(pushed.map(|(_, text)| text)) {
            // The compiler keeps one copy of each text for good; so does the test.
            let what: &'static str = text.split('"').next().unwrap().to_owned().leak();
            let finding = Finding::Capacity(CapacityError { what, limit: 5 });
            read(&bytes(&report(Err(finding))), |read| {
                assert_eq!(read, Ok(report(Err(finding))), "{what} has no code in wire/finding.rs");
            });
            names += 1;
        }
    });
    assert!(names > 30, "{names} lists");
}

#[test]
fn a_mask_is_packed_row_by_row() {
    let mut random = Random(4);
    for width in [1, 7, 8, 31, 32, 33, 64, 65, 100] {
        let size = Size::new(width, 3).unwrap();
        let mut words = vec![0; size.words()];
        let mut mask = Bitmap::new(size, &mut words).unwrap();
        (0..3 * width).for_each(|i| mask.put(i % width, i / width, random.below(2) == 1));
        let mut out = [0; 16];
        for v in 0..3 {
            let packed = pack_mask(&mask, v, &mut out).unwrap();
            assert_eq!(packed.len(), PictureKind::Mask.row_bytes(width as u16));
            for u in 0..8 * packed.len() {
                assert_eq!(
                    packed[u / 8] >> (u % 8) & 1 == 1,
                    mask.get(u as i32, i32::from(v)),
                    "{u} of {width}"
                );
            }
        }
        assert!(pack_mask(&mask, 0, &mut out[..width.div_ceil(8) - 1]).is_err());
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_bytes_are_answered(kind in any::<u8>(), payload in proptest::collection::vec(any::<u8>(), 0..600)) {
        survive(kind, &payload);
        survive(kind % 6, &payload);
        survive(0x80 + kind % 12, &payload);
        oracle::wire::receive(&payload, |frame| survive(frame.kind, frame.payload));
    }

    #[test]
    fn spoilt_messages_with_right_check_sums_are_answered(
        which in any::<proptest::sample::Index>(),
        changes in proptest::collection::vec((any::<proptest::sample::Index>(), any::<u8>()), 1..6),
    ) {
        let mut all: Vec<(u8, u16, Vec<u8>)> =
            each_command().iter().flat_map(|(_, c)| link::frames(&command_bytes(c))).collect();
        each_message(|_, message| all.extend(link::frames(&bytes(&message))));
        // Most bytes of a shape are bits of its lists.
        let shape = all.iter().max_by_key(|(kind, _, payload)| (*kind == 2, payload.len())).unwrap().clone();
        let (kind, _, mut payload) = if which.index(2) == 0 { shape } else { which.get(&all).clone() };
        for (at, value) in &changes {
            if !payload.is_empty() {
                let at = at.index(payload.len());
                payload[at] = *value;
            }
        }
        survive(kind, &payload);
    }
}
