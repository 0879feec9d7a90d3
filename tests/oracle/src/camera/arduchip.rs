//! The ArduChip: a FIFO of one frame behind SPI commands.

use super::{Sensor, Time};
use std::cell::RefCell;
use std::rc::Rc;

const MS: u64 = 1_000_000;
const WRITE: u8 = 0x80;
const BURST: u8 = 0x3C;

/// Bytes that an old chip sends too many.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Dummy {
    /// None.
    #[default]
    None,
    /// One before a frame.
    Frame,
    /// One in each burst.
    Burst,
}

/// How far the chip's reset is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Reset {
    /// Powered, never reset.
    Never,
    /// Held in reset since, ns.
    On(u64),
    /// Released at, ns.
    Off(u64),
}

/// A capture.
#[derive(Debug)]
enum Capture {
    None,
    /// Of a frame between these times, ns.
    Running(u64, u64),
    /// Kept: what is left of it.
    Kept(std::vec::IntoIter<u8>),
}

/// A chip and what is wrong with it.
#[derive(Debug)]
pub struct ArduChip {
    /// Bytes sent too many.
    pub dummy: Dummy,
    /// How many of the next captures never end.
    pub hangs: u32,
    /// Bytes by which frames are longer than they should be.
    pub excess: i32,
    /// Bits that are flipped on the way back, of a million.
    pub noise: u32,
    /// A level that the line back always has.
    pub stuck: Option<bool>,
    /// Transactions until the bus breaks for good.
    pub breaks_in: Option<u32>,
    /// Whether the sensor loses its supply at the next capture.
    pub sags: bool,
    /// Bursts, and bytes fetched in them, so far.
    pub fetched: (usize, usize),

    time: Time,
    sensor: Rc<RefCell<Sensor>>,
    /// The command of the transaction under way, and how many bytes followed it.
    command: Option<(u8, usize)>,
    reset: Reset,
    test: u8,
    length: [u8; 3],
    capture: Capture,
    /// Pointers were reset: the next capture is cut short.
    cut: bool,
    random: u64,
}

impl ArduChip {
    pub(super) fn new(time: Time, sensor: Rc<RefCell<Sensor>>) -> Self {
        Self {
            dummy: Dummy::None,
            hangs: 0,
            excess: 0,
            noise: 0,
            stuck: None,
            breaks_in: None,
            sags: false,
            fetched: (0, 0),
            time,
            sensor,
            command: None,
            reset: Reset::Never,
            test: 0,
            length: [0; 3],
            capture: Capture::None,
            cut: false,
            random: 0x9E37_79B9_7F4A_7C15,
        }
    }

    pub(super) fn is_broken(&mut self) -> bool {
        let left = self.breaks_in;
        self.breaks_in = left.map(|n| n.saturating_sub(1));
        left == Some(0)
    }

    pub(super) fn release(&mut self) {
        let (command, bytes) = self.command.take().expect("the chip is selected, but for no command");
        assert!(bytes > 0, "chip select released early: after command {command:#04x}, before its data");
    }

    /// A byte each way.
    pub(super) fn exchange(&mut self, sent: u8) -> u8 {
        let Some((command, bytes)) = self.command else {
            self.command = Some((sent, 0));
            self.begin(sent);
            return 0;
        };
        self.command = Some((command, bytes + 1));
        if command == BURST {
            return self.fetch(bytes);
        }
        assert!(bytes == 0, "command {command:#04x} has one byte of data");
        if command & WRITE != 0 {
            self.write(command & !WRITE, sent);
            return 0;
        }
        assert!(sent == 0, "{sent:#04x} goes to command {command:#04x}, which reads");
        self.read(command)
    }

    /// What arrives of a byte on a line that flips `more` bits of a million beside its own noise.
    pub(super) fn disturb(&mut self, byte: u8, more: u32) -> u8 {
        let mut seen = byte;
        for bit in 0..8 {
            // xorshift64
            self.random ^= self.random << 13;
            self.random ^= self.random >> 7;
            self.random ^= self.random << 17;
            if self.random % 1_000_000 < u64::from(self.noise + more) {
                seen ^= 1 << bit;
            }
        }
        self.stuck.map_or(seen, |high| if high { 0xFF } else { 0 })
    }

