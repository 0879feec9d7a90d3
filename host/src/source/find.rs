//! From what a user names to pairs of files.
//!
//! | named | pairs |
//! |---|---|
//! | two files | left, right |
//! | one file | both views in it |
//! | folders, patterns, more files | every file whose name says left and whose partner exists |
//!
//! How names say left and right is in `names.rs`. With a layout of one file a pair, every image is a pair.
//!
//! Pairs come in the order of their paths. Results may lie among the input, even beside the pair that they
//! come from: the pictures that a result holds are no input. Hidden folders are passed over.

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsStr;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::names::{Partner, eye, name, partner};
use super::{Files, Layout, Pair};
use crate::output::{PICTURES, is_result};

/// Folders below the one named that are looked into.
const MAX_DEPTH: usize = 5;
/// Names of a calibration beside the images, the first that exists counts.
const CALIBRATIONS: [&str; 3] = ["calib.yaml", "calib.yml", "camchain.yaml"];
/// Extensions of images.
const IMAGES: [&str; 9] = ["png", "jpg", "jpeg", "pgm", "ppm", "pnm", "bmp", "tif", "tiff"];

/// Why there are no pairs.
#[derive(Debug, thiserror::Error)]
pub enum FindError {
    /// Nothing is there.
    #[error("there is no file or folder {}", path.display())]
    Missing {
        /// What was named.
        path: PathBuf,
    },
    /// Not a pattern.
    #[error("{pattern} is no pattern; * and ? stand for what may differ")]
    Pattern {
        /// What was named.
        pattern: String,
        /// What is wrong.
        source: glob::PatternError,
    },
    /// A folder could not be listed.
    #[error("cannot list {}", path.display())]
    Unlisted {
        /// The folder.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// No two images belong together.
    #[error(
        "none of the {images} images in {named} has a partner; name them left_0001 and right_0001, im0 and im1, or \
         cam0/data and cam1/data, or give --layout side-by-side or top-bottom if each holds both views"
    )]
    NoPairs {
        /// What was named.
        named: String,
        /// Images that are there.
        images: usize,
    },
    /// There is nothing to look through.
    #[error("there are no images in {named}; PNG, JPEG, PGM, BMP and TIFF are looked for by their names")]
    NoImages {
        /// What was named.
        named: String,
    },
    /// Two files of one eye, as a shell makes them of a pattern.
    #[error(
        "{} and {} are both named {eye}; give LEFT RIGHT, or put a pattern in quotes so that the shell leaves it as it is",
        first.display(), second.display()
    )]
    SameEye {
        /// The file named first.
        first: PathBuf,
        /// The file named second.
        second: PathBuf,
        /// What both are named.
        eye: &'static str,
    },
    /// One file cannot be two.
    #[error("{} is one image, but --layout two needs two: give left and right", path.display())]
    OneOfTwo {
        /// The file.
        path: PathBuf,
    },
}

/// What was found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Found {
    /// The pairs, in the order of their paths.
    pub pairs: Vec<Pair>,
    /// Images whose partner is missing.
    pub alone: Vec<PathBuf>,
    /// Whether the user named the files of one pair, and no folder or pattern.
    pub single: bool,
}

/// The pairs that `inputs` name.
///
/// # Errors
///
/// See [`FindError`].
pub fn find(inputs: &[String], layout: Option<Layout>) -> Result<Found, FindError> {
    let files: Vec<PathBuf> = inputs.iter().map(PathBuf::from).collect();
    let one_file = layout.is_some_and(|layout| layout != Layout::Two);
    let named = match files.as_slice() {
        [left, right] if left.is_file() && right.is_file() && !one_file => {
            check_eyes(left, right)?;
            Some(Files::Two([left.clone(), right.clone()]))
        }
        [path] if path.is_file() && layout == Some(Layout::Two) => {
            return Err(FindError::OneOfTwo { path: path.clone() });
        }
        [path] if path.is_file() => Some(Files::One(path.clone(), layout)),
        _ => None,
    };
    if let Some(files) = named {
        let (Files::Two([first, _]) | Files::One(first, _)) = &files;
        let calibration = calibration_beside(first, Path::new(""));
        let root = first.parent().and_then(Path::parent).unwrap_or(Path::new(""));
        let name = name(first, root, matches!(files, Files::Two(_)));
        return Ok(Found { pairs: vec![Pair { name, files, calibration }], alone: Vec::new(), single: true });
    }
    search(inputs, layout.filter(|_| one_file))
}

