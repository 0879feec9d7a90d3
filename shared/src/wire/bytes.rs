//! Plain fields: integers in little-endian bytes, flags as 0 or 1.

use super::WireError;
use super::frame::Writer;

impl Writer<'_> {
    pub(super) fn u8(&mut self, x: u8) {
        self.put(&[x]);
    }

    pub(super) fn flag(&mut self, x: bool) {
        self.u8(u8::from(x));
    }

    pub(super) fn u16(&mut self, x: u16) {
        self.put(&x.to_le_bytes());
    }

    pub(super) fn u32(&mut self, x: u32) {
        self.put(&x.to_le_bytes());
    }

    pub(super) fn i32(&mut self, x: i32) {
        self.put(&x.to_le_bytes());
    }

    pub(super) fn u64(&mut self, x: u64) {
        self.put(&x.to_le_bytes());
    }
}

/// The fields of a payload, one after the other.
pub(super) struct Reader<'a> {
    rest: &'a [u8],
}

impl<'a> Reader<'a> {
    pub(super) const fn new(payload: &'a [u8]) -> Self {
        Self { rest: payload }
    }

    pub(super) fn take(&mut self, count: usize) -> Result<&'a [u8], WireError> {
        let (taken, rest) = self.rest.split_at_checked(count).ok_or(WireError::Short)?;
        self.rest = rest;
        Ok(taken)
    }

    pub(super) fn array<const N: usize>(&mut self) -> Result<[u8; N], WireError> {
        let (taken, rest) = self.rest.split_first_chunk().ok_or(WireError::Short)?;
        self.rest = rest;
        Ok(*taken)
    }

    pub(super) fn u8(&mut self) -> Result<u8, WireError> {
        Ok(u8::from_le_bytes(self.array()?))
    }

    /// A flag; `what` it says.
    pub(super) fn flag(&mut self, what: &'static str) -> Result<bool, WireError> {
        match self.u8()? {
            0 => Ok(false),
            1 => Ok(true),
            _ => Err(WireError::Invalid(what)),
        }
    }

    pub(super) fn u16(&mut self) -> Result<u16, WireError> {
        Ok(u16::from_le_bytes(self.array()?))
    }

    pub(super) fn u32(&mut self) -> Result<u32, WireError> {
        Ok(u32::from_le_bytes(self.array()?))
    }

    pub(super) fn i32(&mut self) -> Result<i32, WireError> {
        Ok(i32::from_le_bytes(self.array()?))
    }

    pub(super) fn u64(&mut self) -> Result<u64, WireError> {
        Ok(u64::from_le_bytes(self.array()?))
    }
}
