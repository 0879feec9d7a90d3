//! A folder of pairs that [`super::find`] gives back in their order: `left_000001.png`, `right_000001.png`
//! and so on, and the calibration.
//!
//! Both files of a pair are complete before either has its name, and the calibration comes first, so a
//! recording that was cut short is a shorter recording.

use std::io::{self, Cursor};
use std::path::{Path, PathBuf};

use image::{GrayImage, ImageFormat};

use crate::calibration::{CalibrationError, StereoCamera};
use crate::export::ExportError;
use crate::output::write_together;
use crate::unfinished::{is_hidden, sweep};

/// Why pairs are not recorded.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The folder holds something already.
    #[error("{} is not empty; record into a new folder, so that no pairs are mixed", path.display())]
    NotEmpty {
        /// The folder.
        path: PathBuf,
    },
    /// It cannot be made or read.
    #[error("cannot record into {}", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The calibration cannot be written.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
    /// A pair cannot be written.
    #[error(transparent)]
    Pair(#[from] ExportError),
}

/// A folder that pairs go to.
#[derive(Clone, Debug)]
pub struct Recording {
    folder: PathBuf,
    /// What is written before the first pair: a calibration, and the file that it comes from.
    calibration: Option<(StereoCamera, Option<PathBuf>)>,
}

impl Recording {
    /// Sees that the folder is new or empty; it is made with the first pair. A calibration that OpenCV's file
    /// cannot hold (fisheye lenses, eyes of two sizes) is copied from its file, a Kalibr camchain.
    ///
    /// # Errors
    ///
    /// See [`RecordError`].
    pub fn begin(
        folder: &Path,
        calibration: Option<(StereoCamera, Option<PathBuf>)>,
    ) -> Result<Self, RecordError> {
        let path = || folder.to_path_buf();
        let failed = |source| RecordError::Folder { path: path(), source };
        let names =
            || std::fs::read_dir(folder)?.map(|entry| Ok(entry?.file_name())).collect::<io::Result<Vec<_>>>();
        if folder.exists() {
            // A folder that holds anything else is refused, and stays as it is.
            if names().map_err(failed)?.iter().all(|name| is_hidden(name)) {
                sweep(folder);
            }
            if !names().map_err(failed)?.is_empty() {
                return Err(RecordError::NotEmpty { path: path() });
            }
        }
        Ok(Self { folder: path(), calibration })
    }

    /// Adds a pair.
    ///
    /// # Errors
    ///
    /// See [`RecordError`].
    pub fn add(&mut self, number: u64, views: &[GrayImage; 2]) -> Result<(), RecordError> {
        let failed = |source| RecordError::Folder { path: self.folder.clone(), source };
        std::fs::create_dir_all(&self.folder).map_err(failed)?;
        if let Some((calibration, file)) = &self.calibration {
            match (calibration.write_opencv_yaml(self.folder.join("calib.yaml")), file) {
                (Err(CalibrationError::Inexpressible { .. }), Some(file)) if file.is_file() => {
                    let bytes = std::fs::read(file).map_err(failed)?;
                    write_together(&[(&self.folder.join("camchain.yaml"), bytes)])?;
                }
                (result, _) => result?,
            }
            self.calibration = None;
        }
        let [left, right] = ["left", "right"].map(|eye| self.folder.join(format!("{eye}_{number:06}.png")));
        let files = [(left.as_path(), png(&views[0], &left)?), (right.as_path(), png(&views[1], &right)?)];
        Ok(write_together(&files)?)
    }
}

/// A view as a file of this name.
fn png(view: &GrayImage, path: &Path) -> Result<Vec<u8>, ExportError> {
    let mut bytes = Cursor::new(Vec::new());
    let written = view.write_to(&mut bytes, ImageFormat::Png);
    written.map_err(|error| ExportError::Io { path: path.into(), source: io::Error::other(error) })?;
    Ok(bytes.into_inner())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::find::find;
    use image::Luma;

    #[test]
    fn a_calibration_that_is_no_opencv_file_is_copied() {
        let folder = tempfile::tempdir().unwrap();
        let mut camera = StereoCamera::rectified(5, 3, 4.0, 60.0);
        camera.right.width = 6;
        let file = folder.path().join("mine.yaml");
        std::fs::write(&file, "cam0: {}").unwrap();
        let to = folder.path().join("recording");
        let mut recording = Recording::begin(&to, Some((camera, Some(file)))).unwrap();
        recording.add(1, &[GrayImage::new(5, 3), GrayImage::new(6, 3)]).unwrap();
        assert_eq!(std::fs::read(to.join("camchain.yaml")).unwrap(), b"cam0: {}");
        assert!(!to.join("calib.yaml").exists());
        let none = Recording::begin(&folder.path().join("none"), Some((camera, None))).unwrap();
        assert!(none.clone().add(1, &[GrayImage::new(5, 3), GrayImage::new(6, 3)]).is_err());
    }

    #[test]
    fn what_is_recorded_is_found_again_bit_by_bit() {
        let parent = tempfile::tempdir().unwrap();
        let folder = parent.path().join("new/recording");
        let camera = StereoCamera::rectified(5, 3, 4.0, 60.0);
        let mut recording = Recording::begin(&folder, Some((camera, None))).unwrap();
        assert!(!folder.exists());
        let view = |number: u64, eye: u32| {
            GrayImage::from_fn(5, 3, |u, v| Luma([(number as u32 * 50 + eye * 20 + u + 5 * v) as u8]))
        };
        for number in [2, 1, 10] {
            recording.add(number, &[view(number, 0), view(number, 1)]).unwrap();
        }
        let found = find(&[folder.display().to_string()], None).unwrap();
        let names: Vec<_> = found.pairs.iter().map(|pair| pair.name.as_str()).collect();
        assert_eq!((names, found.alone.len()), (vec!["000001", "000002", "000010"], 0));
        for (pair, number) in found.pairs.iter().zip([1, 2, 10]) {
            assert_eq!(pair.load().unwrap().images, [view(number, 0), view(number, 1)]);
            assert_eq!(StereoCamera::read(pair.calibration.as_ref().unwrap()).unwrap(), camera);
        }
        let error = Recording::begin(&folder, Some((camera, None))).unwrap_err().to_string();
        assert!(error.contains("not empty"), "{error}");
        let left = folder.join(".unfinished-left.ossature");
        let leave = || {
            let file = std::fs::File::create(&left).unwrap();
            file.set_modified(std::time::SystemTime::UNIX_EPOCH).unwrap();
        };
        leave();
        assert!(Recording::begin(&folder, None).is_err() && left.exists(), "what is refused is not touched");
        std::fs::remove_dir_all(&folder).unwrap();
        std::fs::create_dir(&folder).unwrap();
        leave();
        assert!(Recording::begin(&folder, None).is_ok() && !left.exists());
        let board = parent.path().join("board");
        Recording::begin(&board, None).unwrap().add(1, &[view(1, 0), view(1, 1)]).unwrap();
        assert_eq!(std::fs::read_dir(board).unwrap().count(), 2);
    }
}