/// Whether two files can be the two eyes of a pair, as far as their names say.
fn check_eyes(first: &Path, second: &Path) -> Result<(), FindError> {
    match (eye(first), eye(second)) {
        (Some(one), Some(other)) if one == other => Err(FindError::SameEye {
            first: first.into(),
            second: second.into(),
            eye: if one == 0 { "left" } else { "right" },
        }),
        _ => Ok(()),
    }
}

/// An image, and the folder that the user named above it.
type Candidate = (PathBuf, PathBuf);

fn search(inputs: &[String], layout: Option<Layout>) -> Result<Found, FindError> {
    let mut candidates = Vec::new();
    for input in inputs {
        for path in expand(input)? {
            if path.is_dir() {
                list(&path, &path, 0, &mut candidates)?;
            } else {
                let root = path.parent().and_then(Path::parent).unwrap_or(Path::new("")).to_path_buf();
                candidates.push((path, root));
            }
        }
    }
    // Names that differ in case alone may claim one partner: who gets it must not depend on the file system.
    candidates.sort();
    let mut found = BTreeMap::new();
    let mut alone = Vec::new();
    for (path, root) in &candidates {
        let files = match layout {
            Some(layout) => Some(Files::One(path.clone(), Some(layout))),
            None => match partner(path) {
                Partner::None => None,
                Partner::Missing => {
                    alone.push(path.clone());
                    None
                }
                Partner::Pair(pair) => Some(Files::Two(pair)),
            },
        };
        if let Some(files) = files {
            let (Files::Two([first, _]) | Files::One(first, _)) = &files;
            let name = name(first, root, layout.is_none());
            let calibration = calibration_beside(first, root);
            found.insert(first.clone(), Pair { name, files, calibration });
        }
    }
    if candidates.is_empty() {
        return Err(FindError::NoImages { named: inputs.join(" ") });
    }
    if found.is_empty() {
        return Err(FindError::NoPairs { named: inputs.join(" "), images: candidates.len() });
    }
    alone.sort();
    Ok(Found { pairs: with_own_names(found.into_values().collect()), alone, single: false })
}

/// A path that exists, or those that match it as a pattern.
fn expand(input: &str) -> Result<Vec<PathBuf>, FindError> {
    let path = PathBuf::from(input);
    if path.exists() {
        return Ok(vec![path]);
    }
    let matches = glob::glob(input).map_err(|source| FindError::Pattern { pattern: input.into(), source })?;
    // What cannot be read below a pattern is no match.
    let paths: Vec<PathBuf> = matches.filter_map(Result::ok).filter(|p| p.is_dir() || is_image(p)).collect();
    if paths.is_empty() { Err(FindError::Missing { path }) } else { Ok(paths) }
}

/// Adds the images in and below a folder.
fn list(folder: &Path, root: &Path, depth: usize, into: &mut Vec<Candidate>) -> Result<(), FindError> {
    let unlisted = |source| FindError::Unlisted { path: folder.into(), source };
    let is_result = is_result(folder);
    for entry in fs::read_dir(folder).map_err(unlisted)? {
        let path = entry.map_err(unlisted)?.path();
        let hidden = path.file_name().is_some_and(|name| name.as_encoded_bytes().starts_with(b"."));
        if path.is_dir() {
            let drawn = is_result && path.ends_with(PICTURES);
            if depth < MAX_DEPTH && !hidden && !drawn {
                list(&path, root, depth + 1, into)?;
            }
        } else if !hidden && is_image(&path) {
            into.push((path, root.into()));
        }
    }
    Ok(())
}

