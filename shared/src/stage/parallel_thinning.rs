//! Thinning by rules that delete many pixels at once, whole words of them.
//!
//! Paper: section 3.1, thin(A, B) = A - hit-or-miss(A, B); it names no structuring elements. Each rule is a
//! cycle of steps; a step deletes the pixels that it finds in the picture as the step before left it, and
//! cycles go on until one finds nothing.
//!
//! | rule | steps | source |
//! |---|---|---|
//! | [`Parallel::HitOrMiss`] | the paper's formula with L1, L2 of the Golay alphabet in four turns each | Golay 1969; Serra 1982 |
//! | [`Parallel::ZhangSuen`] | two; may erase a component, such as a 2x2 block | Zhang, Suen 1984 |
//! | [`Parallel::GuoHall`] | two | Guo, Hall 1989 |
//!
//! The object's box is cut into upright strips, each stored row after row, so that rows lie side by side in a
//! register however wide it is. A word has its strip's pixels and one of either neighbour, so that the
//! eight neighbours come from shifts alone, and a strip is thinned in place:
//!
//! ```text
//!   bit     0 | 1 2 3 ... 30 | 31             w >> 1: the eastern neighbours
//!   pixel   z | A B C ...  Y | Z              w << 1: the western ones
//!           of the strip before | after
//! ```
//!
//! Strips are looked at in blocks of rows. A step looks at a block only when something in it, or beside it,
//! was deleted since it looked at it last: elsewhere it would find the same as then, nothing.
//!
//! | | |
//! |---|---|
//! | in, out | a [`Bitmap`], changed in place; outside is clear |
//! | scratch | [`scratch_words`] words |
//! | cost | words of the outline x layers: some 40 operations a look for eight rows of a register's width |

use crate::arena::Arena;
use crate::bitmap::{Bitmap, SetBits, Size, WORD_BITS, Word, at};
use crate::lanes::Lanes;
use crate::limits::CapacityError;
use crate::pattern::GOLAY_L;

/// A rule of steps that delete in parallel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Parallel {
    /// Hit-or-miss with the Golay L alphabet: the paper's formula.
    HitOrMiss,
    /// Zhang and Suen 1984.
    ZhangSuen,
    /// Guo and Hall 1989.
    GuoHall,
}

/// What a thinning did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Report {
    /// Cycles through all patterns or sub-iterations, or sweeps over the list, with the last, idle one.
    pub cycles: u32,
    /// Pixels deleted.
    pub deleted: u32,
}

/// Thins by a rule with [`scratch_words`] words of scratch: [`thin`], or the same in wider registers.
pub type Thin = fn(&mut Bitmap<'_>, Parallel, Arena<'_>) -> Result<Report, CapacityError>;

/// Thin by a rule.
///
/// # Errors
/// A [`CapacityError`] when there is less scratch than [`scratch_words`].
pub fn thin(bitmap: &mut Bitmap<'_>, rule: Parallel, scratch: Arena<'_>) -> Result<Report, CapacityError> {
    thin_in_lanes::<Word>(bitmap, rule, scratch)
}

