//! A pair as it waits: where its files are, how its model is made, and the sum by which it is known.

use std::io;
use std::path::{Component, Path, PathBuf};

use ring::digest::{Context, SHA256};
use serde::{Deserialize, Serialize};

use crate::source::{Files, Layout, Pair};

/// A pair that waits. Its paths start at the folder of its batch, wherever a machine has that.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Job {
    /// What its results are called after.
    pub name: String,
    /// Left and right, or both in one.
    pub files: Vec<PathBuf>,
    /// The calibration beside its images.
    pub calibration: Option<PathBuf>,
    /// The options of `host replay` with which its model is made.
    pub how: Vec<String>,
}

/// Why what was found in a queue is no pair.
#[derive(Debug, thiserror::Error)]
pub enum JobError {
    /// Not what this program writes.
    #[error("it is no pair that this version knows; submit it again with this one")]
    Unknown(#[from] serde_json::Error),
    /// Paths that lead elsewhere.
    #[error("its paths lead out of the folder of its batch; submit it again with this version")]
    Outside,
}

impl Job {
    /// A pair that lies in a folder. None if it does not, or if a path is no text.
    #[must_use]
    pub fn new(pair: &Pair, folder: &Path, how: &[String]) -> Option<Self> {
        let within = |path: &PathBuf| {
            let path = path.strip_prefix(folder).ok()?;
            path.to_str().map(PathBuf::from)
        };
        let files = match &pair.files {
            Files::Two(files) => files.iter().map(within).collect::<Option<Vec<_>>>()?,
            Files::One(file, _) => vec![within(file)?],
        };
        let calibration = match &pair.calibration {
            Some(path) => Some(within(path)?),
            None => None,
        };
        Some(Self { name: pair.name.clone(), files, calibration, how: how.to_vec() })
    }

    /// As it waits.
    ///
    /// # Errors
    ///
    /// Never, for what [`Job::new`] makes.
    pub fn to_bytes(&self) -> serde_json::Result<Vec<u8>> {
        serde_json::to_vec(self)
    }

    /// What waited.
    ///
    /// # Errors
    ///
    /// See [`JobError`]: a queue is not trusted to name any file.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, JobError> {
        let job: Self = serde_json::from_slice(bytes)?;
        let paths = job.files.iter().chain(&job.calibration).map(PathBuf::as_path);
        let sound = paths.chain([Path::new(&job.name)]).all(|path| {
            let mut parts = path.components();
            path.file_name().is_some() && parts.all(|part| matches!(part, Component::Normal(_)))
        });
        if sound && matches!(job.files.len(), 1 | 2) { Ok(job) } else { Err(JobError::Outside) }
    }

    /// The pair, in the folder of its batch. `layout` is that of one file.
    #[must_use]
    pub fn pair(&self, folder: &Path, layout: Option<Layout>) -> Pair {
        let within = |path: &PathBuf| folder.join(path);
        let files = match self.files.as_slice() {
            [left, right] => Files::Two([within(left), within(right)]),
            files => Files::One(files.first().map(within).unwrap_or_default(), layout),
        };
        let calibration = self.calibration.as_ref().map(within);
        Pair { name: self.name.clone(), files, calibration }
    }

    /// What it is known by: 128 bits of a sum over its name, its files' contents, and `recipe`, all else that its model
    /// depends on.
    ///
    /// # Errors
    ///
    /// With the file that could not be read.
    pub fn id(&self, folder: &Path, recipe: &str) -> io::Result<String> {
        let mut sum = Sum::default();
        sum.add(self.name.as_bytes());
        sum.add(recipe.as_bytes());
        for path in self.files.iter().chain(&self.calibration) {
            let path = folder.join(path);
            let named =
                |error: io::Error| io::Error::new(error.kind(), format!("cannot read {}", path.display()));
            sum.add(&std::fs::read(&path).map_err(named)?);
        }
        Ok(sum.finish())
    }
}

/// A sum over parts; other parts, or the same bytes parted otherwise, have another.
pub struct Sum(Context);

impl Default for Sum {
    fn default() -> Self {
        Self(Context::new(&SHA256))
    }
}

