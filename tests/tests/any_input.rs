//! Whatever the pictures show, the whole core answers in both modes: it does not panic, no sum overflows
//! (the profile of these tests checks), its lists hang together, the same memory used again gives the
//! same answer, and memory that is too short is a finding.

use host::memory::Storage;
use oracle::core::{Core, Picture, hangs_together, picture, size};
use oracle::raster::Random;
use shared::arena::Arena;
use shared::bitmap::{Grey, Size, WORD_BITS};
use shared::fixed::PX;
use shared::pipeline::{Finding, Observer, Outcome, Product, Run, Settings, Side, run};
use shared::stage::binarise::{Polarity, Threshold};
use shared::stage::correspond::PaperMatching;
use shared::stage::depth::Optics;
use shared::stage::thinning::Rule;

const OPTICS: Optics = Optics { focal: 750 * PX, disparity_offset: 0 };

/// Default and paper mode with everything that a user can choose, drawn at random.
fn settings(random: &mut Random) -> Settings {
    let mut draw = |n: u64| random.below(n) as usize;
    let optics = [
        OPTICS,
        Optics { focal: 1, disparity_offset: 1 << 20 },
        Optics { focal: 1 << 22, disparity_offset: -(1 << 20) },
    ][draw(3)];
    let paper = PaperMatching { omega: 1 + draw(3), threshold: [0, 3000, i32::MAX][draw(3)] };
    let chosen = if draw(2) == 0 { Settings::new(optics) } else { Settings::paper(optics, paper) };
    Settings {
        median: draw(2) == 0,
        threshold: [Threshold::Otsu, Threshold::Fixed(100), Threshold::Fixed(0), Threshold::Fixed(255)]
            [draw(4)],
        polarity: [Polarity::BrightObject, Polarity::DarkObject, Polarity::Auto][draw(3)],
        thinning: [Rule::HitOrMiss, Rule::ZhangSuen, Rule::GuoHall, Rule::EdtOrdered][draw(4)],
        ..chosen
    }
}

/// Pictures that have nothing in common but that a camera could send them.
fn pictures(random: &mut Random) -> [Picture; 2] {
    let mut draw = |n: usize| random.below(n as u64) as usize;
    let width = [draw(140), 1, WORD_BITS - 1 + draw(3), 2 * WORD_BITS - 1 + draw(3), 90][draw(5)];
    let height = [draw(90), 1, 60, 60][draw(4)];
    let (kind, a, b, c) = (draw(14), draw(width + 1), draw(height + 1), 1 + draw(30));
    let shift = draw(12);
    let noise: Vec<u8> = (0..1 << 15).map(|_| draw(256) as u8).collect();
    let at = |u: usize, v: usize| noise[(v * 151 + u) % noise.len()];
    let grey = |on: bool| if on { 210 } else { 12 };
    let draws = |u: usize, v: usize| match kind {
        0 => at(u, v),
        1 => grey((u + v).is_multiple_of(2)),
        2 => grey((u, v) == (a, b)),
        3 => grey((WORD_BITS - 1..=WORD_BITS).contains(&u)),
        4 => grey(u.is_multiple_of(WORD_BITS) || v.is_multiple_of(3)),
        5 => grey(u < a && v < b),
        6 => grey(u.abs_diff(a).pow(2) + v.abs_diff(b).pow(2) < c * c),
        7 => grey(u.abs_diff(width / 2).pow(2) + v.abs_diff(height / 2).pow(2) < c * c),
        8 => (u * 255 / width.max(1)) as u8,
        9 => grey(u % 4 < 2 || v == 0),
        10 => grey(u.abs_diff(v) < 1 + c / 8),
        11 => grey(at(u / 9, v / 9) > 120),
        12 => grey((u.abs_diff(width / 2) < 20 && v.abs_diff(height / 2) < 15) != (at(u, v) < 20)),
        _ => {
            12 + (200 * usize::from(u.abs_diff(width / 2) * 2 + v.abs_diff(height / 2) < 20 + c)
                + at(u, v) as usize / 6)
                .min(243) as u8
        }
    };
    let left = picture(width, height, draws);
    let right = picture(width, height, |u, v| if u + shift < width { draws(u + shift, v) } else { 12 });
    [left, right]
}

fn answer(core: &mut Core, pair: &[Picture; 2], settings: &Settings) -> Result<Outcome, Finding> {
    core.run([&pair[0], &pair[1]], settings, "", &mut (), hangs_together)
}

#[test]
fn any_pair_gets_an_answer_and_always_the_same() {
    let (mut random, mut core) = (Random(20), Core::default());
    let mut models = [0; 2];
    for case in 0..1500 {
        let (pair, settings) = (pictures(&mut random), settings(&mut random));
        let first = answer(&mut core, &pair, &settings);
        assert!(!matches!(first, Err(Finding::Capacity(_))), "case {case}: {first:?}");
        models[usize::from(first.is_ok())] += 1;
        if case % 5 == 1 {
            // Dirty memory, of another size meanwhile, changes nothing.
            let _ = answer(&mut core, &pictures(&mut random), &settings);
            assert_eq!(answer(&mut core, &pair, &settings), first, "case {case}");
        }
    }
    assert!(models[0] > 200 && models[1] > 200, "both answers occur: {models:?}");
}