/// [`thin`] with so many words at once, at most eight: compiled for the registers of its caller.
///
/// # Errors
/// A [`CapacityError`] when there is less scratch than [`scratch_words`].
#[inline(always)]
pub fn thin_in_lanes<L: Lanes>(
    bitmap: &mut Bitmap<'_>,
    rule: Parallel,
    mut scratch: Arena<'_>,
) -> Result<Report, CapacityError> {
    let what = "words of scratch";
    let scratch = scratch.take(scratch_words(bitmap.size()), what)?;
    let limit = scratch.len();
    let Some(cut) = Cut::of(bitmap) else { return Ok(Report::default()) };
    let [mut now, mut next, due, found] = cut.parts(scratch).ok_or(CapacityError { what, limit })?;
    let before = bitmap.count();
    cut.read(bitmap, now);
    next.iter_mut().zip(&*now).for_each(|(to, from)| *to = *from);
    due.fill(cut.all_blocks());
    let mut cycles = 0;
    let mut busy = true;
    while busy {
        busy = false;
        for step in 0..rule.steps() {
            let due_now = due.get_mut(step * cut.count..(step + 1) * cut.count).unwrap_or_default();
            busy |= match (rule, step) {
                (Parallel::ZhangSuen, 0) => cut.sweep::<L, ZhangSuen<true>>(now, next, due_now, found),
                (Parallel::ZhangSuen, _) => cut.sweep::<L, ZhangSuen<false>>(now, next, due_now, found),
                (Parallel::GuoHall, 0) => cut.sweep::<L, GuoHall<true>>(now, next, due_now, found),
                (Parallel::GuoHall, _) => cut.sweep::<L, GuoHall<false>>(now, next, due_now, found),
                (Parallel::HitOrMiss, 0) => cut.sweep::<L, GolayL<0>>(now, next, due_now, found),
                (Parallel::HitOrMiss, 1) => cut.sweep::<L, GolayL<1>>(now, next, due_now, found),
                (Parallel::HitOrMiss, 2) => cut.sweep::<L, GolayL<2>>(now, next, due_now, found),
                (Parallel::HitOrMiss, 3) => cut.sweep::<L, GolayL<3>>(now, next, due_now, found),
                (Parallel::HitOrMiss, 4) => cut.sweep::<L, GolayL<4>>(now, next, due_now, found),
                (Parallel::HitOrMiss, 5) => cut.sweep::<L, GolayL<5>>(now, next, due_now, found),
                (Parallel::HitOrMiss, 6) => cut.sweep::<L, GolayL<6>>(now, next, due_now, found),
                (Parallel::HitOrMiss, _) => cut.sweep::<L, GolayL<7>>(now, next, due_now, found),
            };
            cut.spread(next, due, found, rule.steps());
            (now, next) = (next, now);
        }
        cycles += 1;
    }
    cut.write(now, bitmap);
    Ok(Report { cycles, deleted: (before - bitmap.count()) as u32 })
}

/// Steps of the longest rule.
const MAX_STEPS: usize = GOLAY_L.len();
/// Pixels of its own that a word of a strip has.
const PITCH: usize = WORD_BITS - 2;
/// Those pixels.
const OWN: Word = Word::MAX >> 2 << 1;
/// Rows that are handled without looking at the marks.
const GROUP: usize = WORD_BITS / 4;
/// Marks of a strip, one bit a block: where a step deleted anything, or in the row above or below; where it
/// deleted anything in the first column, and in the last one.
const MARKS: usize = 3;

/// Words of scratch that the parallel rules need.
pub const fn scratch_words(size: Size) -> usize {
    Cut::new(0, 0, size.width, size.height).words()
}

impl Parallel {
    const fn steps(self) -> usize {
        match self {
            Self::HitOrMiss => MAX_STEPS,
            Self::ZhangSuen | Self::GuoHall => 2,
        }
    }
}

/// How a box is cut into strips, and strips into blocks.
struct Cut {
    left: usize,
    top: usize,
    height: usize,
    /// Number of strips.
    count: usize,
    /// Blocks of a strip: at most as many as a word has bits.
    blocks: usize,
    /// Groups of rows of a block.
    groups: usize,
}

impl Cut {
    const fn new(left: usize, top: usize, width: usize, height: usize) -> Self {
        let groups = height.div_ceil(GROUP).div_ceil(WORD_BITS);
        // Where there is no row, there is no block, and any number of groups will do.
        let groups = if groups == 0 { 1 } else { groups };
        let blocks = height.div_ceil(groups * GROUP);
        Self { left, top, height, count: width.div_ceil(PITCH), blocks, groups }
    }

