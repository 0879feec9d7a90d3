//! The folder that a reconstruction leaves.
//!
//! | file | what |
//! |---|---|
//! | `model.ply` | the solid's closed surface, with `confidence` where its front was measured |
//! | `skeleton.ply` | its curve skeleton: points with `radius`, mm, and edges |
//! | `boundary.ply` | its boundary as seen from the left: points and edges |
//! | `report.json` | every figure ([`crate::report::numbers`]) |
//! | `report.html` | all of it to look at, in one page ([`Content`]), if that was asked for |
//! | `pictures/*.png` | a picture a stage ([`pictures::NAMES`]), if the record kept rasters |
//!
//! Lengths are millimetres in the left camera's axes. Everything is made in a temporary folder inside the
//! target and moved only when all of it is complete; when something fails before that, the target is left
//! as it was. Files are moved one after the other: if the system refuses one of these moves, or the run is killed
//! between them, those before it are new and the rest old. The disk is not waited for, so after a power loss the newest
//! files may be missing or empty (`host/src/unfinished.rs`). A page and pictures of an earlier run that this one did
//! not make are removed, so that a folder speaks of one run, and all of them when a pair is refused (`clear`); files
//! of other names are not touched.

use crate::export::ExportError;
use crate::export::ply;
use crate::reconstruct::Reconstruction;
use crate::report::page::{self, Content};
use crate::report::{Refused, Run, numbers, pictures};
use crate::unfinished::{self, sweep};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{GrayImage, RgbImage};
use rayon::prelude::*;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;

/// Sub-folder of the pictures.
pub(crate) const PICTURES: &str = "pictures";
/// Every figure.
const REPORT: &str = "report.json";
/// The page.
const PAGE: &str = "report.html";
/// What surfaces and curves say of themselves.
const COMMENTS: [&str; 3] = ["Ossature", "unit mm", "axes of the left camera: x right, y down, z forward"];
/// Bytes of a page among which its mark is.
const HEAD: u64 = 1024;

/// What is known at each vertex of a surface.
fn known(made: &Reconstruction) -> Option<(&'static str, &[f64])> {
    made.front.as_ref().map(|front| ("confidence", &front.confidence[..]))
}

/// The bytes of `model.ply`.
#[must_use]
pub fn surface(made: &Reconstruction) -> Vec<u8> {
    let mut bytes = Vec::new();
    // There is always room in memory.
    let _ = ply::mesh_into(&mut bytes, &made.mesh, known(made).as_slice(), &COMMENTS);
    bytes
}

/// Write all files of a run into `folder`, which is created if it is missing, and a page if that is wanted;
/// returns the report's text.
///
/// # Errors
/// [`ExportError`] with the file or folder that could not be written.
pub fn write(folder: &Path, run: &Run<'_>, page: bool) -> Result<Vec<u8>, ExportError> {
    let created = create(folder)?;
    let result = write_into(folder, run, page);
    if result.is_err() {
        for folder in created.iter().rev() {
            // What still holds files stays: then it is no longer ours alone.
            let _ = std::fs::remove_dir(folder);
        }
    }
    result
}

/// Write the page of a refused pair into `folder`, which is created if it is missing; returns the page's path.
///
/// # Errors
/// As [`write()`].
pub fn write_refused(folder: &Path, refused: &Refused<'_>) -> Result<PathBuf, ExportError> {
    create(folder)?;
    sweep(folder);
    let path = folder.join(PAGE);
    write_together(&[(&path, Content::refused(refused, &title(folder)).html().into_bytes())])?;
    Ok(path)
}

/// What a page about a folder is called.
fn title(folder: &Path) -> String {
    folder.file_name().map_or("Ossature".into(), |name| name.to_string_lossy().into_owned())
}

/// Whether a folder holds what a run left.
pub(crate) fn is_result(folder: &Path) -> bool {
    ["model.ply", REPORT].iter().all(|name| folder.join(name).is_file())
}

