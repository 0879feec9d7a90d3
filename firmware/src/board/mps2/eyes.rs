//! Eyes that play pictures from a file of the PC, over and over.
//!
//! The file has the luma of left and right picture in turn, row by row, and nothing else. What was on a picture
//! is on it whatever exposure is ordered.

use super::files::refuse;
use super::timer::Clock;
use crate::ports::{CameraError, CameraFault, CameraPair, Clock as _, Exposure, Identity, Side, Stamps};
use semihosting::fs::File;
use semihosting::io::{Read as _, Seek as _, SeekFrom};

/// Columns and rows: those of the camera modules.
const SIZE: (usize, usize) = (320, 240);
const PICTURE: u64 = (SIZE.0 * SIZE.1) as u64;

/// Both eyes.
#[derive(Debug)]
pub struct Eyes<'c> {
    file: File,
    clock: &'c Clock,
    /// Pairs in the file.
    pairs: u64,
    /// The pair that is before the eyes.
    next: u64,
    started: bool,
    /// Where in the file the pictures begin that were taken and not read yet.
    taken: [Option<u64>; 2],
}

impl<'c> Eyes<'c> {
    /// Eyes that see the first pair of the file first. The image ends when that does not hold whole pairs.
    pub fn new(file: File, clock: &'c Clock) -> Self {
        let Ok(length) = file.metadata().map(|file| file.len()) else {
            refuse("the file's length cannot be read")
        };
        if length == 0 || !length.is_multiple_of(2 * PICTURE) {
            let (width, height) = SIZE;
            refuse(format_args!("{length} bytes: not a whole number of pairs of {width}x{height} luma"));
        }
        let pairs = length / (2 * PICTURE);
        Self { file, clock, pairs, next: 0, started: false, taken: [None; 2] }
    }
}

impl CameraPair for Eyes<'_> {
    const WIDTH: usize = SIZE.0;
    const HEIGHT: usize = SIZE.1;

    fn start(&mut self, _: Exposure) -> Result<[Identity; 2], CameraError> {
        (self.started, self.taken) = (true, [None; 2]);
        Ok([Identity { sensor: 0, controller: 0, sends_dummy: false }; 2])
    }

    fn expose(&mut self, _: Exposure) -> Result<(), CameraError> {
        self.self_test()
    }

    fn capture(&mut self) -> Result<Stamps, CameraError> {
        self.self_test()?;
        let left = self.next * 2 * PICTURE;
        self.taken = [Some(left), Some(left + PICTURE)];
        self.next = if self.next + 1 < self.pairs { self.next + 1 } else { 0 };
        Ok(Stamps { done: [self.clock.micros(); 2] })
    }

    fn read(&mut self, side: Side, line: &mut dyn FnMut(usize, &[u8])) -> Result<(), CameraError> {
        let failed = |fault| CameraError { side, fault };
        let bus = |_| failed(CameraFault::PictureBus);
        let start = self.taken[side as usize].take().ok_or(failed(CameraFault::NoPicture))?;
        self.file.seek(SeekFrom::Start(start)).map_err(bus)?;
        let mut luma = [0; SIZE.0];
        for row in 0..SIZE.1 {
            self.file.read_exact(&mut luma).map_err(bus)?;
            line(row, &luma);
        }
        Ok(())
    }

    fn self_test(&mut self) -> Result<(), CameraError> {
        self.taken = [None; 2];
        let error = CameraError { side: Side::Left, fault: CameraFault::NotStarted };
        self.started.then_some(()).ok_or(error)
    }
}
