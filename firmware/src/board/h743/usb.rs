//! A serial port over USB (CDC ACM), run in the background. Bytes come and go through two pipes; when the
//! incoming one is full the host waits, so that nothing is lost.

use super::Interrupts;
use crate::endpoints::Known;
use core::sync::atomic::{AtomicBool, Ordering};
use embassy_futures::join::join3;
use embassy_stm32::peripherals::{PA11, PA12, USB_OTG_FS};
use embassy_stm32::{Peri, usb};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::pipe::Pipe;
use embassy_usb::class::cdc_acm::{CdcAcmClass, State};
use embassy_usb::{Builder, Config};

type Bytes = Pipe<CriticalSectionRawMutex, 2048>;

/// From the host.
pub(super) static INCOMING: Bytes = Bytes::new();
/// To the host.
pub(super) static OUTGOING: Bytes = Bytes::new();
/// Whether a host has set the device up.
pub(super) static OPEN: AtomicBool = AtomicBool::new(false);

/// Longest packet of full speed.
const PACKET: usize = 64;

/// The USB device, for ever.
#[embassy_executor::task]
pub(super) async fn task(
    peripheral: Peri<'static, USB_OTG_FS>,
    plus: Peri<'static, PA12>,
    minus: Peri<'static, PA11>,
) -> ! {
    let mut endpoints = [0; 4 * PACKET];
    let mut settings = usb::Config::default();
    // The board has no wire from the plug's supply to a pin of the controller.
    settings.vbus_detection = false;
    let driver = usb::Driver::new_fs(peripheral, Interrupts, plus, minus, &mut endpoints, settings);

    // pid.codes' number for tests: a product would have one of its own.
    let mut config = Config::new(0x1209, 0x0001);
    config.manufacturer = Some("Ossature");
    config.product = Some("Ossature stereo camera");
    config.serial_number = Some(embassy_stm32::uid::uid_hex());
    let (mut descriptors, mut bos, mut control) = ([0; 256], [0; 32], [0; 64]);
    let mut state = State::new();
    let mut builder =
        Builder::new(Known::new(driver), config, &mut descriptors, &mut bos, &mut [], &mut control);
    let class = CdcAcmClass::new(&mut builder, &mut state, PACKET as u16);
    let mut device = builder.build();
    let (mut sender, mut receiver) = class.split();

    let receive = async {
        let mut packet = [0; PACKET];
        loop {
            receiver.wait_connection().await;
            OUTGOING.clear();
            OPEN.store(true, Ordering::Relaxed);
            while let Ok(length) = receiver.read_packet(&mut packet).await {
                INCOMING.write_all(packet.get(..length).unwrap_or_default()).await;
            }
            OPEN.store(false, Ordering::Relaxed);
        }
    };
    let send = async {
        // Never a whole packet, which would say that more belongs to it.
        let mut packet = [0; PACKET - 1];
        loop {
            sender.wait_connection().await;
            loop {
                let length = OUTGOING.read(&mut packet).await;
                if sender.write_packet(packet.get(..length).unwrap_or_default()).await.is_err() {
                    break;
                }
            }
        }
    };
    join3(device.run(), receive, send).await.0
}
