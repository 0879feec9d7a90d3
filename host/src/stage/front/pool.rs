//! Lists that are lent for a while, so that another pair as large as one before needs no new memory.
//!
//! * **In**: how many values, or the values themselves. **Out**: a list that goes back when it is dropped.
//! * **Which**: the shortest that has room; if none has, the longest grows. So the same requests in the same order soon
//!   find room every time.
//! * **Cost**: a look at the lists that lie there, a few dozen.

use super::lattice::Stencil;
use super::stereo::Seen;
use nalgebra::Vector4;
use std::cell::RefCell;
use std::mem::take;
use std::ops::{Deref, DerefMut};

/// The memory of this stage, for one pair after the other.
#[derive(Debug, Default)]
pub struct Pool {
    pub(super) numbers: Shelf<f64>,
    pub(super) flags: Shelf<bool>,
    pub(super) places: Shelf<usize>,
    pub(super) faces: Shelf<u32>,
    pub(super) pixels: Shelf<[f64; 2]>,
    pub(super) images: Shelf<[f64; 3]>,
    pub(super) stencils: Shelf<Stencil>,
    pub(super) seen: Shelf<Seen>,
    pub(super) residuals: Shelf<Option<f64>>,
    pub(super) both: Shelf<(usize, [f64; 2])>,
    pub(super) samples: Shelf<(Vector4<f64>, f64)>,
}

impl Pool {
    /// Take back the confidence of a model that is done with.
    pub fn recycle(&mut self, confidence: Vec<f64>) {
        self.numbers.lists.get_mut().push(confidence);
    }
}

/// Lists of one type.
#[derive(Debug)]
pub(super) struct Shelf<T> {
    lists: RefCell<Vec<Vec<T>>>,
}

impl<T> Default for Shelf<T> {
    fn default() -> Self {
        Self { lists: RefCell::default() }
    }
}

impl<T: Clone> Shelf<T> {
    /// So many times the same value.
    pub(super) fn filled(&self, value: T, count: usize) -> Lent<'_, T> {
        let mut list = self.empty(count);
        list.resize(count, value);
        list
    }

    /// These values, of which there is a bound.
    pub(super) fn of(&self, values: impl Iterator<Item = T>) -> Lent<'_, T> {
        let (least, most) = values.size_hint();
        let mut list = self.empty(most.unwrap_or(least));
        list.extend(values);
        list
    }

    /// An empty list with room for so many values.
    pub(super) fn empty(&self, room: usize) -> Lent<'_, T> {
        let mut lists = self.lists.borrow_mut();
        let capacity = |k: &usize| lists[*k].capacity();
        let enough = (0..lists.len()).filter(|k| capacity(k) >= room).min_by_key(capacity);
        let best = enough.or_else(|| (0..lists.len()).max_by_key(capacity));
        let mut list = best.map_or_else(Vec::new, |k| lists.swap_remove(k));
        list.clear();
        list.reserve(room);
        Lent { list, shelf: self }
    }
}

/// A list on loan.
#[derive(Debug)]
pub(super) struct Lent<'p, T> {
    list: Vec<T>,
    shelf: &'p Shelf<T>,
}

impl<'p, T> Lent<'p, T> {
    /// Where more of them come from.
    pub(super) const fn shelf(&self) -> &'p Shelf<T> {
        self.shelf
    }

    /// The list, for good.
    pub(super) fn keep(mut self) -> Vec<T> {
        take(&mut self.list)
    }
}

impl<T> Deref for Lent<'_, T> {
    type Target = Vec<T>;

    fn deref(&self) -> &Vec<T> {
        &self.list
    }
}

impl<T> DerefMut for Lent<'_, T> {
    fn deref_mut(&mut self) -> &mut Vec<T> {
        &mut self.list
    }
}

impl<T> Drop for Lent<'_, T> {
    fn drop(&mut self) {
        if self.list.capacity() > 0 {
            self.shelf.lists.borrow_mut().push(take(&mut self.list));
        }
    }
}
