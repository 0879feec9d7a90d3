//! The sensor OV2640: what its registers, after a reset and whatever was written, make of a scene.

use super::{SIZE, Scene, Time};
use std::collections::{BTreeMap, BTreeSet};

const MS: u64 = 1_000_000;
const DSP: u8 = 0;
const SENSOR: u8 = 1;

/// Registers that exist, by bank, with what a reset gives them.
const DSP_REGISTERS: &[(u8, u8)] = &[
    (0x05, 0x01),
    (0x44, 0x0C),
    (0x50, 0x00),
    (0x51, 0x40),
    (0x52, 0xF0),
    (0x53, 0x00),
    (0x54, 0x00),
    (0x55, 0x08),
    (0x56, 0x00),
    (0x57, 0x00),
    (0x5A, 0x58),
    (0x5B, 0x48),
    (0x5C, 0x00),
    (0x7C, 0x00),
    (0x7D, 0x00),
    (0x86, 0x0D),
    (0x87, 0x50),
    (0x8C, 0x00),
    (0xC0, 0x80),
    (0xC1, 0x60),
    (0xC2, 0x0C),
    (0xC3, 0xFF),
    (0xD3, 0x82),
    (0xDA, 0x00),
    (0xE0, 0x04),
];
const SENSOR_REGISTERS: &[(u8, u8)] = &[
    (0x00, 0x00),
    (0x03, 0x0F),
    (0x04, 0x20),
    (0x08, 0x40),
    (0x09, 0x00),
    (0x0C, 0x38),
    (0x0D, 0x07),
    (0x10, 0x33),
    (0x11, 0x00),
    (0x12, 0x00),
    (0x13, 0xC7),
    (0x14, 0x50),
    (0x15, 0x00),
    (0x17, 0x11),
    (0x18, 0x75),
    (0x19, 0x01),
    (0x1A, 0x97),
    (0x24, 0x78),
    (0x25, 0x68),
    (0x26, 0xD4),
    (0x2A, 0x00),
    (0x2B, 0x00),
    (0x2D, 0x00),
    (0x2E, 0x00),
    (0x32, 0x36),
    (0x45, 0x00),
    (0x46, 0x00),
    (0x47, 0x00),
    (0x48, 0x00),
    (0x49, 0x00),
    (0x4B, 0x20),
    (0x4E, 0x00),
    (0x4F, 0xCA),
    (0x50, 0xA8),
];
/// Sizes and formats of the DSP: to be changed only while it is passed by.
const SHAPING: &[u8] =
    &[0x50, 0x51, 0x52, 0x53, 0x54, 0x55, 0x57, 0x5A, 0x5B, 0x5C, 0x86, 0x8C, 0xC0, 0xC1, 0xC2, 0xC3, 0xDA];

/// Y, U, V of the colour bars: white, yellow, cyan, green, magenta, red, blue, black.
const BARS: [[u8; 3]; 8] = [
    [255, 128, 128],
    [226, 1, 149],
    [179, 171, 1],
    [150, 44, 21],
    [105, 212, 235],
    [76, 85, 255],
    [29, 255, 107],
    [0, 128, 128],
];

/// A sensor and what is wrong with it.
#[derive(Debug)]
pub struct Sensor {
    /// What it sees.
    pub scene: Scene,
    /// Its product number.
    pub product: u16,
    /// Whether it answers to nothing.
    pub deaf: bool,
    /// How often its wires must be freed until it lets go of them.
    pub holds: u32,
    /// A bank and an address whose writes are lost.
    pub forgets: Option<(u8, u8)>,
    /// Banks and addresses that were written.
    pub written: BTreeSet<(u8, u8)>,

    time: Time,
    /// Time of a first frame, ns.
    phase: u64,
    registers: [BTreeMap<u8, u8>; 2],
    bank: u8,
    address: Option<u8>,
    /// Time of the reset, ns.
    reset: Option<u64>,
    /// Time of the last change, ns.
    changed: u64,
    frames: u64,
}

/// What a frame is made of.
#[derive(Debug)]
struct Format {
    width: usize,
    height: usize,
    /// Columns and rows of the array that the frame covers, first and count, of all columns and rows.
    columns: [usize; 3],
    rows: [usize; 3],
}

impl Sensor {
    pub(super) fn new(time: Time, scene: Scene, phase: u64) -> Self {
        assert_eq!(scene.len(), SIZE.0 * SIZE.1, "a scene has as many pixels as a picture");
        let mut sensor = Self {
            scene,
            product: 0x2642,
            deaf: false,
            holds: 0,
            forgets: None,
            written: BTreeSet::new(),
            time,
            phase,
            registers: Default::default(),
            bank: DSP,
            address: None,
            reset: None,
            changed: 0,
            frames: 0,
        };
        sensor.lose_power();
        sensor
    }

