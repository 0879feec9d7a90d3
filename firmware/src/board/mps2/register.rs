//! Registers of the emulated boards.
#![expect(unsafe_code, reason = "registers are reached by their addresses")]

/// A register of 32 bits.
#[derive(Clone, Copy, Debug)]
pub(super) struct Register(*mut u32);

impl Register {
    /// The register at an address of the board's documentation, or a word of memory that is nobody's; only such may
    /// be given here.
    pub(super) const fn at(address: usize) -> Self {
        Self(core::ptr::without_provenance_mut(address))
    }

    pub(super) fn read(self) -> u32 {
        // SAFETY: every address is that of a register or of memory that is nobody's: always there, aligned, without
        // effect on what Rust knows of.
        unsafe { self.0.read_volatile() }
    }

    pub(super) fn write(self, value: u32) {
        // SAFETY: as above.
        unsafe { self.0.write_volatile(value) }
    }
}
