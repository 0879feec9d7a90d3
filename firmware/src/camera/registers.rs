//! What the sensor OV2640 is told: QVGA YUV422 from its whole array, nothing automatic.
//!
//! The sensor bank subsamples the array to SVGA, which halves the time between a frame's first and last row.
//! The DSP bank halves that and scales it to QVGA. Registers that are not listed keep what a reset gives
//! them; reserved ones are never written.

use crate::ports::Exposure;

/// Columns of a picture, px.
pub const WIDTH: usize = 320;
/// Rows of a picture, px.
pub const HEIGHT: usize = 240;

/// COM7: the resolution, SVGA.
pub const RESOLUTION: u8 = 0x40;
/// Columns and rows that the sensor hands to the DSP at that resolution.
const ARRAY: (u16, u16) = (800, 600);
/// First column and row of the image at that resolution, each counting as two.
const FIRST: (u16, u16) = (137, 2);
/// How often the DSP halves that before it scales it to the picture.
const HALVINGS: u8 = (ARRAY.0 / WIDTH as u16).ilog2() as u8;

/// Chooses what the addresses mean, in either bank.
pub const BANK: u8 = 0xFF;

/// What the addresses mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Bank {
    /// Processing and output.
    Dsp = 0,
    /// Array, timing, exposure.
    Sensor = 1,
}

// Sensor bank.
/// Gain: a doubling for each bit of 7:4, times 1 + bits 3:0 / 16.
const GAIN: u8 = 0x00;
/// Bits 3:2 and 1:0: low bits of the last and the first row.
const COM1: u8 = 0x03;
/// Bits 7 and 6 mirror and flip; bits 1:0 are exposure 1:0. Bit 5 is set by a reset.
const REG04: u8 = 0x04;
/// Product number, high byte.
pub const PRODUCT_HIGH: u8 = 0x0A;
/// Product number, low byte.
pub const PRODUCT_LOW: u8 = 0x0B;
/// Exposure 9:2, lines.
const AEC: u8 = 0x10;
/// Bit 7 resets everything, bits 6:4 choose the resolution (4: SVGA), bit 1 shows colour bars.
pub const COM7: u8 = 0x12;
/// Bit 5: banding filter, bit 2: automatic gain, bit 0: automatic exposure.
const COM8: u8 = 0x13;
const FIRST_COLUMN: u8 = 0x17;
const LAST_COLUMN: u8 = 0x18;
const FIRST_ROW: u8 = 0x19;
const LAST_ROW: u8 = 0x1A;
/// Bits 5:3 and 2:0: low bits of the last and the first column; bits 7:6 divide the pixel clock.
const COLUMN_LOW: u8 = 0x32;
/// Bits 7:6: gain 9:8; bits 5:0: exposure 15:10.
const EXPOSURE_HIGH: u8 = 0x45;

/// COM7: reset.
pub const RESET: u8 = 0x80;
/// COM7: colour bars.
pub const BARS: u8 = 0x02;

// DSP bank.
/// Bit 0: the DSP is passed by, so that half a change is never seen.
const BYPASS: u8 = 0x05;
/// Bit 7 averages while dividing; bits 5:3 and 2:0: rows and columns are divided by that power of two.
const DIVIDE: u8 = 0x50;
const WINDOW_WIDTH: u8 = 0x51;
const WINDOW_HEIGHT: u8 = 0x52;
const OFFSET_X: u8 = 0x53;
const OFFSET_Y: u8 = 0x54;
/// Bits 7 and 3: bit 8 of the window's height and width / 4; the others are of its offset.
const WINDOW_HIGH: u8 = 0x55;
/// Bit 7: bit 9 of the window's width / 4.
const WINDOW_HIGHER: u8 = 0x57;
/// Columns of the output / 4.
const OUTPUT_WIDTH: u8 = 0x5A;
/// Rows of the output / 4.
const OUTPUT_HEIGHT: u8 = 0x5B;
const OUTPUT_HIGH: u8 = 0x5C;
/// Bit 5 scales, bit 3 adjusts and bit 2 averages chroma, bit 0 is the colour matrix; 4 is special effects.
const MODULES2: u8 = 0x86;
const ARRAY_LOW: u8 = 0x8C;
const ARRAY_WIDTH: u8 = 0xC0;
const ARRAY_HEIGHT: u8 = 0xC1;
/// Bit 4: V before U, bit 3: YUV422, bit 2: YUV.
const MODULES0: u8 = 0xC2;
/// Bits 3 and 2: white balance and its gains; the others correct pixels, gamma and lens.
const MODULES1: u8 = 0xC3;
/// Bit 7: the pixel clock follows the output size; bits 6:0 divide it, and may then be the chip's own.
pub const PIXEL_CLOCK: u8 = 0xD3;
/// Bit 6: Y8, bit 4: JPEG, bits 3:2: YUV422, raw or RGB565, bit 0: bytes swapped to UYVY.
const IMAGE_MODE: u8 = 0xDA;
/// Bit 2 holds the output in reset.
const DSP_RESET: u8 = 0xE0;

