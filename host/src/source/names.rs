//! Which files belong together, by their names.
//!
//! A name says left or right by `left`/`right` (`left_0007`, `0007_left`, `left07`), by `im0`/`im1`
//! (Middlebury), or by its folder: `left`/`right`, or `cam0/data`/`cam1/data` (EuRoC, where names are time
//! stamps and partners have the same one). Upper and lower case are the same.

use std::ffi::OsStr;
use std::fs;
use std::path::{Component, Path, PathBuf};

/// Words for the two eyes.
const EYES: [[&str; 2]; 3] = [["left", "right"], ["im0", "im1"], ["cam0", "cam1"]];

/// What goes with an image.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Partner {
    /// Its name says neither left nor right.
    None,
    /// The other eye's file is not there.
    Missing,
    /// Left and right.
    Pair([PathBuf; 2]),
}

/// The pair that an image belongs to.
pub(super) fn partner(path: &Path) -> Partner {
    let by_file = mirrored_file(path);
    let by_folder = mirrored_folder(path);
    let by_both = by_file.as_ref().and_then(|(eye, other)| {
        let (of_folder, both) = mirrored_folder(other)?;
        (*eye == of_folder).then_some((*eye, both))
    });
    let candidates = [by_file, by_both, by_folder];
    let mut any = false;
    for (eye, other) in candidates.into_iter().flatten() {
        any = true;
        if let Some(other) = in_any_case(&other).filter(|other| other.is_file()) {
            let pair = if eye == 0 { [path.into(), other] } else { [other, path.into()] };
            return Partner::Pair(pair);
        }
    }
    if any { Partner::Missing } else { Partner::None }
}

/// The eye that a file is named after; its folder's name counts if there is a partner in the other eye's.
pub(super) fn eye(path: &Path) -> Option<usize> {
    let by_folder = || match partner(path) {
        Partner::Pair([left, _]) => Some(usize::from(left != path)),
        Partner::None | Partner::Missing => None,
    };
    mirrored_file(path).map(|(eye, _)| eye).or_else(by_folder)
}

/// What exists by this path, or by one that differs from it in case alone.
fn in_any_case(path: &Path) -> Option<PathBuf> {
    if path.exists() {
        return Some(path.into());
    }
    let name = path.file_name()?;
    let folder = match path.parent()? {
        folder if folder.as_os_str().is_empty() => Path::new(".").into(),
        folder => in_any_case(folder)?,
    };
    let names = fs::read_dir(&folder).ok()?.filter_map(|entry| Some(entry.ok()?.file_name()));
    // The first in order: listings have none.
    let found = names.filter(|other| other.eq_ignore_ascii_case(name)).min()?;
    Some(if path.parent() == Some(Path::new("")) { found.into() } else { folder.join(found) })
}

/// Which eye a file's name says it is, and the path of the other eye's file.
fn mirrored_file(path: &Path) -> Option<(usize, PathBuf)> {
    let stem = path.file_stem()?.to_str()?;
    let (eye, before, after) = eye_in(stem)?;
    let word = &stem[before.len()..stem.len() - after.len()];
    let extension = path.extension()?.to_str()?;
    Some((eye, path.with_file_name(format!("{before}{}{after}.{extension}", opposite(word)?))))
}

/// Which eye a file's folder says it is, or the one around a folder `data`, and the other eye's path.
fn mirrored_folder(path: &Path) -> Option<(usize, PathBuf)> {
    let folder = path.parent()?;
    let inner = if folder.file_name()? == "data" { folder.parent()? } else { folder };
    let word = inner.file_name()?.to_str()?;
    let (eye, "", "") = eye_in(word)? else { return None };
    let rest = path.strip_prefix(inner).ok()?;
    Some((eye, inner.with_file_name(opposite(word)?).join(rest)))
}