/// Removes what an earlier run left in a folder, last the two files by which that is known, and the folder if nothing
/// else is in it: a pair that is refused has no model, and its folder shows none.
pub(crate) fn clear(folder: &Path) -> Result<(), ExportError> {
    let page = is_ours(&folder.join(PAGE)).then(|| PathBuf::from(PAGE));
    let results = is_result(folder).then(|| {
        let pictures = pictures::NAMES.iter().map(|name| Path::new(PICTURES).join(name));
        pictures.chain(["skeleton.ply", "boundary.ply", "model.ply", REPORT].map(PathBuf::from))
    });
    for name in page.into_iter().chain(results.into_iter().flatten()) {
        let path = folder.join(name);
        if path.is_file() {
            std::fs::remove_file(&path).map_err(|source| failed(&path, source))?;
        }
    }
    sweep(folder);
    for folder in [&folder.join(PICTURES), folder] {
        // What still holds files stays.
        let _ = std::fs::remove_dir(folder);
    }
    Ok(())
}

/// Creates or replaces files, whose folders exist. All are complete beside their final names before the
/// first is moved there.
pub(crate) fn write_together(files: &[(&Path, Vec<u8>)]) -> Result<(), ExportError> {
    let staged = files.iter().map(|(path, bytes)| beside(path, bytes).map_err(|source| failed(path, source)));
    let staged = staged.collect::<Result<Vec<_>, _>>()?;
    for ((path, _), file) in files.iter().zip(staged) {
        file.persist(path).map_err(|error| failed(path, error.error))?;
    }
    Ok(())
}

/// A file beside `path` that can be moved there.
pub(crate) fn beside(path: &Path, bytes: &[u8]) -> io::Result<NamedTempFile> {
    if path.exists() && !path.is_file() {
        return Err(io::Error::other("what has that name is no file"));
    }
    let mut file = unfinished::beside(path)?;
    file.write_all(bytes)?;
    Ok(file)
}

/// Create a folder and its parents; returns those that were missing, outermost first.
fn create(folder: &Path) -> Result<Vec<PathBuf>, ExportError> {
    let missing = |f: &&Path| !f.as_os_str().is_empty() && !f.exists();
    let mut created: Vec<PathBuf> = folder.ancestors().take_while(missing).map(Path::to_path_buf).collect();
    created.reverse();
    std::fs::create_dir_all(folder).map_err(|source| failed(folder, source))?;
    Ok(created)
}

fn failed(path: &Path, source: io::Error) -> ExportError {
    ExportError::Io { path: path.to_path_buf(), source }
}

fn write_into(folder: &Path, run: &Run<'_>, page: bool) -> Result<Vec<u8>, ExportError> {
    let staged = unfinished::Folder::within(folder).map_err(|source| failed(folder, source))?;
    let stage = Stage { folder, staged: staged.path() };
    let mut names = stage.models(run.reconstruction)?;
    // Only a mesh that could be written is sound enough to be measured.
    let report = numbers::json(run);
    names.push(stage.bytes(REPORT, &report)?);
    if page {
        let title = title(folder);
        names.push(stage.bytes(PAGE, Content::of(run, &report, &title).html().as_bytes())?);
    }
    let drawn = pictures::draw(run);
    if !drawn.is_empty() {
        let pictures = stage.staged.join(PICTURES);
        std::fs::create_dir(&pictures).map_err(|source| failed(&folder.join(PICTURES), source))?;
    }
    let pictures =
        drawn.par_iter().map(|(name, picture)| stage.picture(&format!("{PICTURES}/{name}"), picture));
    names.extend(pictures.collect::<Result<Vec<_>, _>>()?);
    stage.finish(&names)?;
    Ok(report)
}

/// Files on their way into a folder.
struct Stage<'a> {
    folder: &'a Path,
    staged: &'a Path,
}

