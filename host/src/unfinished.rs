//! Files and folders under way. What is written has a hidden name, which nobody takes for a result, until it is whole
//! and is moved to its own; so whoever is killed meanwhile leaves the old file or the new one.
//!
//! What a killed run leaves under hidden names is swept away by a later one. Whoever writes holds a lock, which the
//! system takes back from the dead; where it knows no locks, nothing is swept.

use std::fs::{self, File};
use std::io;
use std::path::Path;
use std::time::Duration;

use tempfile::{Builder, NamedTempFile, TempDir};

/// How hidden names begin.
const PREFIX: &str = ".unfinished-";
/// What is younger may not be locked yet.
const AGE: Duration = Duration::from_secs(10);

/// A folder under way; it goes when it is dropped.
pub(crate) struct Folder {
    folder: TempDir,
    /// Held while the folder is.
    _lock: Option<File>,
}

impl Folder {
    /// A new one in another folder.
    pub(crate) fn within(folder: &Path) -> io::Result<Self> {
        let folder = builder().tempdir_in(folder)?;
        let lock = File::open(&folder).ok().filter(|lock| lock.try_lock().is_ok());
        Ok(Self { folder, _lock: lock })
    }

    /// Where it is.
    pub(crate) fn path(&self) -> &Path {
        self.folder.path()
    }
}

/// A new file beside `path`, which can be moved there; it goes when it is dropped.
pub(crate) fn beside(path: &Path) -> io::Result<NamedTempFile> {
    let mut builder = builder();
    // A temporary file is private; a result is as readable as any other file.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let file = builder.tempfile_in(folder_of(path))?;
    // Without a lock it may be swept in vain, which its move would tell.
    let _ = file.as_file().try_lock();
    Ok(file)
}

/// The folder that a file is in.
pub(crate) fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Removes what killed runs left in a folder, as far as it can be removed.
pub(crate) fn sweep(folder: &Path) {
    sweep_older(folder, AGE);
}

/// [`sweep`], of what is older than `age`: nothing, where nobody else begins to write now.
pub(crate) fn sweep_older(folder: &Path, age: Duration) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        let hidden = entry.file_name().as_encoded_bytes().starts_with(PREFIX.as_bytes());
        if !hidden || !is_abandoned(&path, age) {
            continue;
        }
        // What stays does no harm.
        let _ = if path.is_dir() { fs::remove_dir_all(&path) } else { fs::remove_file(&path) };
    }
}

/// Whether it is older than `least`, and nobody works on it any more.
fn is_abandoned(path: &Path, least: Duration) -> bool {
    let Ok(file) = File::open(path) else { return false };
    let age = file.metadata().and_then(|about| about.modified()).map(|modified| modified.elapsed());
    age.is_ok_and(|age| age.is_ok_and(|age| age > least)) && file.try_lock().is_ok()
}

fn builder() -> Builder<'static, 'static> {
    let mut builder = Builder::new();
    builder.prefix(PREFIX);
    builder
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::SystemTime;

    #[test]
    fn what_the_dead_left_is_swept_and_nothing_else() {
        let parent = tempfile::tempdir().unwrap();
        let within = |name: &str| parent.path().join(name);
        let (folder, file) = (Folder::within(parent.path()).unwrap(), beside(&within("model.ply")).unwrap());
        fs::create_dir(within(".unfinished-folder")).unwrap();
        for name in
            [".unfinished-folder/model.ply", ".unfinished-file", ".unfinished-young", "model.ply", ".hidden"]
        {
            fs::write(within(name), "").unwrap();
        }
        for entry in fs::read_dir(parent.path()).unwrap() {
            let entry = entry.unwrap();
            if entry.file_name() != ".unfinished-young" {
                let long_ago = SystemTime::now() - 2 * AGE;
                File::open(entry.path()).unwrap().set_modified(long_ago).unwrap();
            }
        }
        sweep(parent.path());
        let left = fs::read_dir(parent.path()).unwrap().map(|entry| entry.unwrap().path());
        let mut left: Vec<_> = left.collect();
        left.sort();
        let name = |name| within(name);
        let mut kept = vec![folder.path().into(), file.path().into()];
        kept.extend([".hidden", ".unfinished-young", "model.ply"].map(name));
        kept.sort();
        assert_eq!(left, kept);
        sweep(Path::new("/no/such/folder"));
    }
}
