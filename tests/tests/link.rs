//! Frames over a link with faults: what is whole comes through, nothing else does, and everything is counted.

use oracle::link::{self, Fault};
use oracle::raster::Random;
use oracle::wire::{bytes, part, receive};
use shared::wire::{Counters, Decoder, MAX_FRAME, PictureKind, PicturePart, Sequence, ToHost};

#[test]
fn stuffing_and_check_sums_agree_with_their_twins() {
    assert_eq!(link::crc32(b"123456789"), 0xCBF4_3926);
    let mut random = Random(8);
    for case in 0..2000u64 {
        let len = if case < 1100 { case / 2 + 1 } else { 1 + random.below(4000) } as usize;
        let zeros = [0, 1, 60, 255][case as usize % 4];
        let rows: Vec<u8> = (0..len).map(|_| (random.below(256).max(zeros) - zeros) as u8).collect();
        let sent = bytes(&ToHost::Picture(PicturePart {
            first_row: 0,
            ..part(PictureKind::Grey, len as u16, 1, &rows)
        }));
        let [(3, 1, payload)] = &link::frames(&sent)[..] else { panic!("{len} bytes") };
        assert_eq!(link::frame(3, 1, payload), sent);
        let mut frames = 0;
        receive(&sent, |frame| {
            assert_eq!((frame.kind, frame.sequence, frame.payload), (3, 1, payload.as_slice()));
            frames += 1;
        });
        assert_eq!(frames, usize::from(payload.len() + 7 <= MAX_FRAME), "{len} bytes");
    }
}

/// A stream of frames whose payloads tell their numbers, and where each begins.
fn numbered(count: u16, random: &mut Random) -> (Vec<u8>, Vec<usize>) {
    let (mut stream, mut starts, mut sequence) = (Vec::new(), Vec::new(), Sequence::default());
    for number in 0..count {
        let mut payload = number.to_le_bytes().to_vec();
        payload.extend((0..random.below(90)).map(|_| random.below(4) as u8 * 80));
        starts.push(stream.len());
        stream.extend(link::frame(5, sequence.take(), &payload));
    }
    starts.push(stream.len());
    (stream, starts)
}

/// What the decoder hands out is exactly what is whole in the stream, and nothing but what was sent.
fn compare(stream: &[u8], sent: &[(u8, u16, Vec<u8>)], what: &str) -> (Vec<u16>, Counters) {
    let mut received = Vec::new();
    let counters = receive(stream, |f| received.push((f.kind, f.sequence, f.payload.to_vec())));
    let whole = stream.iter().position(|b| *b == 0).map_or(&[][..], |first| &stream[first..]);
    let complete = whole.iter().rposition(|b| *b == 0).map_or(&[][..], |last| &whole[..=last]);
    assert_eq!(received, link::frames(complete), "{what}");
    assert!(received.iter().all(|frame| sent.contains(frame)), "{what}: a wrong frame came through");
    assert_eq!(counters.frames as usize, received.len(), "{what}");
    (received.iter().map(|f| f.1).collect(), counters)
}

#[test]
fn no_flipped_frame_passes_as_another() {
    let mut random = Random(15);
    let mut rejected = 0;
    for case in 0..20_000u64 {
        let (mut stream, _) = numbered(1, &mut random);
        let sent = link::frames(&stream);
        Fault::Flips(1 + case % 9).strike(&mut stream, &mut random);
        let (received, counters) = compare(&stream, &sent, "flips");
        rejected += usize::from(received.is_empty());
        let told = counters.rejected_frames() + counters.partial > 0 || counters.rejected_bytes > 0;
        assert!(
            !received.is_empty() || told || stream.iter().all(|b| *b != 0) || *stream.last().unwrap() != 0
        );
    }
    println!("{rejected} of 20000 rejected");
    assert!(rejected > 19_000, "{rejected}");
}

