//! What stands for the kernel's cameras where there is no Video4Linux: a sentence.

use std::io;
use std::path::Path;
use std::time::Duration;

use super::choose::{Camera, Choice};
use super::device::{Device, Frame};
use super::dial::Dial;
use super::errors::CameraError;
use super::format::Format;

/// A camera, which cannot be.
#[derive(Debug)]
pub enum Kernel {}

impl Kernel {
    /// Would open a camera.
    ///
    /// # Errors
    ///
    /// Always [`CameraError::NotLinux`].
    pub fn open(_path: &Path) -> Result<Self, CameraError> {
        Err(CameraError::NotLinux)
    }

    /// What it offers.
    #[must_use]
    pub fn camera(&self) -> &Camera {
        match *self {}
    }

    /// Looks for cameras that have the same serial number.
    pub fn tell_apart(&mut self) {
        match *self {}
    }

    /// Its exposure.
    #[must_use]
    pub fn dial(&self) -> Option<Dial> {
        match *self {}
    }

    /// Sets it.
    ///
    /// # Errors
    ///
    /// None, as there is no camera.
    pub fn set(&mut self, _choice: &Choice) -> Result<(), CameraError> {
        match *self {}
    }
}

impl Device for Kernel {
    fn path(&self) -> &Path {
        match *self {}
    }

    fn format(&self) -> Format {
        match *self {}
    }

    fn period(&self) -> Option<Duration> {
        match *self {}
    }

    fn start(&mut self) -> io::Result<()> {
        match *self {}
    }

    fn next(&mut self, _patience: Duration) -> io::Result<Frame> {
        match *self {}
    }

    fn find_again(&mut self) -> bool {
        match *self {}
    }
}

/// The cameras of this system.
///
/// # Errors
///
/// Always [`CameraError::NotLinux`].
pub fn list() -> Result<Vec<Result<Camera, CameraError>>, CameraError> {
    Err(CameraError::NotLinux)
}
