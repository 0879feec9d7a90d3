//! Scratch memory: one block, from which each stage takes what it needs and to which it all returns.
//!
//! Stages run one after the other, so what one of them needs in passing another can have after it. A block
//! of the size of the hungriest stage serves them all, which is what makes the core fit a microcontroller.
//!
//! * **In**: a block of 64-bit words, lent by the caller; its contents do not matter.
//! * **Out**: slices and lists of plain numbers, contents as they were left; what does not fit is a
//!   [`CapacityError`].
//! * **Cost**: none; an arena is two words.

use crate::limits::CapacityError;
use bytemuck::{Pod, cast_slice_mut, try_cast_slice_mut};
use core::mem::{replace, take};
use core::ops::{Deref, DerefMut};

/// The rest of a block.
#[derive(Debug)]
pub struct Arena<'a> {
    rest: &'a mut [u64],
}

/// Words of a block that `count` numbers of type `T` take.
pub const fn words<T>(count: usize) -> usize {
    (count * size_of::<T>()).div_ceil(size_of::<u64>())
}

impl<'a> Arena<'a> {
    /// All of a block.
    pub const fn new(block: &'a mut [u64]) -> Self {
        Self { rest: block }
    }

    /// The same memory for a while: what is taken from the fork is back when that is gone.
    pub const fn fork(&mut self) -> Arena<'_> {
        Arena { rest: self.rest }
    }

    /// Take `count` numbers, called `what` should they not fit.
    ///
    /// # Errors
    /// A [`CapacityError`] with the count that would fit.
    pub fn take<T: Pod>(&mut self, count: usize, what: &'static str) -> Result<&'a mut [T], CapacityError> {
        let limit = self.room::<T>();
        let (mine, rest) = take(&mut self.rest)
            .split_at_mut_checked(words::<T>(count.min(limit)))
            .ok_or(CapacityError { what, limit })?;
        self.rest = rest;
        numbers(mine).get_mut(..count).ok_or(CapacityError { what, limit })
    }

    /// Take all that is left as an empty list, whose entries are called `what` should there be too many.
    pub fn list<T: Pod>(self, what: &'static str) -> List<'a, T> {
        List::new(numbers(self.rest), what)
    }

    /// How many numbers of type `T` fit.
    const fn room<T>(&self) -> usize {
        match size_of_val(self.rest).checked_div(size_of::<T>()) {
            Some(room) => room,
            None => 0,
        }
    }
}

/// As many numbers of type `T` as the words hold; none of a type that is aligned to more than a word.
fn numbers<T: Pod>(words: &mut [u64]) -> &mut [T] {
    let bytes: &mut [u8] = cast_slice_mut(words);
    let whole = bytes.len() - bytes.len().checked_rem(size_of::<T>()).unwrap_or(0);
    bytes.get_mut(..whole).and_then(|bytes| try_cast_slice_mut(bytes).ok()).unwrap_or_default()
}

/// A list over lent memory.
#[derive(Debug)]
pub struct List<'a, T> {
    entries: &'a mut [T],
    len: usize,
    what: &'static str,
}

impl<'a, T: Copy> List<'a, T> {
    /// An empty list; its entries are called `what` should there be too many.
    pub const fn new(entries: &'a mut [T], what: &'static str) -> Self {
        Self { entries, len: 0, what }
    }

    /// Append an entry.
    ///
    /// # Errors
    /// A [`CapacityError`] when the list is full.
    pub fn push(&mut self, entry: T) -> Result<(), CapacityError> {
        let (what, limit) = (self.what, self.entries.len());
        *self.entries.get_mut(self.len).ok_or(CapacityError { what, limit })? = entry;
        self.len += 1;
        Ok(())
    }

    /// Forget all entries.
    pub const fn clear(&mut self) {
        self.len = 0;
    }

    /// Keep only the entries that pass, in order.
    pub fn retain(&mut self, pass: impl Fn(&T) -> bool) {
        let mut kept = 0;
        for i in 0..self.len {
            let Some(&entry) = self.entries.get(i).filter(|entry| pass(entry)) else { continue };
            if let Some(place) = self.entries.get_mut(kept) {
                *place = entry;
            }
            kept += 1;
        }
        self.len = kept;
    }

    /// Take an entry out, if it is there; the last one takes its place.
    pub fn swap_remove(&mut self, index: usize) -> Option<T> {
        let last = *self.last()?;
        let entry = replace(self.get_mut(index)?, last);
        self.len -= 1;
        Some(entry)
    }
}

impl<T> Deref for List<'_, T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        debug_assert!(self.len <= self.entries.len());
        self.entries.get(..self.len).unwrap_or_default()
    }
}

impl<T> DerefMut for List<'_, T> {
    fn deref_mut(&mut self) -> &mut [T] {
        debug_assert!(self.len <= self.entries.len());
        self.entries.get_mut(..self.len).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn takes_are_apart_and_come_back() {
        let mut block = [0; 4];
        let mut arena = Arena::new(&mut block);
        {
            let mut fork = arena.fork();
            let bytes: &mut [u8] = fork.take(9, "bytes").unwrap();
            bytes.fill(1);
            let halves: &mut [u16] = fork.take(8, "halves").unwrap();
            halves.fill(2);
            assert!(bytes.iter().all(|b| *b == 1));
            let full = CapacityError { what: "words", limit: 0 };
            assert_eq!(fork.take::<u32>(1, "words"), Err(full));
        }
        let limit = CapacityError { what: "triples", limit: 10 };
        assert_eq!(arena.fork().take::<[u8; 3]>(11, "triples"), Err(limit));
        assert_eq!(arena.take::<[u8; 3]>(10, "triples").map(|t| t.len()), Ok(10));
        assert_eq!(arena.take::<u64>(0, "nothing").map(|n| n.len()), Ok(0));
        assert!(arena.take::<u64>(usize::MAX, "too many").is_err());
    }

    #[test]
    fn a_list_ends_where_its_memory_does() {
        let mut block = [7; 2];
        let mut list = Arena::new(&mut block).list::<u32>("numbers");
        for k in 0..4 {
            list.push(k).unwrap();
        }
        assert_eq!(list.push(4), Err(CapacityError { what: "numbers", limit: 4 }));
        list.retain(|k| *k != 1);
        assert_eq!([list.swap_remove(3), list.swap_remove(0)], [None, Some(0)]);
        assert_eq!(*list, [3, 2]);
        list.clear();
        assert!(list.is_empty());
    }
}
