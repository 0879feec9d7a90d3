//! NUCLEO-H743ZI2 with two ArduCAM Mini 2MP Plus: what is wired where, and the ports of the device made of
//! it. `firmware/README.md` draws the wires; docs/decisions/0008 says why these.
//!
//! Not yet run on silicon.
#![expect(unsafe_code, reason = "interrupt handlers and their bindings are unsafe by the runtime's rules")]

mod clocks;
mod control;
mod flash;
mod lamps;
mod link;
mod reset;
mod usb;
mod watchdog;

pub use control::Control;
pub use flash::Flash;
pub use lamps::Lamps;
pub use link::Link;
pub use watchdog::Watchdog;

use crate::camera::pair::{Module, Pair};
use crate::device::Birth;
use crate::drive::Ports;
use crate::ports;
use crate::record::Record;
use control::Wire;
use cortex_m::Peripherals;
use defmt_rtt as _;
use embassy_executor::InterruptExecutor;
use embassy_stm32::gpio::{AnyPin, Level, Output, Speed};
use embassy_stm32::i2c::{self, I2c};
use embassy_stm32::interrupt::{self, InterruptExt as _, Priority};
use embassy_stm32::mode::Blocking as Polled;
use embassy_stm32::spi::{self, Spi, mode};
use embassy_stm32::time::Hertz;
use embassy_stm32::{Peri, bind_interrupts, pac, peripherals, usart};
use embassy_time::{Delay, Instant};
use embedded_hal_bus::spi::ExclusiveDevice;
use panic_probe as _;
use static_cell::ConstStaticCell;

bind_interrupts!(struct Interrupts {
    USART3 => usart::BufferedInterruptHandler<peripherals::USART3>;
    OTG_FS => embassy_stm32::usb::InterruptHandler<peripherals::USB_OTG_FS>;
});

/// Runs the USB device whatever the core is busy with.
static BACKGROUND: InterruptExecutor = InterruptExecutor::new();

/// An interrupt that nothing else uses.
#[embassy_stm32::interrupt]
unsafe fn UART8() {
    // SAFETY: called from the interrupt that the executor was started with, and from nowhere else.
    unsafe { BACKGROUND.on_interrupt() }
}

/// A picture bus with one module on it.
pub type Pictures = ExclusiveDevice<Spi<'static, Polled, mode::Master>, Output<'static>, Delay>;
/// Both eyes.
pub type Cameras = Pair<Pictures, Control, Delay, Clock>;

/// What the modules allow is 8 MHz; the divider makes 6.25 of it.
const PICTURE_CLOCK: Hertz = Hertz(8_000_000);
/// Of USART3, behind ST-Link's virtual serial port.
const BAUD: u32 = 921_600;
/// The last two sectors of flash: what the linker leaves free (`memory.x`).
const CALIBRATION: u32 = (2048 - 2 * 128) * 1024;

/// Time since the board started.
#[derive(Clone, Copy, Debug)]
pub struct Clock;

impl ports::Clock for Clock {
    fn micros(&self) -> u64 {
        Instant::now().as_micros()
    }
}

/// What the board has.
pub struct Board {
    /// What a device reaches: both eyes, not started yet; the host, on USB or behind ST-Link; time; the end of
    /// flash; the watchdog.
    pub ports: Ports<Cameras, Link, Clock, Record<Flash>, Watchdog>,
    /// Three lamps.
    pub lamps: Lamps,
    /// Its name, why it has started, and how often it hung.
    pub birth: Birth,
}

impl Board {
    /// Start the board; nothing when it has been started before, or when a driver refuses its settings.
    pub fn take() -> Option<Self> {
        // Before anything that waits.
        let watchdog = Watchdog::start();
        let mut core = Peripherals::take()?;
        let p = embassy_stm32::init(clocks::configuration());
        let birth = reset::recall("NUCLEO-H743ZI2");
        // No master but the processor touches memory: there is no DMA, so caches go stale where flash is erased alone.
        core.SCB.enable_icache();
        core.SCB.enable_dcache(&mut core.CPUID);

        let eye =
            |bus: Spi<'static, Polled, mode::Master>, select: Peri<'static, AnyPin>, control: Control| {
                let select = Output::new(select, Level::High, Speed::Medium);
                let Ok(pictures) = ExclusiveDevice::new(bus, select, Delay);
                Module::new(pictures, control)
            };
        let mut picture = spi::Config::default();
        picture.frequency = PICTURE_CLOCK;
        // Slow edges ring less on long wires.
        picture.gpio_speed = Speed::Medium;
        let mut control = i2c::Config::default();
        control.frequency = Hertz::khz(100);
        (control.scl_pullup, control.sda_pullup) = (true, true);
        let left = eye(
            Spi::new_blocking(p.SPI1, p.PA5, p.PB5, p.PA6, picture),
            p.PD14.into(),
            Control::new(
                I2c::new_blocking(p.I2C1, p.PB8, p.PB9, control),
                pac::I2C1,
                Wire::new(pac::GPIOB, 8),
                Wire::new(pac::GPIOB, 9),
            ),
        );
        let right = eye(
            Spi::new_blocking(p.SPI4, p.PE2, p.PE6, p.PE5, picture),
            p.PE4.into(),
            Control::new(
                I2c::new_blocking(p.I2C2, p.PF1, p.PF0, control),
                pac::I2C2,
                Wire::new(pac::GPIOF, 1),
                Wire::new(pac::GPIOF, 0),
            ),
        );

        interrupt::UART8.set_priority(Priority::P6);
        let background = BACKGROUND.start(interrupt::UART8);
        background.spawn(usb::task(p.USB_OTG_FS, p.PA12, p.PA11).ok()?);

        static SEND: ConstStaticCell<[u8; 4096]> = ConstStaticCell::new([0; 4096]);
        static RECEIVE: ConstStaticCell<[u8; 4096]> = ConstStaticCell::new([0; 4096]);
        let mut serial = usart::Config::default();
        serial.baudrate = BAUD;
        let serial =
            usart::BufferedUart::new(p.USART3, p.PD9, p.PD8, SEND.take(), RECEIVE.take(), Interrupts, serial)
                .ok()?;

        Some(Self {
            ports: Ports {
                cameras: Pair::new(left, right, Delay, Clock),
                link: Link::new(serial),
                clock: Clock,
                flash: Record::new(
                    Flash::new(embassy_stm32::flash::Flash::new_blocking(p.FLASH), core.SCB),
                    CALIBRATION,
                ),
                watchdog,
            },
            lamps: Lamps::new([p.PB0.into(), p.PE1.into(), p.PB14.into()]),
            birth,
        })
    }
}
