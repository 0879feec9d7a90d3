//! Thinning, bytes in and bytes out: packed, thinned and unpacked within the time that is taken.

use super::{Entry, Kernel, Scope, step};
use crate::images::{Image, pack, unpack};
use shared::arena::Arena;
use shared::bitmap::{Bitmap, Plane, Word};
use shared::pipeline::Kernels;
use shared::stage::distance::{Parabola, distance, scratch_parabolas};
use shared::stage::thinning::{Rule, scratch_order, thin};

/// A way to run the parallel rules: its name, and its functions where the machine has the instructions.
type Variant = (&'static str, fn() -> Option<Kernels>);

/// All of them.
const VARIANTS: [Variant; 1] = [("u64", || Some(Kernels::PORTABLE))];

pub(super) fn entries() -> Vec<Entry> {
    let mut entries = Vec::new();
    let rules =
        [("zhang_suen", Rule::ZhangSuen), ("guo_hall", Rule::GuoHall), ("hit_or_miss", Rule::HitOrMiss)];
    for (name, rule) in rules {
        for (variant, kernels) in VARIANTS {
            if let Some(kernels) = kernels() {
                let name = format!("{name}/{variant}");
                entries.push(Entry::new(&name, Scope::Kernel, move |image| by_layers(image, rule, &kernels)));
            }
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

fn by_layers(image: &Image, rule: Rule, _kernels: &Kernels) -> Box<dyn Kernel> {
    let (size, mask) = (image.size(), image.mask_bytes());
    step(
        Memory::of(image),
        move |memory| {
            pack(size, &mask, &mut memory.words);
            let mut bitmap = Bitmap::over(size, &mut memory.words).unwrap();
            let plane = Plane::over(size, &mut memory.plane).unwrap();
            thin(&mut bitmap, rule, &plane, Arena::new(&mut memory.scratch)).unwrap();
            unpack(size, &memory.words, &mut memory.out);
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
            pack(size, &mask, &mut memory.words);
            let mut bitmap = Bitmap::over(size, &mut memory.words).unwrap();
            let plane = distance(&bitmap, &mut memory.plane, &mut memory.parabolas).unwrap();
            thin(&mut bitmap, Rule::EdtOrdered, &plane, Arena::new(&mut memory.scratch)).unwrap();
            unpack(size, &memory.words, &mut memory.out);
        },
        |memory| memory.out.clone(),
    )
}
