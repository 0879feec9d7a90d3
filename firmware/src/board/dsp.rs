//! Kernels by the DSP instructions of the Cortex-M4 and M7, which take four bytes of a word at once.
#![expect(unsafe_code, reason = "instructions that the language has no name for")]

use core::arch::asm;
use shared::pipeline::Kernels;
use shared::stage::binarise::median_row_by_fours;

/// What the core's inner loops are on a board.
pub const KERNELS: Kernels = Kernels {
    median_row: |above, here, below, out| median_row_by_fours([above, here, below], out, uqsub8),
};

/// Byte by byte, how much `a` exceeds `b`, or 0.
#[inline(always)]
fn uqsub8(a: u32, b: u32) -> u32 {
    let excess;
    // SAFETY: changes nothing but the result, not even flags.
    unsafe {
        asm!("uqsub8 {}, {}, {}", out(reg) excess, in(reg) a, in(reg) b, options(pure, nomem, nostack, preserves_flags));
    }
    excess
}
