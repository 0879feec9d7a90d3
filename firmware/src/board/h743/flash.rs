//! The chip's flash, which caches and a lost supply make differ from what its driver takes it for.
#![expect(unsafe_code, reason = "faults are masked by instructions that the language has no name for")]

use core::arch::asm;
use cortex_m::asm::dsb;
use cortex_m::peripheral::SCB;
use embassy_stm32::flash::{self, Blocking};
use embassy_stm32::pac::FLASH;
use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashError as _, NorFlashErrorKind, ReadNorFlash};

/// Where flash lies in memory.
const BASE: usize = 0x0800_0000;
/// Of the two banks, that of the calibration.
const BANK: usize = 1;
/// Of the processor's configuration: data that a bus refuses are no fault while faults are masked.
const BFHFNMIGN: u32 = 1 << 8;
/// All flags of a bank but those that say what it is doing.
const FLAGS: u32 = 0x1FEF_0000;

/// The second bank of flash.
pub struct Flash {
    inner: flash::Flash<'static, Blocking>,
    scb: SCB,
}

impl Flash {
    /// The flash of this driver, and the processor's caches.
    pub(super) fn new(inner: flash::Flash<'static, Blocking>, scb: SCB) -> Self {
        // SAFETY: it changes what happens in `unfaulted` and in the handlers of faults, which do not come back.
        unsafe { scb.ccr.modify(|bits| bits | BFHFNMIGN) };
        Self { inner, scb }
    }

    /// Erase or write, past flags of earlier errors, which the driver would take for those of its own act and does
    /// not clear on this chip; then forget what the cache has of the place.
    fn change(
        &mut self,
        offset: u32,
        length: usize,
        act: impl FnOnce(&mut flash::Flash<'static, Blocking>) -> Result<(), flash::Error>,
    ) -> Result<(), NorFlashErrorKind> {
        forgive();
        let result = act(&mut self.inner);
        self.scb.clean_invalidate_dcache_by_address(BASE + offset as usize, length);
        result.map_err(|error| error.kind())
    }
}

fn forgive() {
    FLASH.bank(BANK).ccr().write(|clear| clear.0 = FLAGS);
}

/// Act with faults masked.
fn unfaulted<T>(act: impl FnOnce() -> T) -> T {
    // SAFETY: nothing but time lies between this and the end of the mask, and who acts does not depend on faults.
    unsafe { asm!("cpsid f", options(nostack, preserves_flags)) };
    let result = act();
    dsb();
    // SAFETY: faults were not masked before.
    unsafe { asm!("cpsie f", options(nostack, preserves_flags)) };
    result
}

impl ErrorType for Flash {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for Flash {
    const READ_SIZE: usize = flash::Flash::<'static, Blocking>::READ_SIZE;

    /// A word that was being written when power went is one that the chip's error correction may refuse to give: a
    /// fault, were it not masked here.
    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Self::Error> {
        forgive();
        let result = unfaulted(|| self.inner.blocking_read(offset, bytes));
        let refused = FLASH.bank(BANK).sr().read().dbeccerr();
        forgive();
        if refused { Err(NorFlashErrorKind::Other) } else { result.map_err(|error| error.kind()) }
    }

    fn capacity(&self) -> usize {
        self.inner.capacity()
    }
}

impl NorFlash for Flash {
    const WRITE_SIZE: usize = flash::Flash::<'static, Blocking>::WRITE_SIZE;
    const ERASE_SIZE: usize = flash::Flash::<'static, Blocking>::ERASE_SIZE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Self::Error> {
        self.change(from, (to - from) as usize, |flash| flash.blocking_erase(from, to))
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Self::Error> {
        self.change(offset, bytes.len(), |flash| flash.blocking_write(offset, bytes))
    }
}