    /// Power comes back: registers as after a reset, but whoever writes a table has to reset first.
    pub(super) fn lose_power(&mut self) {
        self.registers = [DSP_REGISTERS, SENSOR_REGISTERS].map(|list| list.iter().copied().collect());
        (self.bank, self.address, self.reset) = (DSP, None, None);
        self.changed = self.time.now();
    }

    /// Time of a frame, ns: 30 a second in SVGA, 15 otherwise.
    pub(super) fn period(&self) -> u64 {
        if self.sensor(0x12) & 0x70 == 0x40 { 33_320_000 } else { 66_640_000 }
    }

    /// When the next frame begins, ns.
    pub(super) fn next_frame(&self) -> u64 {
        if self.dsp(0xE0) != 0 && self.dsp(0x05) & 1 == 0 {
            // Held in reset, the output sends none.
            return u64::MAX;
        }
        let since = self.time.now().saturating_sub(self.phase);
        self.phase + since.div_ceil(self.period()) * self.period()
    }

    fn sensor(&self, address: u8) -> u8 {
        self.registers[usize::from(SENSOR)][&address]
    }

    fn dsp(&self, address: u8) -> u8 {
        self.registers[usize::from(DSP)][&address]
    }

    fn wake(&self) {
        let awake = self.reset.is_none_or(|since| self.time.now() >= since + 100 * MS);
        assert!(awake, "the sensor is still being reset");
    }

    /// Bytes of a write: an address to be read next, or an address and its value.
    pub(super) fn write(&mut self, bytes: &[u8]) {
        self.wake();
        match *bytes {
            [address] => self.address = Some(address),
            [0xFF, bank] => {
                assert!(bank <= 1, "bank {bank} does not exist");
                self.bank = bank;
            }
            [address, value] => self.set(address, value),
            _ => panic!("SCCB writes an address and one byte"),
        }
    }

    fn set(&mut self, address: u8, value: u8) {
        let bank = self.bank;
        if (bank, address) == (SENSOR, 0x12) && value & 0x80 != 0 {
            assert!(value == 0x80, "a reset and {value:#04x} at once");
            self.lose_power();
            self.reset = Some(self.time.now());
            return;
        }
        assert!(self.reset.is_some(), "register {address:#04x} of bank {bank} is written without a reset");
        let passed_by = self.dsp(0x05) & 1 == 1;
        let shaping = bank == DSP && SHAPING.contains(&address);
        assert!(!shaping || passed_by, "register {address:#04x} is written while the DSP is in use");
        let Some(register) = self.registers[usize::from(bank)].get_mut(&address) else {
            panic!("register {address:#04x} of bank {bank} does not exist, or is read only");
        };
        self.written.insert((bank, address));
        if self.forgets != Some((bank, address)) {
            *register = value;
        }
        self.changed = self.time.now();
    }

    /// The register whose address was written last.
    pub(super) fn read(&mut self) -> u8 {
        self.wake();
        let address = self.address.take().expect("a read without its address");
        let [high, low] = self.product.to_be_bytes();
        match (self.bank, address) {
            (_, 0xFF) => self.bank,
            (SENSOR, 0x0A) => high,
            (SENSOR, 0x0B) => low,
            (SENSOR, 0x1C) => 0x7F,
            (SENSOR, 0x1D) => 0xA2,
            (bank, address) => *self.registers[usize::from(bank)]
                .get(&address)
                .unwrap_or_else(|| panic!("register {address:#04x} of bank {bank} does not exist")),
        }
    }

