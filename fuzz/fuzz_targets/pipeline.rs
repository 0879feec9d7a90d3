//! The whole core on any two pictures, by any settings: it answers, its lists hang together, this machine's kernels
//! and the portable ones agree in memory that is dirty, whoever looks on, and a shape survives the wire.
#![no_main]

use arbitrary::Arbitrary;
use fuzz::figure::{Figure, draw};
use host::memory::Storage;
use host::source::serial::inbox::{Inbox, Message};
use libfuzzer_sys::fuzz_target;
use oracle::core::hangs_together;
use oracle::wire::check;
use shared::bitmap::{Grey, Size, WORD_BITS};
use shared::fixed::PX;
use shared::pipeline::{self, Finding, Kernels, Memory, Method, Observer, Product, Settings, Side};
use shared::stage::binarise::{Polarity, Threshold};
use shared::stage::correspond::PaperMatching;
use shared::stage::depth::Optics;
use shared::stage::thinning::Rule;
use shared::wire::{Frame, PairReport, Shape, ToHost};
use std::cell::RefCell;

#[derive(Arbitrary, Debug)]
struct Case {
    /// 0 to 96, or as far from an edge of words.
    size: [u8; 2],
    at_word: bool,
    shift: u8,
    scene: Vec<Figure>,
    right_only: Option<Figure>,
    choice: Choice,
}

#[derive(Arbitrary, Debug)]
struct Choice {
    device: bool,
    paper: Option<(u8, u16)>,
    median: bool,
    sub_pixel: bool,
    level: Option<u8>,
    polarity: u8,
    rule: u8,
    optics: u8,
}

impl Choice {
    fn settings(&self) -> Settings {
        let optics = [
            Optics { focal: 750 * PX, disparity_offset: 0 },
            Optics { focal: 1, disparity_offset: 1 << 20 },
            Optics { focal: 1 << 22, disparity_offset: -(1 << 20) },
        ][usize::from(self.optics % 3)];
        if self.device {
            return Settings::device(optics);
        }
        let chosen = match self.paper {
            None => Settings::new(optics),
            Some((omega, threshold)) => {
                let omega = 1 + usize::from(omega % 3);
                Settings::paper(optics, PaperMatching { omega, threshold: i32::from(threshold) << 15 })
            }
        };
        Settings {
            median: self.median,
            sub_pixel: self.sub_pixel,
            threshold: self.level.map_or(Threshold::Otsu, Threshold::Fixed),
            polarity: [Polarity::BrightObject, Polarity::DarkObject, Polarity::Auto]
                [usize::from(self.polarity % 3)],
            thinning: [Rule::HitOrMiss, Rule::ZhangSuen, Rule::GuoHall, Rule::EdtOrdered]
                [usize::from(self.rule % 4)],
            ..chosen
        }
    }
}

/// Who looks on, and may want to see both skeletons.
struct Onlooker {
    curious: bool,
}

