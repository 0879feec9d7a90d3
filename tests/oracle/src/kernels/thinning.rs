//! Thinning, bytes in and bytes out: packed, thinned and unpacked within the time that is taken.

use super::{Entry, Kernel, Scope, step};
use crate::images::Image;
use host::wide;
use shared::arena::Arena;
use shared::bitmap::{Bitmap, Size, Word};
use shared::limits::CapacityError;
use shared::pack::{pack, unpack};
use shared::stage::distance::{Parabola, distance, scratch_parabolas};
use shared::stage::parallel_thinning::{self, Parallel, Thin};
use shared::stage::sequential_thinning::{self, scratch_order};

/// From bytes to a bitmap.
type Pack = for<'w> fn(Size, &[u8], &'w mut [Word]) -> Result<Bitmap<'w>, CapacityError>;

/// The ways to run the parallel rules that this machine has, by their registers.
fn widths() -> impl Iterator<Item = (String, Pack, Thin)> {
    let wider = wide::widths().into_iter().filter_map(|(name, thin)| Some((name, wide::pack as Pack, thin?)));
    let named = |(name, pack, thin): (&str, Pack, Thin)| (name.to_lowercase().replace('-', ""), pack, thin);
    [("u64", pack as Pack, parallel_thinning::thin as Thin)].into_iter().chain(wider).map(named)
}

pub(super) fn entries() -> Vec<Entry> {
    let mut entries = Vec::new();
    let rules = [
        ("zhang_suen", Parallel::ZhangSuen),
        ("guo_hall", Parallel::GuoHall),
        ("hit_or_miss", Parallel::HitOrMiss),
    ];
    for (name, rule) in rules {
        for (width, pack, thin) in widths() {
            let name = format!("{name}/{width}");
            entries.push(Entry::new(&name, Scope::Kernel, move |image| by_layers(image, rule, (pack, thin))));
        }
    }
    entries.push(Entry::new("edt_ordered", Scope::Kernel, by_distance));
    entries
}

/// What passes by on the way.
struct Memory {
    words: Vec<Word>,
    plane: Vec<u16>,
    parabolas: Vec<Parabola>,
    scratch: Vec<u64>,
    out: Vec<u8>,
}

impl Memory {
    fn of(image: &Image) -> Self {
        let size = image.size();
        let order = scratch_order(size.pixels(), u16::MAX);
        Self {
            words: vec![0; size.words()],
            plane: vec![0; size.pixels()],
            parabolas: vec![Parabola::NONE; scratch_parabolas(size.width)],
            scratch: vec![0; order / 2 + 4 * size.words()],
            out: vec![0; size.pixels()],
        }
    }
}

fn by_layers(image: &Image, rule: Parallel, (pack, thin): (Pack, Thin)) -> Box<dyn Kernel> {
    let (size, mask) = (image.size(), image.mask_bytes());
    step(
        Memory::of(image),
        move |memory| {
            let mut bitmap = pack(size, &mask, &mut memory.words).unwrap();
            thin(&mut bitmap, rule, Arena::new(&mut memory.scratch)).unwrap();
            unpack(&bitmap, &mut memory.out).unwrap();
        },
        |memory| memory.out.clone(),
    )
}

/// From the mask by way of its distances.
fn by_distance(image: &Image) -> Box<dyn Kernel> {
    let (size, mask) = (image.size(), image.mask_bytes());
    step(
        Memory::of(image),
        move |memory| {
            let mut bitmap = pack(size, &mask, &mut memory.words).unwrap();
            let plane = distance(&bitmap, &mut memory.plane, &mut memory.parabolas).unwrap();
            sequential_thinning::thin(&mut bitmap, &plane, Arena::new(&mut memory.scratch)).unwrap();
            unpack(&bitmap, &mut memory.out).unwrap();
        },
        |memory| memory.out.clone(),
    )
}
