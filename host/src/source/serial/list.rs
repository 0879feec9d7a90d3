//! The serial ports of this machine, and which of them look like a camera device.

use std::io;

use serialport::{SerialPortType, UsbPortInfo};

/// What our own firmware calls itself on USB.
const PRODUCT: &str = "Ossature";
/// USB's vendor and product numbers of the debuggers on development boards that pass a serial port through:
/// ST-LINK/V2-1 and /V3.
const DEBUGGERS: [(u16, u16); 6] = [
    (0x0483, 0x374b),
    (0x0483, 0x3752),
    (0x0483, 0x374e),
    (0x0483, 0x374f),
    (0x0483, 0x3753),
    (0x0483, 0x3754),
];

/// A serial port.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SerialPort {
    /// What to give as `--port`.
    pub path: String,
    /// What it says on USB, if it is there.
    pub usb: Option<Usb>,
}

/// What a port says on USB.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Usb {
    /// Number of the vendor.
    pub vendor: u16,
    /// Number of the product.
    pub product: u16,
    /// Name of the product, and its own number, as far as they are told.
    pub names: Vec<String>,
}

impl From<UsbPortInfo> for Usb {
    fn from(info: UsbPortInfo) -> Self {
        let names = [info.product, info.serial_number].into_iter().flatten().collect();
        Self { vendor: info.vid, product: info.pid, names }
    }
}

impl SerialPort {
    /// Whether it looks like a camera device, or like a board that may be one.
    #[must_use]
    pub fn is_device(&self) -> bool {
        self.usb.as_ref().is_some_and(|usb| {
            DEBUGGERS.contains(&(usb.vendor, usb.product))
                || usb.names.iter().any(|name| name.contains(PRODUCT))
        })
    }

    /// One line about it.
    #[must_use]
    pub fn line(&self) -> String {
        let Some(usb) = &self.usb else { return format!("{}  not on USB", self.path) };
        let names = usb.names.join(", ");
        let taken = if self.is_device() { "  taken by --port auto" } else { "" };
        format!("{}  {:04x}:{:04x} {names}{taken}", self.path, usb.vendor, usb.product)
    }
}

/// The serial ports, in the order of their paths.
///
/// # Errors
/// When the system cannot say.
pub fn ports() -> io::Result<Vec<SerialPort>> {
    let mut ports: Vec<SerialPort> = serialport::available_ports()?
        .into_iter()
        .map(|port| SerialPort {
            path: port.port_name,
            usb: match port.port_type {
                SerialPortType::UsbPort(info) => Some(info.into()),
                _ => None,
            },
        })
        .collect();
    ports.sort_by(|a, b| a.path.cmp(&b.path));
    Ok(ports)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn devices_are_told_by_their_identity() {
        let port = |vendor, product, name: &str| SerialPort {
            path: "/dev/ttyACM0".into(),
            usb: Some(Usb { vendor, product, names: vec![name.into()] }),
        };
        assert!(port(0x0483, 0x374e, "STLINK-V3").is_device());
        assert!(port(0x1234, 1, "Ossature camera").is_device());
        assert!(!port(0x2341, 0x43, "Arduino Uno").is_device());
        assert!(!SerialPort { path: "/dev/ttyS0".into(), usb: None }.is_device());
        assert_eq!(
            port(0x0483, 0x374e, "STLINK-V3").line(),
            "/dev/ttyACM0  0483:374e STLINK-V3  taken by --port auto"
        );
    }
}