#[test]
fn a_bad_link_loses_what_it_hits_and_no_more() {
    let mut random = Random(16);
    for case in 0..600u64 {
        let (mut stream, starts) = numbered(60, &mut random);
        let sent = link::frames(&stream);
        let faults =
            [Fault::Drops(300), Fault::Doubles(300), Fault::Noise(200), Fault::Drops(1), Fault::Flips(1)];
        let fault = faults[case as usize % faults.len()];
        let hit = fault.strike(&mut stream, &mut random);
        let (received, counters) = compare(&stream, &sent, &format!("{fault:?}"));
        let spoilt = starts.windows(2).filter(|w| w[0] < hit.end && hit.start < w[1]).count();
        let lost = 60 - (0..60).filter(|n| received.contains(n)).count();
        assert!(lost <= spoilt + 1, "{fault:?} hit {spoilt} frames and lost {lost}");
        let behind = received.iter().max().unwrap_or(&0);
        let first = received.first().unwrap_or(&0);
        let unseen = u32::from(*first) + 59 - u32::from(*behind);
        if !matches!(fault, Fault::Doubles(_)) {
            assert_eq!(counters.missing + unseen, lost as u32, "{fault:?}: {counters:?}");
        }
        let raw = stream.iter().filter(|b| **b != 0).count();
        let good: usize =
            stream.split(|b| *b == 0).filter(|f| !link::frames(f).is_empty()).map(<[u8]>::len).sum();
        let tail = stream.rsplit(|b| *b == 0).next().unwrap().len();
        assert_eq!(counters.rejected_bytes as usize + good + tail, raw, "{fault:?}: {counters:?}");
    }
}

#[test]
fn listening_may_begin_anywhere() {
    let mut random = Random(17);
    for _ in 0..300 {
        let (stream, starts) = numbered(12, &mut random);
        let sent = link::frames(&stream);
        let from = random.below(stream.len() as u64 / 2) as usize;
        let (received, counters) = compare(&stream[from..], &sent, "late");
        let whole = starts.iter().filter(|s| **s >= from && **s < stream.len()).count();
        assert_eq!(received.len(), whole);
        let within = stream[from] != 0;
        assert_eq!(
            counters,
            Counters {
                frames: whole as u32,
                partial: u32::from(within),
                rejected_bytes: counters.rejected_bytes,
                ..Counters::default()
            }
        );
    }
}

#[test]
fn bytes_without_end_are_counted_once_and_forgotten() {
    let (stream, _) = numbered(2, &mut Random(1));
    let mut noise = vec![7; 1 << 20];
    noise.insert(0, 0);
    noise.extend(&stream);
    let (received, counters) = compare(&noise, &link::frames(&stream), "noise");
    assert_eq!(received, [0, 1]);
    let expected = Counters { frames: 2, oversize: 1, rejected_bytes: 1 << 20, ..Counters::default() };
    assert_eq!(counters, expected);
    let mut endless = Decoder::new(&mut []);
    assert!((0..10_000).all(|k| endless.push((k % 255) as u8 + 1).is_none()));
    for byte in [0, 1, 2, 0, 3, 9, 0] {
        assert!(endless.push(byte).is_none());
    }
}

#[test]
fn what_is_no_frame_is_counted_by_its_kind() {
    let good = link::frame(4, 9, b"abc");
    let mut bad = good.clone();
    bad[8] ^= 0x40;
    let counters = |stream: &[&[u8]]| receive(&stream.concat(), |_| ());
    let one = Counters { frames: 1, ..Counters::default() };
    let rejected_bytes = good.len() as u32 - 2;
    assert_eq!(counters(&[&good, &bad]), Counters { bad_crc: 1, rejected_bytes, ..one });
    assert_eq!(counters(&[&good, &[5, 1, 1, 0]]), Counters { malformed: 1, rejected_bytes: 3, ..one });
    assert_eq!(
        counters(&[&good, &link::stuff(&[0; 6]), &[0]]),
        Counters { malformed: 1, rejected_bytes: 7, ..one }
    );
    assert_eq!(counters(&[&good, &good]), Counters { frames: 2, repeated: 1, ..one });
    assert_eq!(counters(&[&good, &link::frame(4, 12, b"")]), Counters { frames: 2, missing: 2, ..one });
    assert_eq!(counters(&[&good, &link::frame(4, 0, b"")]), Counters { frames: 2, ..one });
    let wrapped = [link::frame(4, u16::MAX, b""), link::frame(4, 1, b"")].concat();
    assert_eq!(counters(&[&wrapped]), Counters { frames: 2, ..one });
}
