//! Two modules as one pair of eyes.
//!
//! Each step is taken by both eyes before the next, so that a shared control bus works and waiting is shared.
//! Both captures are started back to back, but each sensor runs on its own: each eye keeps its next whole
//! frame, and the skew between both is up to one frame. It is measured, not mended.

use super::arducam::{self, ArduChip, ROW_BYTES};
use super::control::ControlBus;
use super::ov2640::{self, Sensor};
use super::registers;
use super::test_picture::{LumaPlace, TestPicture};
use crate::ports::{CameraError, CameraFault, CameraPair, Clock, Exposure, Identity, Side, Stamps};
use embedded_hal::delay::DelayNs;
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

impl<S: SpiDevice, I: ControlBus> Module<S, I> {
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
    /// The exposure last ordered.
    exposure: Exposure,
    started: bool,
}

impl<S: SpiDevice, I: ControlBus, D: DelayNs, C: Clock> Pair<S, I, D, C> {
    /// The left and the right module, not started yet.
    pub fn new(left: Module<S, I>, right: Module<S, I>, delay: D, clock: C) -> Self {
        Self { modules: [left, right], delay, clock, exposure: Exposure::default(), started: false }
    }

    /// From any state to pictures of the exposure ordered.
    fn set_up(&mut self) -> Result<[Identity; 2], CameraError> {
        let (modules, delay) = (&mut self.modules, &mut self.delay);
        for on in [true, false] {
            both(modules, |m| m.chip.reset(on))?;
            delay.delay_ms(arducam::RESET_MS);
        }
        both(modules, |m| m.chip.echo())?;
        both(modules, |m| m.chip.set_up())?;
        modules.iter_mut().for_each(|m| m.sensor.free());
        // Another sensor is not written to.
        both(modules, |m| m.sensor.identify())?;
        both(modules, |m| {
            m.sensor.reset()?;
            // At once: on a shared bus this reset both, and the other one's order must be heard.
            delay.delay_ms(ov2640::RESET_MS);
            Ok(())
        })?;
        both(modules, |m| m.sensor.set_up())?;
        self.test()?;
        both(&mut self.modules, Module::identity)
    }

    /// Colour bars through the whole way. They may be laid over what is seen, so next to nothing is exposed.
    fn test(&mut self) -> Result<(), CameraError> {
        self.show(true, Exposure::LEAST)?;
        self.take()?;
        both(&mut self.modules, Module::judge_bars)?;
        self.show(false, self.exposure)
    }

    /// Let both eyes see bars or the world, and wait until their frames do.
    fn show(&mut self, bars: bool, exposure: Exposure) -> Result<(), CameraError> {
        both(&mut self.modules, |m| {
            m.sensor.expose(exposure)?;
            m.sensor.show_bars(bars)
        })?;
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

    fn need_start(&self) -> Result<(), CameraError> {
        let stopped = CameraError { side: Side::Left, fault: CameraFault::NotStarted };
        if self.started { Ok(()) } else { Err(stopped) }
    }

    fn forget_pictures(&mut self) {
        self.modules.iter_mut().for_each(|m| m.done = None);
    }

    /// Act on both eyes: pictures that were not read are lost, and after a failure the eyes count as stopped.
    fn act<T>(&mut self, action: impl FnOnce(&mut Self) -> Result<T, CameraError>) -> Result<T, CameraError> {
        self.forget_pictures();
        let result = action(self);
        if result.is_err() {
            self.forget_pictures();
        }
        self.started = result.is_ok();
        result
    }
}

impl<S: SpiDevice, I: ControlBus, D: DelayNs, C: Clock> CameraPair for Pair<S, I, D, C> {
    const WIDTH: usize = registers::WIDTH;
    const HEIGHT: usize = registers::HEIGHT;

    fn start(&mut self, exposure: Exposure) -> Result<[Identity; 2], CameraError> {
        self.exposure = exposure;
        self.act(Self::set_up)
    }

    fn expose(&mut self, exposure: Exposure) -> Result<(), CameraError> {
        self.need_start()?;
        self.exposure = exposure;
        self.act(|eyes| eyes.show(false, exposure))
    }

    fn capture(&mut self) -> Result<Stamps, CameraError> {
        self.need_start()?;
        let taken = self.act(Self::take);
        // Only a capture that still runs is in the way of another.
        self.started = !matches!(taken, Err(CameraError { fault: CameraFault::TimeLimit(_), .. }));
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
        self.need_start()?;
        self.act(Self::test)
    }
}