    /// The cut of the object's box; nothing of an empty bitmap.
    fn of(bitmap: &Bitmap<'_>) -> Option<Self> {
        let bounds = bitmap.bounds()?;
        let [left, top, right, bottom] =
            [bounds.min.u, bounds.min.v, bounds.max.u, bounds.max.v].map(usize::from);
        Some(Self::new(left, top, right + 1 - left, bottom + 1 - top))
    }

    /// Rows of a block.
    const fn block(&self) -> usize {
        self.groups * GROUP
    }

    /// Words of a strip: its blocks with a clear row above them and one below.
    const fn stride(&self) -> usize {
        1 + self.blocks * self.block() + 1
    }

    /// Words of all strips, the blocks due at each step, and the marks.
    const fn words(&self) -> usize {
        self.count * (2 * self.stride() + MAX_STEPS + MARKS)
    }

    /// The strips before and after a step, the blocks due at each step, and the marks.
    fn parts<'s>(&self, scratch: &'s mut [Word]) -> Option<[&'s mut [Word]; 4]> {
        let all = self.count * self.stride();
        let (now, rest) = scratch.get_mut(..self.words())?.split_at_mut_checked(all)?;
        let (next, marks) = rest.split_at_mut_checked(all)?;
        let (due, found) = marks.split_at_mut_checked(MAX_STEPS * self.count)?;
        Some([now, next, due, found])
    }

    /// Marks of all blocks of a strip.
    const fn all_blocks(&self) -> Word {
        Word::MAX >> (WORD_BITS - self.blocks)
    }

    /// Cut the bitmap.
    #[inline(always)]
    fn read(&self, bitmap: &Bitmap<'_>, rows: &mut [Word]) {
        rows.fill(0);
        for v in 0..self.height {
            let row = bitmap.row((self.top + v) as i32);
            // Left of the box all is clear.
            let mut before = 0;
            for (c, strip) in rows.chunks_exact_mut(self.stride()).enumerate() {
                let (i, bit) = self.place(c);
                let from = at(row, i) >> bit | at(row, i + 1) << 1 << (WORD_BITS - 1 - bit);
                if let Some(word) = strip.get_mut(1 + v) {
                    *word = from << 1 | before;
                }
                before = from >> (PITCH - 1) & 1;
            }
        }
    }

    /// Put the strips together again.
    #[inline(always)]
    fn write(&self, rows: &[Word], bitmap: &mut Bitmap<'_>) {
        for v in 0..self.height {
            let row = bitmap.row_mut((self.top + v) as i32);
            row.fill(0);
            for (c, strip) in rows.chunks_exact(self.stride()).enumerate() {
                let (i, bit) = self.place(c);
                let own = (at(strip, 1 + v) & OWN) >> 1;
                // Of most words nothing is left.
                if own == 0 {
                    continue;
                }
                if let Some(word) = row.get_mut(i) {
                    *word |= own << bit;
                }
                if let Some(next) = row.get_mut(i + 1) {
                    *next |= own >> 1 >> (WORD_BITS - 1 - bit);
                }
            }
        }
    }

    /// Word and bit of a strip's first pixel in a row of the bitmap.
    const fn place(&self, c: usize) -> (usize, usize) {
        let u = self.left + c * PITCH;
        (u / WORD_BITS, u % WORD_BITS)
    }

    /// Delete what a step finds in the blocks that are due, and mark where: whether there was anything.
    #[inline(always)]
    fn sweep<L: Lanes, S: Step>(
        &self,
        now: &[Word],
        next: &mut [Word],
        due: &mut [Word],
        found: &mut [Word],
    ) -> bool {
        let mut busy = 0;
        let strips = now.chunks_exact(self.stride()).zip(next.chunks_exact_mut(self.stride()));
        for (((now, next), due), found) in strips.zip(due).zip(found.as_chunks_mut::<MARKS>().0) {
            let mut marks = [0; MARKS];
            for block in SetBits(core::mem::take(due)) {
                let (from, rows) = (block * self.block(), self.block());
                let (Some(now), Some(next)) =
                    (now.get(from..from + rows + 2), next.get_mut(from + 1..from + 1 + rows))
                else {
                    continue;
                };
                let [first, here, last, west, east] = delete::<L, S>(now, next);
                marks[0] |= first << block >> 1 | here << block | last << block << 1;
                marks[1] |= west << block;
                marks[2] |= east << block;
            }
            *found = marks;
            busy |= marks[0];
        }
        busy != 0
    }

    /// After a step: the blocks at which later steps have to look, and the strips' copies of what was deleted
    /// beside them.
    #[inline(always)]
    fn spread(&self, rows: &mut [Word], due: &mut [Word], found: &[Word], steps: usize) {
        let all = self.all_blocks();
        for (c, &[near, west, east]) in found.as_chunks::<MARKS>().0.iter().enumerate() {
            if near == 0 {
                continue;
            }
            let beside = |marks: Word| (marks | marks >> 1 | marks << 1) & all;
            for due in due.chunks_exact_mut(self.count.max(1)).take(steps) {
                let mut look = |c: usize, blocks: Word| {
                    if let Some(due) = due.get_mut(c) {
                        *due |= blocks;
                    }
                };
                look(c, near & all);
                if west != 0 {
                    look(c.wrapping_sub(1), beside(west));
                }
                if east != 0 {
                    look(c + 1, beside(east));
                }
            }
            if west != 0
                && let Some((to, from)) = c.checked_sub(1).and_then(|c| self.strips(rows, c))
            {
                self.copy(from, west, to, |own| own << PITCH | !(1 << (WORD_BITS - 1)));
            }
            if east != 0
                && let Some((from, to)) = self.strips(rows, c)
            {
                self.copy(from, east, to, |own| own >> PITCH | !1);
            }
        }
    }

    /// A strip and the one after it, if there is one.
    #[inline(always)]
    fn strips<'r>(&self, rows: &'r mut [Word], c: usize) -> Option<(&'r mut [Word], &'r mut [Word])> {
        rows.get_mut(c * self.stride()..(c + 2) * self.stride())?.split_at_mut_checked(self.stride())
    }

    /// Clear in strip `to` what is clear in the marked blocks of strip `from`, of which `seen` makes a mask.
    #[inline(always)]
    fn copy(&self, from: &[Word], marks: Word, to: &mut [Word], seen: impl Fn(Word) -> Word) {
        for block in SetBits(marks) {
            let rows = 1 + block * self.block()..1 + (block + 1) * self.block();
            let to = to.get_mut(rows.clone()).unwrap_or_default();
            for (to, from) in to.iter_mut().zip(from.get(rows).unwrap_or_default()) {
                *to &= seen(*from);
            }
        }
    }
}