    fn begin(&mut self, command: u8) {
        let now = self.time.now();
        match self.reset {
            Reset::Never => assert!(command == WRITE | 0x07, "the chip was never reset"),
            Reset::On(since) => {
                assert!(command == WRITE | 0x07 && now >= since + 100 * MS, "the chip is being reset");
            }
            Reset::Off(since) => assert!(now >= since + 100 * MS, "the chip still wakes from its reset"),
        }
        if command != BURST {
            return;
        }
        self.look();
        assert!(matches!(self.capture, Capture::Kept(_)), "a burst before a frame is kept");
        self.fetched.0 += 1;
    }

    fn fetch(&mut self, bytes: usize) -> u8 {
        let Capture::Kept(frame) = &mut self.capture else { panic!("the frame is gone") };
        self.fetched.1 += 1;
        if self.dummy == Dummy::Burst && bytes == 0 {
            return 0;
        }
        frame.next().expect("the FIFO has been read to its end")
    }

    fn write(&mut self, address: u8, value: u8) {
        match address {
            0x00 => self.test = value,
            0x01 => assert!(value == 0, "{} frames are asked for, one is read", value + 1),
            0x03 => assert!(value == 0, "the sensor's signals are active high and not delayed"),
            0x04 => self.control(value),
            0x07 => self.reset(value),
            _ => panic!("register {address:#04x} of the chip is not to be written"),
        }
    }

    fn reset(&mut self, value: u8) {
        let now = self.time.now();
        self.reset = match (self.reset, value) {
            (Reset::Never | Reset::Off(_), 0x80) => Reset::On(now),
            (Reset::On(_), 0x00) => Reset::Off(now),
            (state, _) => panic!("{value:#04x} resets nothing in {state:?}"),
        };
        (self.capture, self.test, self.cut) = (Capture::None, 0, false);
    }

    fn control(&mut self, value: u8) {
        match value {
            0x01 => {
                assert!(!matches!(self.capture, Capture::Running(..)), "a capture is cleared away");
                self.capture = Capture::None;
            }
            0x02 => self.start(),
            0x10 | 0x20 | 0x30 => self.cut = true,
            _ => panic!("{value:#04x} is several orders to the FIFO at once"),
        }
    }

    fn start(&mut self) {
        let kept = !matches!(self.capture, Capture::None);
        assert!(!kept, "a capture begins while the last one runs, or before its flag is cleared");
        let mut sensor = self.sensor.borrow_mut();
        if std::mem::take(&mut self.sags) {
            sensor.lose_power();
        }
        let begin = sensor.next_frame();
        let end = if self.hangs > 0 { u64::MAX } else { begin.saturating_add(sensor.period()) };
        self.hangs = self.hangs.saturating_sub(1);
        self.capture = Capture::Running(begin, end);
    }

    /// See whether the capture under way is done.
    fn look(&mut self) {
        let Capture::Running(begin, end) = self.capture else { return };
        if self.time.now() < end {
            return;
        }
        let mut frame = self.sensor.borrow_mut().frame(begin);
        let length = if std::mem::take(&mut self.cut) { frame.len() / 3 } else { frame.len() };
        frame.resize(length.saturating_add_signed(self.excess as isize), 0);
        let [low, middle, high, _] = (frame.len() as u32).to_le_bytes();
        // The highest bit is no part of the length.
        self.length = [low, middle, high | 0x80];
        if self.dummy == Dummy::Frame {
            frame.insert(0, 0);
        }
        self.capture = Capture::Kept(frame.into_iter());
    }

    fn read(&mut self, address: u8) -> u8 {
        self.look();
        let done = matches!(self.capture, Capture::Kept(_));
        match address {
            0x00 => self.test,
            0x40 => 0x73,
            // Bit 0 is the sensor's frame signal, which is none of the driver's business.
            0x41 => u8::from(done) << 3 | (self.time.now() / 1000 % 2) as u8,
            0x42..=0x44 => {
                assert!(done, "the length of a frame that is not kept yet");
                self.length[usize::from(address - 0x42)]
            }
            _ => panic!("register {address:#04x} of the chip is not to be read"),
        }
    }
}
