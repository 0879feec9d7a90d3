//! The calibration: from the host's upload to tables, and to a record in flash and back.
//!
//! The record is the upload as a frame of its own, so that its check sum lies beside it. Tables are made when
//! a calibration comes, never per pair.

use shared::bitmap::Size;
use shared::camera::PairModel;
use shared::limits::CapacityError;
use shared::pipeline::Side;
use shared::stage::depth::Optics;
use shared::stage::warp::{Place, Warp};
use shared::wire::{Decoder, ErrorCode, ToDevice, calibration_crc};

/// What follows from a calibration.
#[derive(Clone, Copy, Debug)]
struct Known {
    crc: u32,
    optics: Optics,
    warped: bool,
}

/// The calibration in use, if there is one.
#[derive(Debug)]
pub(super) struct Calibration<'m> {
    size: Size,
    tables: [&'m mut [Place]; 2],
    known: Option<Known>,
}

impl<'m> Calibration<'m> {
    /// None, of pictures of a size; one will fill the tables.
    pub(super) const fn none(size: Size, tables: [&'m mut [Place]; 2]) -> Self {
        Self { size, tables, known: None }
    }

    /// Whether this device can use a calibration: one of its own pictures, which stand in both raw and
    /// rectified size.
    pub(super) fn check(&self, model: &PairModel) -> Result<(), ErrorCode> {
        let fits = model.check().is_ok() && model.size() == self.size;
        if fits { Ok(()) } else { Err(ErrorCode::OutOfRange) }
    }

    /// Use a calibration from now on; none if it is no good.
    pub(super) fn install(&mut self, model: &PairModel) -> Result<(), ErrorCode> {
        self.known = None;
        self.check(model)?;
        let mappings = model.mappings().map_err(|_| ErrorCode::OutOfRange)?;
        for (mapping, table) in mappings.iter().flatten().zip(&mut self.tables) {
            Warp::new(mapping, table).map_err(|_| ErrorCode::OutOfRange)?;
        }
        let optics = Optics::from(model);
        self.known = Some(Known { crc: calibration_crc(model), optics, warped: mappings.is_some() });
        Ok(())
    }

    /// Use none.
    pub(super) const fn forget(&mut self) {
        self.known = None;
    }

    /// The check sum of the calibration in use.
    pub(super) fn crc(&self) -> Option<u32> {
        self.known.map(|known| known.crc)
    }

    /// The rectified eyes.
    pub(super) fn optics(&self) -> Option<Optics> {
        self.known.map(|known| known.optics)
    }

    /// How an eye's raw picture becomes its rectified one; nothing where it is that, or nobody knows.
    pub(super) fn warp(&self, side: Side) -> Option<Warp<'_>> {
        self.known.filter(|known| known.warped)?;
        let [left, right] = &self.tables;
        let table = match side {
            Side::Left => left,
            Side::Right => right,
        };
        Warp::along(self.size, table).ok()
    }
}

/// Write the record of a calibration; its length.
pub(super) fn write_record(model: &PairModel, out: &mut [u8]) -> Result<usize, CapacityError> {
    ToDevice::Calibration(*model).encode(0, out)
}

/// Read a record back, with some memory to do so. Nothing if it is none.
pub(super) fn read_record(record: &[u8], memory: &mut [u8]) -> Option<PairModel> {
    let mut decoder = Decoder::new(memory);
    let command = record.iter().find_map(|&byte| ToDevice::decode(&decoder.push(byte)?).ok());
    match command {
        Some(ToDevice::Calibration(model)) => Some(model),
        _ => None,
    }
}
