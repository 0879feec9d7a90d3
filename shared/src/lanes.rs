//! Words side by side, on which a bitwise operation works at once: one word, or a register of the machine.
//!
//! **In, out**: [`Lanes::WORDS`] words that lie one after the other. **Cost**: one instruction an operation.
//! Code that is generic over it must be inlined into whoever says which lanes to take, so that it is compiled
//! for the registers of that caller. So closures take no lanes: nothing makes sure that they are inlined, and one that
//! was not made thinning in wide registers two times slower.

use crate::bitmap::{self, Word};
use core::ops::{BitAnd, BitOr, BitXor, Not, Shl, Shr};

/// Words side by side. Shifts are of each word by itself.
pub trait Lanes:
    Copy
    + BitAnd<Output = Self>
    + BitOr<Output = Self>
    + BitXor<Output = Self>
    + Not<Output = Self>
    + Shl<u32, Output = Self>
    + Shr<u32, Output = Self>
{
    /// How many words.
    const WORDS: usize;

    /// The same word everywhere.
    fn splat(word: Word) -> Self;

    /// The words from `at` on.
    ///
    /// # Panics
    /// For registers wider than a word, when there are fewer than [`Self::WORDS`].
    fn load(words: &[Word], at: usize) -> Self;

    /// Write the words from `at` on.
    ///
    /// # Panics
    /// For registers wider than a word, when there are fewer than [`Self::WORDS`].
    fn store(self, words: &mut [Word], at: usize);

    /// Bit `k` for each word `k` that has one of these bits.
    fn with(self, bits: Word) -> Word;
}

/// What every machine has. It panics nowhere: a word that is not there is 0.
impl Lanes for Word {
    const WORDS: usize = 1;

    #[inline(always)]
    fn splat(word: Word) -> Self {
        word
    }

    #[inline(always)]
    fn load(words: &[Word], at: usize) -> Self {
        bitmap::at(words, at)
    }

    #[inline(always)]
    fn store(self, words: &mut [Word], at: usize) {
        if let Some(word) = words.get_mut(at) {
            *word = self;
        }
    }

    #[inline(always)]
    fn with(self, bits: Word) -> Word {
        Word::from(self & bits != 0)
    }
}
