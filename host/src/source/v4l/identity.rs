//! What tells a camera from others when it comes back under another node: where it is plugged in, or its own serial
//! number.

use std::fs;
use std::path::Path;

/// Where Linux tells of cameras.
pub const SYSTEM: &str = "/sys/class/video4linux";

/// A camera, whatever node it has.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Identity {
    /// Its name.
    pub name: String,
    /// Where it is plugged in.
    pub bus: String,
    /// Which of its device's nodes it is, if the system says.
    pub index: Option<u32>,
    /// Its USB device's serial number, if it has one. Makers give all of a kind the same, or none.
    pub serial: Option<String>,
}

impl Identity {
    /// The camera of a node with this name on this bus; `system` is [`SYSTEM`].
    #[must_use]
    pub fn of(node: &Path, (name, bus): (String, String), system: &Path) -> Self {
        let about = system.join(node.file_name().unwrap_or_default());
        let read = |file: &Path| fs::read_to_string(file).ok().map(|text| text.trim().to_owned());
        let index = read(&about.join("index")).and_then(|text| text.parse().ok());
        // What the node belongs to is an interface of the device that has a number of a vendor.
        let device = fs::canonicalize(about.join("device")).unwrap_or_default();
        let device = device.ancestors().find(|folder| folder.join("idVendor").is_file());
        let serial =
            device.and_then(|device| read(&device.join("serial"))).filter(|serial| !serial.is_empty());
        Self { name, bus, index, serial }
    }

    /// The same, without a serial number that another of the cameras that are there has too: once one of them is gone,
    /// the number would look like the other's own.
    #[must_use]
    pub fn among(mut self, there: &[Self]) -> Self {
        let twin =
            |other: &Self| other.bus != self.bus && other.name == self.name && other.serial == self.serial;
        if there.iter().any(twin) {
            self.serial = None;
        }
        self
    }

    /// Which of these cameras it is: the one at its place, unless that says that it is another; else the only one with
    /// its serial number.
    #[must_use]
    pub fn find(&self, there: &[Self]) -> Option<usize> {
        let alike = |other: &Self| other.name == self.name && other.index == self.index;
        let is_other =
            |other: &Self| self.serial.is_some() && other.serial.is_some() && other.serial != self.serial;
        let here = |other: &&Self| alike(other) && other.bus == self.bus && !is_other(other);
        let same = |other: &&Self| alike(other) && self.serial.is_some() && other.serial == self.serial;
        let place = |wanted: &Self| there.iter().position(|other| std::ptr::eq(other, wanted));
        let at_home = there.iter().find(here);
        let mut elsewhere = there.iter().filter(same);
        at_home.or_else(|| elsewhere.next().filter(|_| elsewhere.next().is_none())).and_then(place)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(bus: &str, serial: &str) -> Identity {
        let serial = Some(serial.to_owned()).filter(|serial| !serial.is_empty());
        Identity { name: "3D camera".into(), bus: bus.into(), index: Some(0), serial }
    }

    #[test]
    fn a_camera_is_found_at_its_place_or_by_its_number() {
        let lost = camera("usb-1", "A7");
        let other_node = Identity { index: Some(1), ..lost.clone() };
        let other_kind = Identity { name: "microscope".into(), ..lost.clone() };
        assert_eq!(lost.find(&[other_node.clone(), other_kind.clone(), lost.clone()]), Some(2));
        assert_eq!(lost.find(&[camera("usb-2", "A7"), camera("usb-1", "")]), Some(1));
        assert_eq!(lost.find(&[camera("usb-3", "B1"), camera("usb-2", "A7")]), Some(1));
        // Another one of its kind in its place.
        assert_eq!(lost.find(&[camera("usb-1", "B1")]), None);
        // All of a kind have the same number.
        assert_eq!(lost.find(&[camera("usb-2", "A7"), camera("usb-3", "A7")]), None);
        let plain = camera("usb-1", "");
        assert_eq!(plain.find(&[camera("usb-2", ""), camera("usb-1", "")]), Some(1));
        assert_eq!(plain.find(&[camera("usb-2", ""), other_node, other_kind]), None);
    }

    #[test]
    fn a_twin_that_was_there_before_is_not_taken_for_the_lost_one() {
        let (lost, twin, other) = (camera("usb-1", "A7"), camera("usb-2", "A7"), camera("usb-3", "B1"));
        let known = lost.clone().among(&[lost.clone(), twin.clone(), other.clone()]);
        assert_eq!(known.find(std::slice::from_ref(&twin)), None);
        assert_eq!(known.find(&[twin, lost.clone()]), Some(1));
        // Its own other node and another kind are no twins.
        let metadata = Identity { index: Some(1), ..lost.clone() };
        let microscope = Identity { name: "microscope".into(), bus: "usb-4".into(), ..lost.clone() };
        let alone = lost.clone().among(&[lost.clone(), metadata, microscope, other]);
        assert_eq!(alone.find(&[camera("usb-2", "A7")]), Some(0));
    }

    #[cfg(unix)]
    #[test]
    fn the_system_tells_index_and_serial_number() {
        let folder = tempfile::tempdir().unwrap();
        let root = fs::canonicalize(folder.path()).unwrap();
        let (usb, class) = (root.join("devices/usb1/1-4"), root.join("class"));
        let interface = usb.join("1-4:1.0");
        for folder in [&interface, &class.join("video3"), &class.join("video4")] {
            fs::create_dir_all(folder).unwrap();
        }
        fs::write(usb.join("idVendor"), "1bcf\n").unwrap();
        fs::write(usb.join("serial"), "A7\n").unwrap();
        fs::write(class.join("video3/index"), "2\n").unwrap();
        std::os::unix::fs::symlink(&interface, class.join("video3/device")).unwrap();
        let of = |node: &str| Identity::of(Path::new(node), ("camera".into(), "usb-1".into()), &class);
        let told = of("/dev/video3");
        assert_eq!((told.index, told.serial.as_deref()), (Some(2), Some("A7")));
        let silent = of("/dev/video4");
        assert_eq!((silent.index, silent.serial), (None, None));
    }
}