    /// What the registers describe, if that is YUV422 of an image that hangs together; otherwise how many
    /// bytes come.
    fn format(&self) -> Result<Format, usize> {
        let (s, d) = (|a| usize::from(self.sensor(a)), |a| usize::from(self.dsp(a)));
        // Where the array begins, counted in twos, and what it has, by resolution.
        let (origin, array) = match s(0x12) >> 4 & 7 {
            0 => ([142, 7], [1600, 1200]),
            4 => ([137, 2], [800, 600]),
            _ => return Err(400 * 296 * 2),
        };
        let first = [s(0x17) << 3 | s(0x32) & 7, s(0x19) << 2 | s(0x03) & 3];
        let last = [s(0x18) << 3 | s(0x32) >> 3 & 7, s(0x1A) << 2 | s(0x03) >> 2 & 3];
        let sent = [0, 1].map(|i| 2 * last[i].saturating_sub(first[i]));
        let inside = (0..2).all(|i| first[i] >= origin[i] && 2 * (last[i] - origin[i]) <= array[i]);
        if !inside || d(0x05) & 1 == 1 {
            return Err(sent[0] * sent[1]);
        }
        let low = d(0x8C);
        let taken = [(low >> 6 & 1) << 11 | d(0xC0) << 3 | low >> 3 & 7, d(0xC1) << 3 | low & 7];
        let (more, most) = (d(0x55), d(0x57));
        let window =
            [4 * ((most >> 7) << 9 | (more >> 3 & 1) << 8 | d(0x51)), 4 * ((more >> 7) << 8 | d(0x52))];
        let offset = [(more & 7) << 8 | d(0x53), (more >> 4 & 7) << 8 | d(0x54)];
        let divided = [window[0] >> (d(0x50) & 7), window[1] >> (d(0x50) >> 3 & 7)];
        let out = [4 * ((d(0x5C) & 3) << 8 | d(0x5A)), 4 * ((d(0x5C) >> 2 & 1) << 8 | d(0x5B))];
        let hangs_together = sent == taken
            && (0..2).all(|i| offset[i] + window[i] <= taken[i] && (1..=divided[i]).contains(&out[i]))
            && (out == divided || d(0x86) & 0x20 != 0);
        let is_yuv = d(0xDA) == 0 && d(0xC2) & 0x1F == 0x0C;
        let bytes = if d(0xDA) & 0x40 != 0 { 1 } else { 2 } * out[0] * out[1];
        if !hangs_together || !is_yuv {
            return Err(bytes);
        }
        let span = |i: usize| [2 * (first[i] - origin[i]) + offset[i], window[i], array[i]];
        Ok(Format { width: out[0], height: out[1], columns: span(0), rows: span(1) })
    }

    /// The frame that begins at a time.
    pub(super) fn frame(&mut self, begin: u64) -> Vec<u8> {
        self.frames += 1;
        let format = match self.format() {
            Ok(format) => format,
            Err(bytes) => return (0..bytes).map(|i| (i * i / 8) as u8).collect(),
        };
        let pixel = |u: usize, v: usize| -> [u8; 3] {
            let place = |at: usize, of: usize, [first, count, all]: [usize; 3], side: usize| {
                (first * of + at * count) * side / (of * all)
            };
            let mut column = place(u, format.width, format.columns, SIZE.0);
            let mut row = place(v, format.height, format.rows, SIZE.1);
            let flips = self.sensor(0x04);
            if flips & 0x80 != 0 {
                column = SIZE.0 - 1 - column;
            }
            if flips & 0x40 != 0 {
                row = SIZE.1 - 1 - row;
            }
            let light = u64::from(self.scene[row * SIZE.0 + column]) * self.sensitivity();
            let luma = ((light + 2400) / 4800).min(255) as u8;
            if self.sensor(0x12) & 0x02 != 0 {
                // Bars over the scene, at worst.
                let [bar, cb, cr] = BARS[u * BARS.len() / format.width];
                return [bar.saturating_add(luma), cb, cr];
            }
            [luma, (90 + u % 60) as u8, (140 + v % 60) as u8]
        };
        // A change is seen two frames after it: until then the upper half is an older one.
        let torn = begin < self.changed + 2 * self.period();
        let mut bytes = Vec::with_capacity(2 * format.width * format.height);
        for v in 0..format.height {
            for u in 0..format.width {
                let [y, cb, cr] = if torn && v < format.height / 2 { [64; 3] } else { pixel(u, v) };
                bytes.extend([y, if u % 2 == 0 { cb } else { cr }]);
            }
        }
        bytes
    }

    /// Exposed lines times gain in sixteenths; 4800 shows a scene as it is.
    fn sensitivity(&self) -> u64 {
        let (s, d) = (|a| u64::from(self.sensor(a)), |a| u64::from(self.dsp(a)));
        let lines = ((s(0x45) & 0x3F) << 10 | s(0x10) << 2 | s(0x04) & 3).min(671);
        let gain = (16 + (s(0x00) & 15)) << (self.sensor(0x00) >> 4).count_ones();
        // What is automatic drifts from frame to frame.
        let automatic = s(0x13) & 0x25 != 0 || d(0xC3) & 0x0C != 0;
        lines * gain + if automatic { 200 * (1 + self.frames % 4) } else { 0 }
    }
}