/// The rows `now` but the first and the last, without what a step finds there; and whether (0 or 1) it found
/// anything in the first row, anywhere, in the last row, in the first column and in the last one.
#[inline(always)]
fn delete<L: Lanes, S: Step>(now: &[Word], next: &mut [Word]) -> [Word; 5] {
    // As long as `next`, so that nobody has to look whether a row is there.
    let Some(below) = now.get(2..2 + next.len()) else { return [0; 5] };
    let mut three = [L::load(now, 0), L::load(now, 1), L::load(below, 0)];
    let first = delete_at::<L, S>(three, next, 0);
    let [mut all, mut last] = [first; 2];
    let mut v = L::WORDS;
    while v < next.len() {
        // Of single words, two have been loaded for the rows before.
        let [_, n, c] = three;
        let [n, c] = if L::WORDS == 1 { [n, c] } else { [L::load(now, v), L::load(now, v + 1)] };
        three = [n, c, L::load(below, v)];
        last = delete_at::<L, S>(three, next, v);
        all = all | last;
        v += L::WORDS;
    }
    let (first, last) = (first.with(Word::MAX) & 1, last.with(Word::MAX) >> (L::WORDS - 1));
    let [here, west, east] =
        [all.with(Word::MAX), all.with(1 << 1), all.with(1 << PITCH)].map(|with| with.min(1));
    [first, here, last, west, east]
}