#[test]
fn pictures_of_no_size_or_of_two_sizes_are_refused() {
    let mut core = Core::default();
    for settings in [Settings::new(OPTICS), Settings::paper(OPTICS, PaperMatching::default())] {
        for (width, height) in [(0, 0), (0, 5), (5, 0), (1, 1), (1, 90), (90, 1)] {
            for value in [0, 255] {
                let blank = picture(width, height, |_, _| value);
                let found = answer(&mut core, &[blank.clone(), blank], &settings);
                assert!(matches!(found, Err(Finding::NoObject(_, 0))), "{width}x{height}: {found:?}");
            }
        }
        let pair = [picture(30, 20, |_, _| 9), picture(20, 30, |_, _| 9)];
        assert!(matches!(answer(&mut core, &pair, &settings), Err(Finding::SizesDiffer { .. })));
    }
}

#[test]
fn views_of_two_sizes_are_refused_step_by_step_too() {
    let mut storage = Storage::new(30, 30).unwrap();
    for settings in [Settings::new(OPTICS), Settings::paper(OPTICS, PaperMatching::default())] {
        let mut memory = storage.lend();
        let mut run = Run::new(&mut memory, &settings);
        let bytes: Vec<u8> = (0..600).map(|i| if (200..450).contains(&i) { 200 } else { 9 }).collect();
        for (side, width) in [(Side::Left, 30), (Side::Right, 20)] {
            let grey = Grey::new(Size::new(width, 600 / width).unwrap(), width, &bytes).unwrap();
            let eye = &mut memory.eyes[side as usize];
            run.outline(side, grey, eye, Arena::new(memory.scratch), &mut ()).unwrap();
        }
        assert!(matches!(run.pair(&mut memory, &mut ()), Err(Finding::SizesDiffer { .. })));
    }
}

/// A hand of five fingers with holes in the palm: every list gets more than a few entries.
fn hand(shift: usize) -> Picture {
    picture(150, 120, |u, v| {
        let u = u + shift;
        let finger = v > 12 && v < 70 && (30..120).contains(&u) && u % 18 < 9 + v / 40;
        let palm = (70..110).contains(&v) && (30..120).contains(&u);
        let hole = (84..96).contains(&v) && u % 20 < 10 && (40..110).contains(&u);
        if (finger || palm) && !hole { 210 } else { 12 }
    })
}

/// Counts the skeletons that it sees.
struct Onlooker {
    curious: bool,
    seen: usize,
}

impl Observer for Onlooker {
    fn saw(&mut self, _: Option<Side>, product: Product<'_>) {
        self.seen += usize::from(matches!(product, Product::Graph(..)));
    }

    fn wants_both_skeletons(&self) -> bool {
        self.curious
    }
}

/// The right eye's skeleton is of no use to the default method: neither that somebody looks at it, nor that it is
/// erased, nor that there is no room for it changes what comes out.
#[test]
fn looking_on_changes_nothing() {
    let mut core = Core::default();
    let square = |first: usize| {
        picture(150, 120, |u, v| {
            let inside = (first..first + 48).contains(&u) && (30..78).contains(&v);
            if inside { 210 } else { 12 }
        })
    };
    let erases = Settings { thinning: Rule::ZhangSuen, ..Settings::new(OPTICS) };
    for (pair, settings) in [([hand(0), hand(9)], Settings::new(OPTICS)), ([square(40), square(31)], erases)]
    {
        let made = [(false, true), (true, true), (true, false)].map(|(curious, room)| {
            let (mut none, mut onlooker) = (heapless::Vec::<_, 0>::new(), Onlooker { curious, seen: 0 });
            let [left, right] = pair.each_ref().map(|picture| picture.concat());
            let grey = |bytes| Grey::new(size(&pair[0]), 150, bytes).unwrap();
            let mut memory = core.lend(size(&pair[0]), "");
            if !room {
                memory.eyes[1].graph.nodes = &mut none;
            }
            let outcome = run(&mut memory, grey(&left), grey(&right), &settings, &mut onlooker).unwrap();
            (format!("{outcome:?}{:?}{:?}", memory.depths, memory.eyes[0].controls), onlooker.seen)
        });
        assert_eq!(made[0].0.contains("SkeletonErased(Left)"), settings == erases);
        assert!(made.iter().all(|(what, _)| *what == made[0].0));
        assert_eq!([made[0].1, made[1].1], [1, 2]);
    }
}

#[test]
fn memory_that_is_too_short_is_a_finding() {
    let mut core = Core::default();
    let pair = [hand(0), hand(9)];
    let modes = [Settings::new(OPTICS), Settings::paper(OPTICS, PaperMatching::default())];
    for (mode, settings) in modes.iter().enumerate() {
        assert!(answer(&mut core, &pair, settings).is_ok(), "{:?}", answer(&mut core, &pair, settings));
        for part in oracle::core::PARTS {
            let unused: &[&str] = match mode {
                0 => &["boundary pairs", "skeleton pairs"],
                _ => &["matches", "balls", "depths"],
            };
            let found = core.run([&pair[0], &pair[1]], settings, part, &mut (), hangs_together);
            let refused = matches!(found, Err(Finding::Capacity(_)));
            assert_eq!(refused, !unused.contains(&part), "mode {mode} without {part}: {found:?}");
        }
    }
    assert_eq!(size(&pair[0]).width, 150);
}