/// One register and its value.
pub type Write = (u8, u8);

const fn high(value: u16, shift: u16) -> u8 {
    (value >> shift) as u8
}

const LAST: (u16, u16) = (FIRST.0 + ARRAY.0 / 2, FIRST.1 + ARRAY.1 / 2);

/// The table, by bank, in the order of writing.
pub const TABLE: &[(Bank, &[Write])] = &[
    (
        Bank::Sensor,
        &[
            (COM7, RESOLUTION),
            // A window of the whole array: its bounds are other than those of the full size, which a reset gives.
            (FIRST_COLUMN, high(FIRST.0, 3)),
            (LAST_COLUMN, high(LAST.0, 3)),
            (COLUMN_LOW, ((LAST.0 & 7) << 3 | FIRST.0 & 7) as u8),
            (FIRST_ROW, high(FIRST.1, 2)),
            (LAST_ROW, high(LAST.1, 2)),
            (COM1, ((LAST.1 & 3) << 2 | FIRST.1 & 3) as u8),
            // No banding filter, gain and exposure as they are told; bits 7:6 as a reset gives them.
            (COM8, 0xC0),
        ],
    ),
    (
        Bank::Dsp,
        &[
            (BYPASS, 1),
            (DSP_RESET, 0x04),
            (ARRAY_WIDTH, high(ARRAY.0, 3)),
            (ARRAY_HEIGHT, high(ARRAY.1, 3)),
            (ARRAY_LOW, ((ARRAY.0 & 7) << 3 | ARRAY.1 & 7) as u8),
            (MODULES2, 0x2D),
            (DIVIDE, 0x80 | HALVINGS << 3 | HALVINGS),
            (WINDOW_WIDTH, high(ARRAY.0, 2)),
            (WINDOW_HEIGHT, high(ARRAY.1, 2)),
            (OFFSET_X, 0),
            (OFFSET_Y, 0),
            (WINDOW_HIGH, (high(ARRAY.1, 10) & 1) << 7 | (high(ARRAY.0, 10) & 1) << 3),
            (WINDOW_HIGHER, (high(ARRAY.0, 11) & 1) << 7),
            (OUTPUT_WIDTH, high(WIDTH as u16, 2)),
            (OUTPUT_HEIGHT, high(HEIGHT as u16, 2)),
            (OUTPUT_HIGH, 0),
            (MODULES0, 0x0C),
            // No white balance: it changes luma from frame to frame, and differently in each eye.
            (MODULES1, 0xF3),
            (IMAGE_MODE, 0x00),
            (PIXEL_CLOCK, 0x84),
            (DSP_RESET, 0x00),
            (BYPASS, 0),
        ],
    ),
];

/// The registers of an exposure.
pub const fn exposure(exposure: Exposure) -> [Write; 4] {
    let (lines, mut gain, mut doublings) = (exposure.lines(), exposure.gain(), 0);
    while gain >= 32 {
        gain >>= 1;
        doublings = doublings << 1 | 0x10;
    }
    [
        (EXPOSURE_HIGH, (lines >> 10) as u8 & 0x3F),
        (AEC, high(lines, 2)),
        (REG04, 0x20 | lines as u8 & 3),
        (GAIN, doublings | (gain & 0x0F) as u8),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_gain_is_met_from_below_within_a_sixteenth() {
        for gain in Exposure::GAIN {
            let value = exposure(Exposure::new(1, gain)).into_iter().find(|w| w.0 == GAIN).unwrap().1;
            let met = (16 + u32::from(value & 15)) << (value >> 4).count_ones();
            let gain = u32::from(gain);
            assert!(met <= gain && gain - met <= gain / 16, "{gain} is met as {met}");
        }
    }
}