/// [`delete`] in the rows of one register, between those above and below, from `v` of `next` on: what was found.
#[inline(always)]
fn delete_at<L: Lanes, S: Step>([n, c, s]: [L; 3], next: &mut [Word], v: usize) -> L {
    let found = c & L::splat(OWN) & S::finds([n, n >> 1, c >> 1, s >> 1, s, s << 1, c << 1, n << 1]);
    (c & !found).store(next, v);
    found
}

/// One step of a rule.
trait Step {
    /// Bit by bit: whether a set pixel with these neighbours, from north clockwise, is deleted.
    fn finds<L: Lanes>(around: [L; 8]) -> L;
}

/// A sub-iteration: one change from clear to set on the way around; two or more neighbours set and two or
/// more clear; and either the south or the east side open (of the second one, north or west).
///
/// With one change the set neighbours are one arc, and so are the clear ones. An arc of two or more has an
/// edge neighbour and a corner, so neither kind is all alike; and if all edge neighbours are set, no side is
/// open.
struct ZhangSuen<const FIRST: bool>;

impl<const FIRST: bool> Step for ZhangSuen<FIRST> {
    #[inline(always)]
    fn finds<L: Lanes>([n, ne, e, se, s, sw, w, nw]: [L; 8]) -> L {
        let change = one([turn(n, ne, e), turn(e, se, s), turn(s, sw, w), turn(w, nw, n)]);
        let corners = (ne ^ se) | (se ^ sw) | (sw ^ nw);
        let [either, both, sides] = if FIRST { [n | w, e, s] } else { [e | s, n, w] };
        change & corners & ((either ^ both) | (both ^ sides))
    }
}

/// A sub-iteration: one 8-connected neighbour group, 2 or 3 neighbours counted in pairs, and the side open.
struct GuoHall<const FIRST: bool>;

impl<const FIRST: bool> Step for GuoHall<FIRST> {
    #[inline(always)]
    fn finds<L: Lanes>([n, ne, e, se, s, sw, w, nw]: [L; 8]) -> L {
        let group = one([!n & (ne | e), !e & (se | s), !s & (sw | w), !w & (nw | n)]);
        let [two, all] = counted([nw | n, ne | e, se | s, sw | w]);
        let [two_shifted, all_shifted] = counted([n | ne, e | se, s | sw, w | nw]);
        let closed = if FIRST { (s | sw | !nw) & w } else { (n | ne | !se) & e };
        group & two & two_shifted & !(all & all_shifted) & !closed
    }
}

/// Pattern `K` of the Golay L alphabet.
struct GolayL<const K: usize>;

impl<const K: usize> Step for GolayL<K> {
    #[inline(always)]
    fn finds<L: Lanes>(around: [L; 8]) -> L {
        const { GOLAY_L[K] }.fits_words(around)
    }
}

/// Bit by bit: whether `b` or the corner `c` between `a` and `b` begins an arc of set neighbours.
#[inline(always)]
fn turn<L: Lanes>(a: L, c: L, b: L) -> L {
    c & !a | b & !c
}

/// Bit by bit: whether exactly one of four is set.
#[inline(always)]
fn one<L: Lanes>([a, b, c, d]: [L; 4]) -> L {
    (a ^ b ^ (c ^ d)) & !(a & b | c & d)
}

/// Bit by bit: whether at least two of four are set, and whether all are.
#[inline(always)]
fn counted<L: Lanes>([a, b, c, d]: [L; 4]) -> [L; 2] {
    let (left, right) = (a & b, c & d);
    [left | right | (a | b) & (c | d), left & right]
}