/// The eye that a name speaks of, and what stands before and after the word.
fn eye_in(name: &str) -> Option<(usize, &str, &str)> {
    EYES.iter().flat_map(|words| words.iter().enumerate()).find_map(|(eye, word)| {
        if name.eq_ignore_ascii_case(word) {
            return Some((eye, "", ""));
        }
        // `left01`, `left_scene`, `scene_left`: apart from other letters, and `im0` from other digits.
        let apart = |c: Option<char>| c.is_none_or(|c| matches!(c, '_' | '-' | '.' | ' '));
        let ends_in_digit = word.ends_with(|c: char| c.is_ascii_digit());
        if let Some(after) = without_head(name, word)
            && (apart(after.chars().next())
                || !ends_in_digit && after.bytes().all(|byte| byte.is_ascii_digit()))
        {
            return Some((eye, "", after));
        }
        let before = without_tail(name, word)?;
        apart(before.chars().next_back()).then_some((eye, before, ""))
    })
}

/// What follows a word at the start of a name.
fn without_head<'a>(name: &'a str, word: &str) -> Option<&'a str> {
    let (head, rest) = name.split_at_checked(word.len())?;
    head.eq_ignore_ascii_case(word).then_some(rest)
}

/// What comes before a word at the end of a name.
fn without_tail<'a>(name: &'a str, word: &str) -> Option<&'a str> {
    let (rest, tail) = name.split_at_checked(name.len().checked_sub(word.len())?)?;
    tail.eq_ignore_ascii_case(word).then_some(rest)
}

fn opposite(word: &str) -> Option<&'static str> {
    EYES.iter().find_map(|[left, right]| match word {
        _ if word.eq_ignore_ascii_case(left) => Some(*right),
        _ if word.eq_ignore_ascii_case(right) => Some(*left),
        _ => None,
    })
}

/// A name for the results: the path below the folder named, without the words for the eye.
pub(super) fn name(file: &Path, root: &Path, is_pair: bool) -> String {
    let below = file.strip_prefix(root).unwrap_or(file);
    let stem = below.file_stem().and_then(OsStr::to_str).unwrap_or_default();
    let folders = below.parent().into_iter().flat_map(Path::components);
    let mut parts: Vec<&str> = folders
        .filter_map(|part| if let Component::Normal(name) = part { name.to_str() } else { None })
        .filter(|folder| !is_pair || *folder != "data" && opposite(folder).is_none())
        .collect();
    let own = match eye_in(stem).filter(|_| is_pair) {
        Some((_, before, after)) => format!("{before}{after}"),
        None => stem.to_owned(),
    };
    let own = own.trim_matches(['_', '-', '.', ' ']);
    if !own.is_empty() {
        parts.push(own);
    }
    match root.file_name().and_then(OsStr::to_str) {
        Some(folder) if parts.is_empty() => folder.to_owned(),
        _ if parts.is_empty() => "pair".to_owned(),
        _ => parts.join("/"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_say_which_eye() {
        for (name, eye) in [
            ("left", Some((0, "", ""))),
            ("right_0007", Some((1, "", "_0007"))),
            ("right07", Some((1, "", "07"))),
            ("cup-left", Some((0, "cup-", ""))),
            ("Cup_RIGHT", Some((1, "Cup_", ""))),
            ("Left07", Some((0, "", "07"))),
            ("é", None),
            ("im1", Some((1, "", ""))),
            ("im10", None),
            ("leftover", None),
            ("bright", None),
            ("upright_3", None),
        ] {
            assert_eq!(eye_in(name), eye, "{name}");
        }
    }

    #[test]
    fn results_are_named_after_what_pairs_have_in_common() {
        let named = |file: &str| name(Path::new(file), Path::new("data"), true);
        assert_eq!(named("data/mav0/cam0/data/17.png"), "mav0/17");
        assert_eq!(named("data/cup/im0.png"), "cup");
        assert_eq!(named("data/cup_left.png"), "cup");
        assert_eq!(named("data/left.png"), "data");
        assert_eq!(name(Path::new("left.png"), Path::new(""), true), "pair");
        assert_eq!(name(Path::new("../a/left.png"), Path::new(".."), true), "a");
    }
}