impl Stage<'_> {
    /// The surface, the skeleton and the boundary.
    fn models(&self, made: &Reconstruction) -> Result<Vec<String>, ExportError> {
        let known = known(made);
        self.named("model.ply", |path| ply::write_known_mesh(path, &made.mesh, known.as_slice(), &COMMENTS))?;
        for (name, curves) in [("skeleton.ply", &made.skeleton), ("boundary.ply", &made.boundary)] {
            self.named(name, |path| ply::write_curves(path, curves, &COMMENTS))?;
        }
        Ok(["model.ply", "skeleton.ply", "boundary.ply"].map(String::from).to_vec())
    }

    /// Writes under the temporary path, and names the final one when that fails.
    fn named(
        &self,
        name: &str,
        write: impl FnOnce(&Path) -> Result<(), ExportError>,
    ) -> Result<(), ExportError> {
        write(&self.staged.join(name)).map_err(|error| error.of(&self.folder.join(name)))
    }

    fn bytes(&self, name: &str, bytes: &[u8]) -> Result<String, ExportError> {
        let written = std::fs::write(self.staged.join(name), bytes);
        written.map_err(|source| failed(&self.folder.join(name), source))?;
        Ok(name.to_owned())
    }

    fn picture(&self, name: &str, picture: &RgbImage) -> Result<String, ExportError> {
        let bytes = png(picture).map_err(|error| failed(&self.folder.join(name), error))?;
        self.bytes(name, &bytes)
    }

    /// Moves the files to their final names, and removes a page and pictures that are no longer true.
    fn finish(&self, names: &[String]) -> Result<(), ExportError> {
        for name in names {
            let path = self.folder.join(name);
            if path.is_dir() {
                return Err(failed(&path, io::Error::other("a folder of that name is in the way")));
            }
        }
        let pictures = self.folder.join(PICTURES);
        if self.staged.join(PICTURES).exists() {
            std::fs::create_dir_all(&pictures).map_err(|source| failed(&pictures, source))?;
        }
        for name in names {
            let path = self.folder.join(name);
            std::fs::rename(self.staged.join(name), &path).map_err(|source| failed(&path, source))?;
        }
        let drawn = pictures::NAMES.iter().map(|name| format!("{PICTURES}/{name}"));
        let page = is_ours(&self.folder.join(PAGE)).then(|| PAGE.to_owned());
        for name in drawn.chain(page) {
            let path = self.folder.join(&name);
            if !names.contains(&name) && path.is_file() {
                std::fs::remove_file(&path).map_err(|source| failed(&path, source))?;
            }
        }
        Ok(())
    }
}

/// Whether a page says at its head that this program made it.
fn is_ours(page: &Path) -> bool {
    let mut head = Vec::new();
    let read = std::fs::File::open(page).and_then(|file| file.take(HEAD).read_to_end(&mut head));
    read.is_ok() && String::from_utf8_lossy(&head).contains(page::MARK)
}

/// A drawn picture as a file. Flat colours compress well enough at the least effort, which is several
/// times as fast.
pub(crate) fn png(picture: &RgbImage) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let encoder = PngEncoder::new_with_quality(&mut bytes, CompressionType::Fast, FilterType::Up);
    picture.write_with_encoder(encoder).map_err(io::Error::other)?;
    Ok(bytes)
}

