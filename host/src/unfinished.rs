//! Files and folders under way. What is written has a hidden name, which nobody takes for a result, until it is whole
//! and is moved to its own; so whoever is killed meanwhile leaves the old file or the new one.
//!
//! A power loss is another matter. Exports ([`Durable`]) and calibrations are on the disk before they get their names,
//! so each is the old file or the new one even then, and a file system that says only when it is asked that it is full
//! has said so. Everything else is left to the system: to wait for the disk takes 16 to 30 ms for the four files of a
//! pair where writing them takes 1 to 2 (ext4). So after a power loss the newest of these may be missing or empty; after
//! a kill they never are.
//!
//! What a killed run leaves under hidden names is swept away by a later one, ten seconds after it was last written to.
//! Whoever writes holds a lock, which the system takes back from the dead. Where it knows no locks, nothing is swept;
//! where it keeps them to one machine (sshfs, NFS with `local_lock`, CIFS with `nobrl`), another machine may sweep what
//! is being written, which its writer is told when it moves it.

use std::ffi::OsStr;
use std::fs::{self, DirEntry, File};
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use tempfile::{Builder, NamedTempFile, TempDir};

/// How hidden names begin.
const PREFIX: &str = ".unfinished-";
/// How they end: nobody else's do.
const SUFFIX: &str = ".ossature";
/// What is younger may not be locked yet.
const AGE: Duration = Duration::from_secs(10);

/// A folder under way; it goes when it is dropped.
pub(crate) struct Folder {
    folder: TempDir,
    /// Held while the folder is.
    _lock: Option<File>,
}

impl Folder {
    /// A new one in another folder, where what killed runs left is swept.
    pub(crate) fn within(folder: &Path) -> io::Result<Self> {
        sweep(folder);
        let folder = builder().tempdir_in(folder)?;
        let lock = File::open(&folder).ok().filter(|lock| lock.try_lock().is_ok());
        Ok(Self { folder, _lock: lock })
    }

    /// Where it is.
    pub(crate) fn path(&self) -> &Path {
        self.folder.path()
    }
}

/// A file under way that is to outlive a power loss; it goes when it is dropped.
pub(crate) struct Durable {
    folder: Folder,
    path: PathBuf,
}

impl Durable {
    /// What is to become the file `path`.
    pub(crate) fn new(path: &Path) -> io::Result<Self> {
        Ok(Self { folder: Folder::within(folder_of(path))?, path: path.into() })
    }

    /// Where it is to be written.
    pub(crate) fn hidden(&self) -> PathBuf {
        self.folder.path().join(self.path.file_name().unwrap_or_default())
    }

    /// Gives it its name once all of it is on the disk.
    pub(crate) fn finish(self) -> io::Result<()> {
        let hidden = self.hidden();
        File::open(&hidden)?.sync_all()?;
        fs::rename(hidden, self.path)
    }
}

/// A new file beside `path`, which can be moved there; it goes when it is dropped.
pub(crate) fn beside(path: &Path) -> io::Result<NamedTempFile> {
    let mut builder = builder();
    // A temporary file is private; a result is as readable as any other file.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let file = builder.tempfile_in(folder_of(path))?;
    // Without a lock it may be swept by mistake, which its move would tell.
    let _ = file.as_file().try_lock();
    Ok(file)
}

/// The folder that a file is in.
pub(crate) fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Removes what killed runs left in a folder, as far as it can be removed.
pub(crate) fn sweep(folder: &Path) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        // Held until it is gone, so that nobody else begins to sweep it.
        let Some(_lock) = abandoned(&entry) else { continue };
        let path = entry.path();
        // What stays does no harm.
        let _ = if path.is_dir() { fs::remove_dir_all(&path) } else { fs::remove_file(&path) };
    }
}

/// Whether this is a hidden name.
pub(crate) fn is_hidden(name: &OsStr) -> bool {
    let name = name.as_encoded_bytes();
    name.starts_with(PREFIX.as_bytes()) && name.ends_with(SUFFIX.as_bytes())
}

/// The lock of what is hidden and old, and on which nobody works any more. Links are not followed, and pipes, which
/// would be waited for, not opened.
fn abandoned(entry: &DirEntry) -> Option<File> {
    let kind = entry.file_type().ok()?;
    if !is_hidden(&entry.file_name()) || !(kind.is_dir() || kind.is_file()) {
        return None;
    }
    let file = File::open(entry.path()).ok()?;
    let age = file.metadata().and_then(|about| about.modified()).ok()?.elapsed().ok()?;
    (age > AGE && file.try_lock().is_ok()).then_some(file)
}

fn builder() -> Builder<'static, 'static> {
    let mut builder = Builder::new();
    builder.prefix(PREFIX).suffix(SUFFIX);
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
        for name in [".unfinished-folder.ossature", ".unfinished-mine"] {
            fs::create_dir(within(name)).unwrap();
            fs::write(within(name).join("model.ply"), "").unwrap();
        }
        for name in [".unfinished-file.ossature", ".unfinished-young.ossature", "model.ply", ".hidden"] {
            fs::write(within(name), "").unwrap();
        }
        for entry in fs::read_dir(parent.path()).unwrap() {
            let entry = entry.unwrap();
            if entry.file_name() != ".unfinished-young.ossature" {
                let long_ago = SystemTime::now() - 2 * AGE;
                File::open(entry.path()).unwrap().set_modified(long_ago).unwrap();
            }
        }
        let mut kept = vec![folder.path().into(), file.path().into()];
        kept.extend([".hidden", ".unfinished-mine", ".unfinished-young.ossature", "model.ply"].map(within));
        #[cfg(unix)]
        {
            let [link, pipe] = ["link", "pipe"].map(|name| within(&format!(".unfinished-{name}.ossature")));
            std::os::unix::fs::symlink(within(".hidden"), &link).unwrap();
            assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
            kept.extend([link, pipe]);
        }
        kept.sort();
        sweep(parent.path());
        let left = fs::read_dir(parent.path()).unwrap().map(|entry| entry.unwrap().path());
        let mut left: Vec<_> = left.collect();
        left.sort();
        assert_eq!(left, kept);
        assert!(within(".unfinished-mine/model.ply").is_file());
        sweep(Path::new("/no/such/folder"));
    }
}
