//! What leaves the program as files.
//!
//! * [`ply`]: meshes (`mesh.ply`), point clouds and curves (`boundary.ply`, `skeleton.ply`) as binary
//!   little-endian PLY, which every mesh viewer reads.
//!
//! Lengths are millimetres in the left camera's axes. A file is written beside its final name and renamed
//! when it is complete, so that nothing half-written ever stands under that name.

pub mod ply;

use std::{
    io::{self, BufWriter, Write},
    path::{Path, PathBuf},
};

use thiserror::Error;

/// Why a file was not written.
#[derive(Debug, Error)]
pub enum ExportError {
    /// The system refused.
    #[error("cannot write {}", path.display())]
    Io {
        /// The final name.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// What is to be written contradicts itself or the format.
    #[error("cannot write {}: {what}", path.display())]
    Content {
        /// The final name.
        path: PathBuf,
        /// The contradiction.
        what: String,
    },
}

/// Creates or replaces the file `path` by what `write` writes, all or nothing.
pub(crate) fn write_whole(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&mut tempfile::NamedTempFile>) -> io::Result<()>,
) -> Result<(), ExportError> {
    let failed = |source| ExportError::Io { path: path.to_path_buf(), source };
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    builder.prefix(".unfinished-");
    // A temporary file is private; an export is as readable as any other file.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut file = builder.tempfile_in(folder).map_err(failed)?;
    let mut buffered = BufWriter::new(&mut file);
    write(&mut buffered).and_then(|()| buffered.flush()).map_err(failed)?;
    drop(buffered);
    file.persist(path).map_err(|error| failed(error.error))?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mesh.ply");
        std::fs::write(&path, "old").unwrap();
        let error = write_whole(&path, |file| {
            file.write_all(b"new")?;
            Err(io::Error::other("full"))
        });
        assert!(error.unwrap_err().to_string().contains("mesh.ply"));
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        write_whole(&path, |file| file.write_all(b"new")).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"new");
    }

    #[test]
    fn a_missing_folder_is_a_sentence_with_the_path() {
        let error = write_whole(Path::new("/no/such/folder/mesh.ply"), |_| Ok(())).unwrap_err();
        assert_eq!(error.to_string(), "cannot write /no/such/folder/mesh.ply");
    }
}
