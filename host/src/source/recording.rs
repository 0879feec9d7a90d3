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
}

impl Recording {
    /// Begins a recording. A calibration that OpenCV's file cannot hold (fisheye lenses, eyes of two sizes)
    /// is copied from `file`, a Kalibr camchain.
    ///
    /// # Errors
    ///
    /// See [`RecordError`].
    pub fn begin(
        folder: &Path,
        calibration: &StereoCamera,
        file: Option<&Path>,
    ) -> Result<Self, RecordError> {
        let failed = |source| RecordError::Folder { path: folder.into(), source };
        std::fs::create_dir_all(folder).map_err(failed)?;
        if std::fs::read_dir(folder).map_err(failed)?.next().is_some() {
            return Err(RecordError::NotEmpty { path: folder.into() });
        }
        match (calibration.write_opencv_yaml(folder.join("calib.yaml")), file) {
            (Err(CalibrationError::Inexpressible { .. }), Some(file)) if file.is_file() => {
                let bytes = std::fs::read(file).map_err(failed)?;
                write_together(&[(&folder.join("camchain.yaml"), bytes)])?;
            }
            (result, _) => result?,
        }
        Ok(Self { folder: folder.into() })
    }

    /// Adds a pair.
    ///
    /// # Errors
    ///
    /// See [`RecordError`].
    pub fn add(&self, number: u64, views: &[GrayImage; 2]) -> Result<(), RecordError> {
        let [left, right] = ["left", "right"].map(|eye| self.folder.join(format!("{eye}_{number:06}.png")));
        let bytes = |view: &GrayImage, path: &Path| {
            let mut bytes = Cursor::new(Vec::new());
            view.write_to(&mut bytes, ImageFormat::Png)
                .map_err(|error| ExportError::Io { path: path.into(), source: io::Error::other(error) })?;
            Ok::<_, ExportError>(bytes.into_inner())
        };
        let files =
            [(left.as_path(), bytes(&views[0], &left)?), (right.as_path(), bytes(&views[1], &right)?)];
        Ok(write_together(&files)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::find::find;
    use image::Luma;

    #[test]
    fn what_is_recorded_is_found_again_bit_by_bit() {
        let parent = tempfile::tempdir().unwrap();
        let folder = parent.path().join("new/recording");
        let camera = StereoCamera::rectified(5, 3, 4.0, 60.0);
        let recording = Recording::begin(&folder, &camera, None).unwrap();
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
        let error = Recording::begin(&folder, &camera, None).unwrap_err().to_string();
        assert!(error.contains("not empty"), "{error}");
    }
}