fn is_image(path: &Path) -> bool {
    let extension = path.extension().and_then(OsStr::to_str).map(str::to_ascii_lowercase);
    extension.is_some_and(|extension| IMAGES.contains(&extension.as_str()))
}

/// Numbers the names that occur again.
fn with_own_names(mut pairs: Vec<Pair>) -> Vec<Pair> {
    let mut used = BTreeSet::new();
    for pair in &mut pairs {
        let plain = pair.name.clone();
        let mut count = 1;
        while !used.insert(pair.name.clone()) {
            count += 1;
            pair.name = format!("{plain}-{count}");
        }
    }
    pairs
}

/// A calibration in the image's folder, or in one above it up to `root`.
fn calibration_beside(image: &Path, root: &Path) -> Option<PathBuf> {
    let folder = image.parent()?;
    let within = |above: &Path| !root.as_os_str().is_empty() && above.starts_with(root);
    folder
        .ancestors()
        .take_while(|above| *above == folder || within(above))
        .find_map(|above| CALIBRATIONS.iter().map(|name| above.join(name)).find(|path| path.is_file()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(files: &[&str]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for file in files {
            let path = folder.path().join(file);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, "").unwrap();
        }
        folder
    }

    /// Names, left and right files of the pairs, and how many images are alone.
    fn found(files: &[&str]) -> (Vec<[String; 3]>, usize) {
        let folder = folder(files);
        let root = folder.path();
        let got = find(&[root.display().to_string()], None).unwrap();
        let short = |path: &Path| path.strip_prefix(root).unwrap().display().to_string();
        let row = |pair: &Pair| match &pair.files {
            Files::Two([left, right]) => [pair.name.clone(), short(left), short(right)],
            Files::One(..) => panic!("two files each"),
        };
        (got.pairs.iter().map(row).collect(), got.alone.len())
    }

    #[test]
    fn the_usual_names_are_paired() {
        let pairs = |files: &[&str]| found(files).0.concat().join(" ");
        assert_eq!(
            pairs(&["cam0/data/17.png", "cam1/data/17.png", "cam0/sensor.yaml"]),
            "17 cam0/data/17.png cam1/data/17.png"
        );
        assert_eq!(pairs(&["bike/im0.png", "bike/im1.png"]), "bike bike/im0.png bike/im1.png");
        assert_eq!(
            pairs(&["left_0002.pgm", "right_0002.pgm", "left01.pgm", "right01.pgm"]),
            "01 left01.pgm right01.pgm 0002 left_0002.pgm right_0002.pgm"
        );
        assert_eq!(pairs(&["left/a.png", "right/a.png"]), "a left/a.png right/a.png");
        assert_eq!(pairs(&["left/left1.png", "right/right1.png"]), "1 left/left1.png right/right1.png");
        assert_eq!(pairs(&["cup_left.jpg", "cup_right.jpg"]), "cup cup_left.jpg cup_right.jpg");
        assert_eq!(pairs(&["cup/left.png", "cup/right.png"]), "cup cup/left.png cup/right.png");
    }

    #[test]
    fn images_without_partner_are_counted_and_others_ignored() {
        let (pairs, alone) = found(&["left_1.png", "right_1.png", "left_2.png", "leftover.png", "im01.png"]);
        assert_eq!((pairs.len(), alone), (1, 1));
    }

    #[test]
    fn results_and_hidden_folders_are_no_input_but_the_pairs_beside_results_are() {
        let files = [
            "left.png",
            "right.png",
            "model.ply",
            "report.json",
            "pictures/left.png",
            "pictures/right.png",
            "demo/left.png",
            "demo/right.png",
            "demo/model.ply",
            "demo/report.json",
            "demo/pictures/left_1.png",
            "demo/pictures/right_1.png",
            "out/model.ply",
            "out/report.json",
            "out/pictures/1-mask.png",
            ".x/im0.png",
            ".x/im1.png",
        ];
        let (pairs, alone) = found(&files);
        let lefts: Vec<_> = pairs.iter().map(|[_, left, _]| left.as_str()).collect();
        assert_eq!((lefts, alone), (vec!["demo/left.png", "left.png"], 0));
        assert_eq!(found(&["pictures/left.png", "pictures/right.png"]).0.len(), 1);
    }

    #[test]
    fn case_makes_no_difference() {
        let pairs = |files: &[&str]| found(files).0.concat().join(" ");
        assert_eq!(pairs(&["a/left.png", "a/Right.png"]), "a a/left.png a/Right.png");
        assert_eq!(pairs(&["LEFT_1.JPG", "right_1.jpg"]), "1 LEFT_1.JPG right_1.jpg");
        assert_eq!(pairs(&["Left/1.png", "right/1.PNG"]), "1 Left/1.png right/1.PNG");
        assert_eq!(pairs(&["left.png", "Right.png", "right.png"]).matches("left.png right.png").count(), 1);
    }

    #[test]
    fn two_files_of_one_eye_are_no_pair() {
        let folder =
            folder(&["a/left.png", "b/left.png", "cam0/data/1.png", "cam0/data/2.png", "cam1/data/1.png"]);
        let told = |files: [&str; 2]| {
            let inputs = files.map(|file| folder.path().join(file).display().to_string());
            find(&inputs, None).map_err(|error| error.to_string())
        };
        let error = told(["a/left.png", "b/left.png"]).unwrap_err();
        assert!(error.contains("both named left") && error.contains("quotes"), "{error}");
        assert!(told(["a/left.png", "cam0/data/1.png"]).is_err());
        assert!(told(["a/left.png", "cam1/data/1.png"]).is_ok());
        assert!(told(["a/left.png", "cam0/data/2.png"]).is_ok());
    }

    #[test]
    fn the_nearest_calibration_counts() {
        let folder =
            folder(&["calib.yaml", "a/left.png", "a/right.png", "b/left.png", "b/right.png", "b/calib.yml"]);
        let got = find(&[folder.path().display().to_string()], None).unwrap();
        let calibrations: Vec<_> = got.pairs.iter().map(|pair| pair.calibration.clone().unwrap()).collect();
        assert_eq!(calibrations, ["calib.yaml", "b/calib.yml"].map(|name| folder.path().join(name)));
    }

    #[test]
    fn patterns_find_partners_and_case_folders() {
        let folder = folder(&["a/left.png", "a/right.png", "b/left.png", "b/right.png"]);
        for pattern in ["*/left.png", "*", "*/*.png"] {
            let pattern = folder.path().join(pattern).display().to_string();
            let got = find(&[pattern], None).unwrap();
            assert_eq!(got.pairs.len(), 2);
        }
    }

    #[test]
    fn names_are_used_once() {
        let folders = [folder(&["left_1.png", "right_1.png"]), folder(&["left_1.png", "right_1.png"])];
        let inputs = folders.each_ref().map(|folder| folder.path().display().to_string());
        let names: Vec<_> = find(&inputs, None).unwrap().pairs.into_iter().map(|pair| pair.name).collect();
        assert_eq!(names, ["1", "1-2"]);
    }

    #[test]
    fn nothing_found_says_how_to_name_files() {
        let folder = folder(&["a.png", "b.png"]);
        let error = find(&[folder.path().display().to_string()], None).unwrap_err().to_string();
        assert!(error.contains("none of the 2 images") && error.contains("--layout"), "{error}");
        let all = find(&[folder.path().display().to_string()], Some(Layout::TopBottom)).unwrap();
        assert_eq!(all.pairs.len(), 2);
        assert!(matches!(find(&["/no/such".into()], None), Err(FindError::Missing { .. })));
    }
}
