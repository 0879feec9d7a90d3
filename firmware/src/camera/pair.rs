//! Two modules as one pair of eyes.
//!
//! Each step is taken by both eyes before the next, so that waiting is shared and a shared control bus works.
//! Both captures are started back to back, but each sensor runs on its own: each eye keeps its next whole
//! frame, and the skew between both is up to one frame. It is measured, not mended.

use super::arducam::{self, ArduChip, ROW_BYTES};
use super::ov2640::{self, Sensor};
use super::registers;
use super::test_picture::{LumaPlace, TestPicture};
use crate::ports::{CameraError, CameraFault, CameraPair, Clock, Exposure, Identity, Side, Stamps};
use embedded_hal::delay::DelayNs;
use embedded_hal::i2c::I2c;
use embedded_hal::spi::SpiDevice;

/// How long a capture may take, us: several of the slowest frames.
pub const CAPTURE_LIMIT_US: u32 = 500_000;
/// Between looks at a capture, us: how exact stamps are.
const POLL_US: u32 = 100;

/// One module.
#[derive(Debug)]
pub struct Module<S, I> {
    chip: ArduChip<S>,
    sensor: Sensor<I>,
    luma: LumaPlace,
    /// When the picture that waits in the chip was seen to be done, us.
    done: Option<u64>,
}

impl<S: SpiDevice, I: I2c> Module<S, I> {
    /// The module on a picture bus and a control bus.
    pub const fn new(picture: S, control: I) -> Self {
        Self { chip: ArduChip::new(picture), sensor: Sensor::new(control), luma: LumaPlace::Even, done: None }
    }

    fn identity(&mut self) -> Result<Identity, CameraFault> {
        let (sensor, controller) = (self.sensor.identify()?, self.chip.version()?);
        Ok(Identity { sensor, controller, sends_dummy: self.luma == LumaPlace::Odd })
    }

    fn poll(&mut self, clock: &impl Clock) -> Result<bool, CameraFault> {
        if self.done.is_none() && self.chip.is_done()? {
            self.done = Some(clock.micros());
        }
        Ok(self.done.is_some())
    }

    /// Find luma in a picture of colour bars.
    fn judge_bars(&mut self) -> Result<(), CameraFault> {
        let (mut picture, mut bytes) = (TestPicture::default(), [0; ROW_BYTES]);
        self.done = None;
        for row in 0..registers::HEIGHT as u16 {
            self.chip.row(&mut bytes)?;
            if !picture.accepts(&bytes) {
                return Err(CameraFault::TestPicture(row));
            }
        }
        self.luma = picture.place().unwrap_or_default();
        Ok(())
    }
}

/// Let both eyes take a step, the left one first.
fn both<M, T>(
    modules: &mut [M; 2],
    mut step: impl FnMut(&mut M) -> Result<T, CameraFault>,
) -> Result<[T; 2], CameraError> {
    let [left, right] = modules;
    let left = step(left).map_err(|fault| CameraError { side: Side::Left, fault })?;
    let right = step(right).map_err(|fault| CameraError { side: Side::Right, fault })?;
    Ok([left, right])
}

/// Both modules, and time.
#[derive(Debug)]
pub struct Pair<S, I, D, C> {
    modules: [Module<S, I>; 2],
    delay: D,
    clock: C,
    started: bool,
}

impl<S: SpiDevice, I: I2c, D: DelayNs, C: Clock> Pair<S, I, D, C> {
    /// The left and the right module, not started yet.
    pub const fn new(left: Module<S, I>, right: Module<S, I>, delay: D, clock: C) -> Self {
        Self { modules: [left, right], delay, clock, started: false }
    }

    /// From any state to pictures of fixed exposure.
    fn set_up(&mut self, exposure: Exposure) -> Result<[Identity; 2], CameraError> {
        let (modules, delay) = (&mut self.modules, &mut self.delay);
        for on in [true, false] {
            both(modules, |m| m.chip.reset(on))?;
            delay.delay_ms(arducam::RESET_MS);
        }
        both(modules, |m| m.chip.echo())?;
        both(modules, |m| m.chip.set_up())?;
        // Another sensor is not written to.
        both(modules, |m| m.sensor.identify())?;
        both(modules, |m| m.sensor.reset())?;
        delay.delay_ms(ov2640::RESET_MS);
        both(modules, |m| m.sensor.set_up())?;
        both(modules, |m| m.sensor.expose(exposure))?;
        self.test()?;
        both(&mut self.modules, Module::identity)
    }