impl Observer for Onlooker {
    fn saw(&mut self, _: Option<Side>, _: Product<'_>) {}

    fn wants_both_skeletons(&self) -> bool {
        self.curious
    }
}

/// Memories as earlier runs left them, where a shape arrives that came over the wire, and room for its frame.
struct Desk {
    memories: [Storage; 2],
    inbox: Inbox,
    frame: Vec<u8>,
}

thread_local! {
    static DESK: RefCell<Desk> = RefCell::new(Desk {
        memories: Default::default(),
        inbox: Inbox::new().expect("memory for shapes"),
        frame: vec![0; 1 << 20],
    });
}

fn side(length: u8, at_word: bool) -> usize {
    if at_word { WORD_BITS - 2 + usize::from(length % 5) } else { usize::from(length % 97) }
}

fuzz_target!(|case: Case| {
    let (width, height) = (side(case.size[0], case.at_word), usize::from(case.size[1] % 97));
    let left = draw(width, height, &case.scene);
    let right = moved(&left, width, case.shift.into(), case.right_only.as_ref());
    let settings = case.choice.settings();
    DESK.with_borrow_mut(|desk| {
        let Desk { memories: [first, second], inbox, frame } = desk;
        let run = |storage: &mut Storage, portable: bool, mut onlooker: Onlooker| {
            storage.fit(width, height).expect("a small picture");
            let grey =
                |bytes| Grey::new(Size { width, height }, width, bytes).expect("as many bytes as pixels");
            let mut memory = storage.lend();
            if portable {
                memory.kernels = Kernels::PORTABLE;
            }
            let answer = pipeline::run(&mut memory, grey(&left), grey(&right), &settings, &mut onlooker);
            if let Ok(outcome) = &answer {
                hangs_together(&memory, outcome);
            }
            answer
        };
        let answer = run(first, false, Onlooker { curious: false });
        assert_eq!(run(second, true, Onlooker { curious: true }), answer);
        assert!(!matches!(answer, Err(Finding::Capacity(_))), "there is room: {answer:?}");
        let Ok(outcome) = answer else { return };
        let (one, other) = (first.lend(), second.lend());
        let both_skeletons = matches!(settings.method, Method::Paper(_));
        agree(&one, &other, Size { width, height }.words(), both_skeletons);
        if case.choice.paper.is_none() || case.choice.device {
            survive(Shape::of(&one, &outcome), inbox, frame);
        }
    });
});

/// The left picture, seen from further right.
fn moved(left: &[u8], width: usize, shift: usize, own: Option<&Figure>) -> Vec<u8> {
    let mut right = left.to_vec();
    for row in right.chunks_mut(width.max(1)) {
        let ground = row.last().copied().unwrap_or(0);
        let shift = shift.min(row.len());
        row.copy_within(shift.., 0);
        row[width - shift..].fill(ground);
    }
    if let Some(own) = own {
        own.draw(width, &mut right);
    }
    right
}

/// Whether two runs left the same, in masks of so many words, but for the right eye's graph unless the method asks
/// for it.
fn agree(one: &Memory<'_>, other: &Memory<'_>, words: usize, both_skeletons: bool) {
    for (eye, (a, b)) in one.eyes.iter().zip(&other.eyes).enumerate() {
        assert!(a.mask[..words] == b.mask[..words]);
        if eye == 0 || both_skeletons {
            assert!(a.graph.nodes == b.graph.nodes && a.graph.edges == b.graph.edges);
            assert!(a.graph.path == b.graph.path && a.graph.members == b.graph.members);
        }
        assert!(a.contour == b.contour && a.loops == b.loops && a.hull == b.hull);
        assert!(a.samples == b.samples && a.branches == b.branches && a.controls == b.controls);
    }
    assert!(one.matches == other.matches && one.balls == other.balls && one.depths == other.depths);
    assert!(one.boundary_pairs == other.boundary_pairs && one.skeleton_pairs == other.skeleton_pairs);
}

/// Write a shape and read it back.
fn survive(shape: Shape<'_>, inbox: &mut Inbox, frame: &mut [u8]) {
    let report = PairReport {
        number: 1,
        stamps: [0; 2],
        levels: [0; 2],
        exposures: Default::default(),
        result: Ok(shape),
    };
    let len = ToHost::Pair(report).encode(1, frame).expect("room for the shape of a small picture");
    let (kind, sequence, payload) = oracle::link::frames(&frame[..len]).pop().expect("a frame");
    let frame = Frame { kind, sequence, repeated: false, payload: &payload };
    let read = inbox.read(&frame).expect("a host has room for every shape");
    let Message::Pair(pair) = read else { panic!("a pair came back as {read:?}") };
    let outcome = pair.result.expect("it is not refused");
    let memory = inbox.memory();
    let read = Shape::of(&memory, &outcome);
    assert_eq!(read.contour.len(), shape.contour.len());
    check(read);
}
