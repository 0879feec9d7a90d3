//! The core's inner loops by the DSP instructions that Cortex-M4 and M7 share: four bytes of a word at once.
#![expect(unsafe_code, reason = "an instruction that the language has no name for")]

use core::arch::asm;
use shared::pipeline::Kernels;
use shared::stage::binarise::median_row_by_fours;

/// What every board lends beside its memory.
pub const KERNELS: Kernels = {
    let mut kernels = Kernels::PORTABLE;
    kernels.median_row = |above, here, below, out| median_row_by_fours([above, here, below], out, uqsub8);
    kernels
};

/// How much each byte of `a` exceeds that of `b`, or 0.
#[inline(always)]
fn uqsub8(a: u32, b: u32) -> u32 {
    let excess;
    // SAFETY: it computes one register from two, and changes nothing else, flags included.
    unsafe {
        asm!(
            "uqsub8 {}, {}, {}",
            out(reg) excess,
            in(reg) a,
            in(reg) b,
            options(pure, nomem, nostack, preserves_flags)
        );
    }
    excess
}