/// A grey picture as a file.
pub(crate) fn grey_png(picture: &GrayImage) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    picture.write_with_encoder(PngEncoder::new(&mut bytes)).map_err(io::Error::other)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reconstruct::Mode;
    use crate::report::fixture::Capsule;
    use crate::report::record::Record;
    use std::fs;

    fn names(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name());
        let mut names: Vec<_> = entries.map(|name| name.into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn a_folder_speaks_of_one_run() {
        let parent = tempfile::tempdir().unwrap();
        let folder = parent.path().join("new/model");
        write(&folder, &Capsule::new(Mode::Default, Record::new()).run(), true).unwrap();
        let files = ["boundary.ply", "model.ply", "pictures", "report.html", "report.json", "skeleton.ply"];
        assert_eq!(names(&folder), files);
        assert_eq!(names(&folder.join(PICTURES)), pictures::NAMES);
        fs::write(folder.join("pictures/mine.png"), "kept").unwrap();
        let foreign = parent.path().join("foreign");
        fs::create_dir(&foreign).unwrap();
        fs::write(foreign.join(PAGE), "kept").unwrap();
        let stale = parent.path().join("stale");
        fs::create_dir(&stale).unwrap();
        fs::copy(folder.join(PAGE), stale.join(PAGE)).unwrap();
        write(&stale, &Capsule::new(Mode::Default, Record::figures_only()).run(), false).unwrap();
        assert!(!stale.join(PAGE).exists(), "a page of ours, such as a refused pair's, goes");
        write(&foreign, &Capsule::new(Mode::Default, Record::figures_only()).run(), false).unwrap();
        assert_eq!(fs::read(foreign.join(PAGE)).unwrap(), b"kept");
        write(&folder, &Capsule::new(Mode::Default, Record::figures_only()).run(), false).unwrap();
        assert_eq!(
            names(&folder),
            files.iter().filter(|f| **f != "report.html").copied().collect::<Vec<_>>()
        );
        assert_eq!(names(&folder.join(PICTURES)), ["mine.png"]);
    }

    #[test]
    fn what_a_run_left_is_cleared_by_name() {
        let parent = tempfile::tempdir().unwrap();
        let folder = parent.path().join("model");
        write(&folder, &Capsule::new(Mode::Default, Record::new()).run(), true).unwrap();
        fs::write(folder.join("pictures/mine.png"), "kept").unwrap();
        clear(&folder).unwrap();
        assert_eq!(
            (names(&folder), names(&folder.join(PICTURES))),
            (vec![PICTURES.into()], vec!["mine.png".into()])
        );
        fs::remove_dir_all(&folder).unwrap();
        write(&folder, &Capsule::new(Mode::Default, Record::figures_only()).run(), false).unwrap();
        clear(&folder).unwrap();
        clear(&folder).unwrap();
        fs::write(parent.path().join("model.ply"), "somebody's").unwrap();
        clear(parent.path()).unwrap();
        assert_eq!(names(parent.path()), ["model.ply"]);
    }

    #[test]
    fn files_come_together_or_not_at_all() {
        let parent = tempfile::tempdir().unwrap();
        let (first, second) = (parent.path().join("a"), parent.path().join("none/b"));
        fs::write(&first, "old").unwrap();
        let files = |second| [(first.as_path(), b"new".to_vec()), (second, b"new".to_vec())];
        for second in [&second, parent.path()] {
            let error = write_together(&files(second)).unwrap_err().to_string();
            assert!(error.contains(second.to_str().unwrap()), "{error}");
            assert_eq!(
                (names(parent.path()), fs::read(&first).unwrap()),
                (vec!["a".into()], b"old".to_vec())
            );
        }
        write_together(&files(&parent.path().join("b"))).unwrap();
        assert_eq!(names(parent.path()), ["a", "b"]);
        assert_eq!(fs::read(&first).unwrap(), b"new");
    }

    #[test]
    fn a_failure_leaves_the_folder_as_it_was_and_names_the_path() {
        let parent = tempfile::tempdir().unwrap();
        let capsule = Capsule::new(Mode::Default, Record::figures_only());
        fs::create_dir(parent.path().join("report.json")).unwrap();
        fs::write(parent.path().join("model.ply"), "old").unwrap();
        let error = write(parent.path(), &capsule.run(), false).unwrap_err();
        assert!(error.to_string().ends_with("report.json"), "{error}");
        assert_eq!(names(parent.path()), ["model.ply", "report.json"]);
        assert_eq!(fs::read(parent.path().join("model.ply")).unwrap(), b"old");
    }

    #[test]
    fn a_folder_that_cannot_be_is_named_and_nothing_is_left() {
        let parent = tempfile::tempdir().unwrap();
        let mut capsule = Capsule::new(Mode::Default, Record::figures_only());
        fs::write(parent.path().join("file"), "").unwrap();
        let error = write(&parent.path().join("file/models"), &capsule.run(), false).unwrap_err();
        assert!(error.to_string().ends_with("file/models"), "{error}");
        capsule.made.mesh.faces.push([u32::MAX; 3]);
        assert!(write(&parent.path().join("a/b"), &capsule.run(), false).is_err());
        assert_eq!(names(parent.path()), ["file"]);
    }
}
