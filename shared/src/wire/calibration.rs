//! The calibration: a [`PairModel`] as it is, to the bit.
//!
//! ```text
//! width u16 | height u16 | focal | columns 2 | row | baseline | to left 3 x 3 | eyes: 0 or 1
//! each eye: focal 2 | skew | centre 2 | lens: 0, 12 coefficients, or 1, 4 coefficients | turn 3 x 3
//! ```
//!
//! Numbers are IEEE doubles; what [`PairModel::check`] refuses is not read.

use super::WireError;
use super::bytes::Reader;
use super::frame::{CRC, Writer};
use crate::camera::{EyeModel, Lens, PairModel};

/// Hand the bytes of a calibration to `put`, piece by piece.
fn each_piece(model: &PairModel, mut put: impl FnMut(&[u8])) {
    put(&model.width.to_le_bytes());
    put(&model.height.to_le_bytes());
    let mut numbers = |numbers: &[f64]| numbers.iter().for_each(|x| put(&x.to_le_bytes()));
    numbers(&[model.focal]);
    numbers(&model.columns);
    numbers(&[model.row, model.baseline]);
    numbers(model.to_left.as_flattened());
    put(&[u8::from(model.eyes.is_some())]);
    for eye in model.eyes.iter().flatten() {
        let mut numbers = |numbers: &[f64]| numbers.iter().for_each(|x| put(&x.to_le_bytes()));
        numbers(&eye.focal);
        numbers(&[eye.skew]);
        numbers(&eye.centre);
        let (code, coefficients) = match &eye.lens {
            Lens::Polynomial(k) => (0, k.as_slice()),
            Lens::Equidistant(k) => (1, k.as_slice()),
        };
        put(&[code]);
        let mut numbers = |numbers: &[f64]| numbers.iter().for_each(|x| put(&x.to_le_bytes()));
        numbers(coefficients);
        numbers(eye.turn.as_flattened());
    }
}

/// The CRC-32 of a calibration's bytes: by it both ends know whether they mean the same.
pub fn calibration_crc(model: &PairModel) -> u32 {
    let mut digest = CRC.digest();
    each_piece(model, |piece| digest.update(piece));
    digest.finalize()
}

pub(super) fn write_calibration(model: &PairModel, writer: &mut Writer<'_>) {
    each_piece(model, |piece| writer.put(piece));
}

pub(super) fn read_calibration(reader: &mut Reader<'_>) -> Result<PairModel, WireError> {
    let (width, height) = (reader.u16()?, reader.u16()?);
    let [focal] = numbers(reader)?;
    let columns = numbers(reader)?;
    let [row, baseline] = numbers(reader)?;
    let to_left = turn(reader)?;
    let eyes = if reader.flag("calibration")? { Some([eye(reader)?, eye(reader)?]) } else { None };
    let model = PairModel { width, height, focal, columns, row, baseline, to_left, eyes };
    model.check().map_err(WireError::Calibration)?;
    Ok(model)
}

fn eye(reader: &mut Reader<'_>) -> Result<EyeModel, WireError> {
    let focal = numbers(reader)?;
    let [skew] = numbers(reader)?;
    let centre = numbers(reader)?;
    let lens = match reader.u8()? {
        0 => Lens::Polynomial(numbers(reader)?),
        1 => Lens::Equidistant(numbers(reader)?),
        code => return Err(WireError::Unknown { what: "lens", code }),
    };
    Ok(EyeModel { focal, skew, centre, lens, turn: turn(reader)? })
}

fn turn(reader: &mut Reader<'_>) -> Result<[[f64; 3]; 3], WireError> {
    Ok([numbers(reader)?, numbers(reader)?, numbers(reader)?])
}

fn numbers<const N: usize>(reader: &mut Reader<'_>) -> Result<[f64; N], WireError> {
    let mut numbers = [0.0; N];
    for x in &mut numbers {
        *x = f64::from_le_bytes(reader.array()?);
    }
    Ok(numbers)
}
