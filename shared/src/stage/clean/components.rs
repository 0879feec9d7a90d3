//! Connected components by the runs of each row.
//!
//! | | |
//! |---|---|
//! | in | a [`Bitmap`] |
//! | out | each component once, when the row after its last one has been read: its area and first pixel |
//! | scratch | two rows of runs; no labels |
//! | cost | linear in the words and the runs of the rows from the first set pixel to the last, but for the depth of the trees of a union-find within a row |
//!
//! What a component has gathered goes down with the first of its runs in each row, its leader. Runs of a row
//! start as components of their own; one that touches a run above takes over what that one's leader has, and
//! if another run of its row has done so before, the two are one. A leader that nobody took over from led the
//! last row of its component.

use super::Ground;
use crate::bitmap::{Bitmap, WORD_BITS, Word};
use crate::point::Pixel;
use bytemuck::{Pod, Zeroable};

/// A component that is complete.
#[derive(Clone, Copy)]
pub(super) struct Component {
    /// Number of its pixels.
    pub(super) area: u32,
    /// Its first pixel in raster order.
    pub(super) first: Pixel,
    /// Whether it has a pixel on the border of the image, or in the first or last row that has set pixels: clear
    /// ones are then no hole.
    pub(super) on_border: bool,
}

impl Component {
    /// Whether its first pixel comes before another's.
    pub(super) fn is_before(&self, other: &Self) -> bool {
        (self.first.v, self.first.u) < (other.first.v, other.first.u)
    }
}

/// Set pixels side by side, none beyond either end.
#[derive(Clone, Copy, Default, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Run {
    start: u16,
    /// One beyond the last pixel.
    end: u16,
    /// A run of the row that belongs to the same component and does not come later.
    parent: u16,
    /// Of a leader: the run of the row below that took over first, or [`NOBODY`].
    heir: u16,
    /// Of a leader: as of its [`Component`], and so are the next two.
    area: u32,
    first: Pixel,
    /// Not 0 on the border.
    on_border: u32,
}

const NOBODY: u16 = u16::MAX;

/// Runs in a row, at most.
pub(super) const fn runs(width: usize) -> usize {
    width.div_ceil(2)
}

/// Hand each component of the bitmap to `complete`, which may change it in the rows that the component has.
/// The lent rows have room for [`runs`].
pub(super) fn each_component(
    bitmap: &mut Bitmap<'_>,
    ground: Ground,
    [mut above, mut here]: [&mut [Run]; 2],
    mut complete: impl FnMut(&mut Bitmap<'_>, Component),
) {
    let n = bitmap.pitch();
    let first = bitmap.words().iter().position(|word| *word != 0);
    let last = bitmap.words().iter().rposition(|word| *word != 0);
    let (Some(top), Some(bottom)) = (first.map(|i| i / n), last.map(|i| i / n)) else { return };
    let mut count_above = 0;
    for v in top..=bottom + 1 {
        let whole = v == top || v == bottom;
        let count = if v <= bottom { find_runs(bitmap, (v, whole), ground, here) } else { 0 };
        let done = above.get_mut(..count_above).unwrap_or_default();
        join(done, here.get_mut(..count).unwrap_or_default(), ground);
        for (k, run) in done.iter().enumerate() {
            if usize::from(run.parent) == k && run.heir == NOBODY {
                let Run { area, first, on_border, .. } = *run;
                complete(bitmap, Component { area, first, on_border: on_border != 0 });
            }
        }
        (above, here, count_above) = (here, above, count);
    }
}

/// The runs of row `v`, each a component of its own, on the border if that is `whole`; returns how many.
fn find_runs(bitmap: &Bitmap<'_>, (v, whole): (usize, bool), ground: Ground, runs: &mut [Run]) -> usize {
    let width = bitmap.size().width;
    let (mut count, mut start) = (0, 0);
    let mut add = |start: usize, end: usize| {
        debug_assert!(count < runs.len());
        let Some(run) = runs.get_mut(count) else { return };
        *run = Run {
            start: start as u16,
            end: end as u16,
            parent: count as u16,
            heir: NOBODY,
            area: (end - start) as u32,
            first: Pixel { u: start as u16, v: v as u16 },
            on_border: u32::from(whole || start == 0 || end == width),
        };
        count += 1;
    };
    let mut within: Word = 0;
    for (i, &word) in bitmap.row(v as i32).iter().enumerate() {
        // A run starts at the first pixel that is there, and ends at the first after it that is not.
        let mut other = word ^ ground.mask() ^ within;
        while other != 0 {
            let bit = other.trailing_zeros();
            let u = i * WORD_BITS + bit as usize;
            if within == 0 {
                start = u;
            } else {
                add(start, u);
            }
            within = !within;
            other = !other & Word::MAX << bit;
        }
    }
    if within != 0 && start < width {
        add(start, width);
    }
    count
}

/// Let the runs of a row take over from those above that they touch.
fn join(above: &mut [Run], here: &mut [Run], ground: Ground) {
    // A corner reaches one pixel further than an edge.
    let reach = u16::from(ground == Ground::Object);
    let mut first = 0;
    for k in 0..here.len() {
        let Run { start, end, .. } = here[k];
        while first < above.len() && above[first].end + reach <= start {
            first += 1;
        }
        let mut i = first;
        while i < above.len() && above[i].start < end + reach {
            take_over(&mut above[..=i], &mut here[..=k]);
            // The next run may touch the last of these too.
            first = i;
            i += 1;
        }
    }
    // Parents come first, so theirs are leaders already.
    for k in 0..here.len() {
        if let Some(Run { parent, .. }) = here.get(usize::from(here[k].parent)) {
            here[k].parent = *parent;
        }
    }
}

/// Let the last run of `here` take over from the component of the last run of `above`.
fn take_over(above: &mut [Run], here: &mut [Run]) {
    let leader = above.last().map(|run| usize::from(run.parent));
    let Some(touched) = leader.and_then(|k| above.get_mut(k)) else { return };
    let parent = |here: &[Run], k: usize| here.get(k).map(|run| usize::from(run.parent));
    let root = |here: &[Run], mut k: usize| {
        while let Some(above) = parent(here, k).filter(|parent| *parent != k) {
            k = above;
        }
        k
    };
    let mine = root(here, here.len() - 1);
    let (kept, other) = if touched.heir == NOBODY {
        touched.heir = mine as u16;
        (mine, *touched)
    } else {
        let other = root(here, touched.heir.into());
        if other == mine {
            return;
        }
        let (kept, gone) = (mine.min(other), mine.max(other));
        let Some(gone) = here.get_mut(gone) else { return };
        gone.parent = kept as u16;
        (kept, *gone)
    };
    let Some(kept) = here.get_mut(kept) else { return };
    kept.area += other.area;
    kept.on_border |= other.on_border;
    if (other.first.v, other.first.u) < (kept.first.v, kept.first.u) {
        kept.first = other.first;
    }
}