impl Sum {
    /// Adds a part.
    pub fn add(&mut self, part: &[u8]) {
        self.0.update(&(part.len() as u64).to_le_bytes());
        self.0.update(part);
    }

    /// 128 bits of it, in hexadecimal digits.
    #[must_use]
    pub fn finish(self) -> String {
        self.0.finish().as_ref().iter().take(16).map(|byte| format!("{byte:02x}")).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::damaged::damaged;
    use crate::random::Random;
    use std::fs;

    fn job() -> Job {
        let files = vec!["a/left.png".into(), "a/right.png".into()];
        Job { name: "a".into(), files, calibration: Some("calib.yaml".into()), how: vec!["--swap".into()] }
    }

    #[test]
    fn comes_back_as_it_was() {
        assert_eq!(Job::from_bytes(&job().to_bytes().unwrap()).unwrap(), job());
        let pair = job().pair(Path::new("there"), None);
        assert_eq!(Job::new(&pair, Path::new("there"), &["--swap".to_owned()]), Some(job()));
        assert_eq!(Job::new(&pair, Path::new("elsewhere"), &[]), None);
    }

    #[test]
    fn a_queue_cannot_name_what_lies_outside() {
        for path in ["../b", "/etc/passwd", "a/../../b", "", "."] {
            let named = Job { name: path.into(), ..job() };
            assert!(matches!(Job::from_bytes(&named.to_bytes().unwrap()), Err(JobError::Outside)), "{path}");
            let read = Job { files: vec![path.into()], ..job() };
            assert!(matches!(Job::from_bytes(&read.to_bytes().unwrap()), Err(JobError::Outside)), "{path}");
        }
        assert!(matches!(Job::from_bytes(b"{}"), Err(JobError::Unknown(_))));
    }

    #[test]
    fn whatever_a_queue_holds_is_refused_or_stays_within_the_folder() {
        let (sound, mut random) = (job().to_bytes().unwrap(), Random::new(1));
        let mut read = 0;
        for _ in 0..20_000 {
            let Ok(job) = Job::from_bytes(&damaged(&sound, &mut random)) else { continue };
            let paths = job.files.iter().chain(&job.calibration).filter_map(|path| path.to_str());
            for path in paths.chain([job.name.as_str()]) {
                assert!(!path.starts_with('/') && path.split('/').all(|part| part != ".."), "{path}");
            }
            assert!(matches!(job.files.len(), 1 | 2));
            assert_eq!(Job::from_bytes(&job.to_bytes().unwrap()).unwrap(), job);
            read += 1;
        }
        assert!((1000..19_000).contains(&read), "{read} of 20000 are still pairs");
    }

    #[test]
    fn is_known_by_everything_that_its_model_depends_on() {
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir(folder.path().join("a")).unwrap();
        let write = |name: &str, bytes: &[u8]| fs::write(folder.path().join(name), bytes).unwrap();
        for (name, bytes) in [("a/left.png", b"12"), ("a/right.png", b"34"), ("calib.yaml", b"56")] {
            write(name, bytes);
        }
        let id = |job: &Job, recipe: &str| job.id(folder.path(), recipe).unwrap();
        let first = id(&job(), "r");
        assert_eq!(first.len(), 32);
        assert_eq!(id(&job(), "r"), first);
        assert_ne!(id(&job(), "s"), first);
        assert_ne!(id(&Job { name: "b".into(), ..job() }, "r"), first);
        write("a/left.png", b"123");
        write("a/right.png", b"4");
        assert_ne!(id(&job(), "r"), first, "the same bytes, parted otherwise");
        assert!(job().id(Path::new("nowhere"), "r").unwrap_err().to_string().contains("left.png"));
    }

    /// SHA-256 of 8 bytes of length and "abc", by coreutils' sha256sum.
    #[test]
    fn the_sum_is_the_one_that_it_is_said_to_be() {
        let mut sum = Sum::default();
        sum.add(b"abc");
        assert_eq!(sum.finish(), "ce91dc5eec0139adf091900d225971d6");
    }
}