    /// Colour bars through the whole way.
    fn test(&mut self) -> Result<(), CameraError> {
        both(&mut self.modules, |m| m.sensor.show_bars(true))?;
        self.delay.delay_ms(ov2640::SETTLE_MS);
        self.take()?;
        both(&mut self.modules, Module::judge_bars)?;
        both(&mut self.modules, |m| m.sensor.show_bars(false))?;
        self.delay.delay_ms(ov2640::SETTLE_MS);
        Ok(())
    }

    /// A whole frame in each chip.
    fn take(&mut self) -> Result<Stamps, CameraError> {
        let modules = &mut self.modules;
        // Noise, or a chip that lost its supply, shows here before it looks like a picture.
        both(modules, |m| m.chip.echo())?;
        both(modules, |m| m.chip.clear())?;
        both(modules, |m| m.chip.capture())?;
        for _ in 0..=CAPTURE_LIMIT_US / POLL_US {
            if both(modules, |m| m.poll(&self.clock))? == [true; 2] {
                break;
            }
            self.delay.delay_us(POLL_US);
        }
        let done = both(modules, |m| m.done.ok_or(CameraFault::TimeLimit(CAPTURE_LIMIT_US)))?;
        both(modules, |m| m.chip.check_length())?;
        Ok(Stamps { done })
    }

    /// Before anything but reading: pictures are forgotten, and the eyes count as stopped until all is done.
    fn begin(&mut self) -> Result<(), CameraError> {
        for module in &mut self.modules {
            module.done = None;
        }
        let stopped = CameraError { side: Side::Left, fault: CameraFault::NotStarted };
        if core::mem::take(&mut self.started) { Ok(()) } else { Err(stopped) }
    }
}

impl<S: SpiDevice, I: I2c, D: DelayNs, C: Clock> CameraPair for Pair<S, I, D, C> {
    const WIDTH: usize = registers::WIDTH;
    const HEIGHT: usize = registers::HEIGHT;

    fn start(&mut self, exposure: Exposure) -> Result<[Identity; 2], CameraError> {
        // Whether they ran does not matter here.
        let _ = self.begin();
        let identities = self.set_up(exposure)?;
        self.started = true;
        Ok(identities)
    }

    fn expose(&mut self, exposure: Exposure) -> Result<(), CameraError> {
        self.begin()?;
        both(&mut self.modules, |m| m.sensor.expose(exposure))?;
        self.delay.delay_ms(ov2640::SETTLE_MS);
        self.started = true;
        Ok(())
    }

    fn capture(&mut self) -> Result<Stamps, CameraError> {
        self.begin()?;
        let taken = self.take();
        self.started = !matches!(taken, Err(CameraError { fault: CameraFault::TimeLimit(_), .. }));
        if taken.is_err() {
            self.modules.iter_mut().for_each(|m| m.done = None);
        }
        taken
    }

    fn read(&mut self, side: Side, line: &mut dyn FnMut(usize, &[u8])) -> Result<(), CameraError> {
        let [left, right] = &mut self.modules;
        let module = match side {
            Side::Left => left,
            Side::Right => right,
        };
        let wrong = |fault| CameraError { side, fault };
        module.done.take().ok_or(wrong(CameraFault::NoPicture))?;
        let mut bytes = [0; ROW_BYTES];
        for row in 0..Self::HEIGHT {
            module.chip.row(&mut bytes).map_err(wrong)?;
            line(row, &module.luma.luma(&bytes));
        }
        Ok(())
    }

    fn self_test(&mut self) -> Result<(), CameraError> {
        self.begin()?;
        self.test()?;
        self.started = true;
        Ok(())
    }
}
