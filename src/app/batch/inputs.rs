//! Which files a batch takes: folders, globs and single files, in natural order.

use std::collections::HashSet;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::photo;

/// Endings of the files of a folder that are taken for pictures, in lower case.
const ENDINGS: [&str; 8] = ["png", "jpg", "jpeg", "webp", "tif", "tiff", "bmp", "gif"];

/// A file that was found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Found {
    pub path: PathBuf,
    /// Below the folder that was named, or else the file's name.
    pub relative: PathBuf,
}

/// Whether folders below those that were named count, too.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Depth {
    Flat,
    Recursive,
}

/// The files that `named` stand for: a folder for the pictures in it, in natural order; what exists for itself; anything
/// else with `*`, `?` or `[` for what matches. Each file comes once.
///
/// What does not exist and is no pattern is a picture that will fail: it must not stop the others.
///
/// # Errors
/// [`Error::Input`] if a folder cannot be read; [`Error::Usage`] if a pattern is wrong.
pub(super) fn find(named: &[PathBuf], depth: Depth) -> Result<Vec<Found>> {
    let mut found = Vec::new();
    for path in named {
        let text = path.to_string_lossy();
        if path.is_dir() {
            list(path, Path::new(""), depth, &mut found)?;
        } else if path.symlink_metadata().is_err() && text.contains(['*', '?', '[']) {
            found.extend(matches(&text)?);
        } else {
            let relative = path.file_name().map_or_else(|| path.clone(), PathBuf::from);
            found.push(Found { path: path.clone(), relative });
        }
    }
    let mut seen = HashSet::new();
    found.retain(|one: &Found| seen.insert(one.path.clone()));
    Ok(found)
}

/// The pictures in `folder`, and with [`Depth::Recursive`] in those below it: first its own, then folder by folder. A folder with
/// the name of a picture is taken for one, which fails and is told. Links to folders are not followed: they may lead in a circle.
fn list(folder: &Path, relative: &Path, depth: Depth, found: &mut Vec<Found>) -> Result<()> {
    let unreadable = |error| Error::input(folder, photo::why_unreadable(&error));
    let mut names = Vec::new();
    for entry in fs::read_dir(folder).map_err(unreadable)? {
        let entry = entry.map_err(unreadable)?;
        let is_folder = entry.file_type().map_err(unreadable)?.is_dir();
        names.push((entry.file_name(), is_folder));
    }
    names.retain(|(name, _)| !name.as_encoded_bytes().starts_with(b"."));
    names.sort_by(|(one, _), (other, _)| compare(one, other));
    let (folders, files): (Vec<_>, Vec<_>) =
        names.into_iter().partition(|(name, is_folder)| *is_folder && !is_named_like_a_picture(Path::new(name)));
    let files = files.into_iter().filter(|(name, _)| is_named_like_a_picture(Path::new(name)));
    found.extend(files.map(|(name, _)| Found { path: folder.join(&name), relative: relative.join(&name) }));
    if depth == Depth::Recursive {
        folders.iter().try_for_each(|(name, _)| list(&folder.join(name), &relative.join(name), depth, found))?;
    }
    Ok(())
}

/// The files that a pattern matches, in natural order; relative to the folders that it names outright.
fn matches(pattern: &str) -> Result<Vec<Found>> {
    let paths = glob::glob(pattern).map_err(|error| {
        Error::Usage(format!(
            "{pattern}: not a pattern ({error}); write a * for any part of a name, as in 'photos/*.jpg'"
        ))
    })?;
    let plain: PathBuf = Path::new(pattern)
        .components()
        .take_while(|part| !part.as_os_str().to_string_lossy().contains(['*', '?', '[']))
        .collect();
    let mut found = Vec::new();
    for path in paths {
        let path = path.map_err(|error| Error::input(error.path(), photo::why_unreadable(error.error())))?;
        let relative = path.strip_prefix(&plain).unwrap_or(&path).to_owned();
        found.push(Found { path, relative });
    }
    if found.is_empty() {
        return Err(Error::Usage(format!("{pattern}: matches no file; check the pattern, or name a folder")));
    }
    found.sort_by(|one, other| compare(one.path.as_os_str(), other.path.as_os_str()));
    Ok(found)
}

fn is_named_like_a_picture(path: &Path) -> bool {
    let ending = path.extension().and_then(OsStr::to_str).unwrap_or_default().to_lowercase();
    ENDINGS.contains(&ending.as_str())
}

/// Natural order: 2 comes before 10. Names that differ only in zeros ahead of a number keep an order, too.
pub(super) fn compare(one: &OsStr, other: &OsStr) -> std::cmp::Ordering {
    natord::compare(&one.to_string_lossy(), &other.to_string_lossy()).then_with(|| one.cmp(other))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder() -> tempfile::TempDir {
        let folder = tempfile::tempdir().expect("a temporary folder");
        for name in
            ["b/p10.png", "b/p2.PNG", "a.jpg", "notes.txt", ".hidden.png", "c/deep/x.webp", "odd.png/inside.png"]
        {
            let path = folder.path().join(name);
            fs::create_dir_all(path.parent().expect("it is in the folder")).expect("the folder is ours");
            fs::write(path, b"whatever").expect("the folder is ours");
        }
        folder
    }

    fn relative(found: Result<Vec<Found>>) -> Vec<String> {
        found.expect("all can be read").iter().map(|one| one.relative.display().to_string()).collect()
    }

    #[test]
    fn folders_give_their_pictures_in_natural_order_and_what_is_below_only_if_asked() {
        let folder = folder();
        let named = [folder.path().to_owned()];
        assert_eq!(relative(find(&named, Depth::Flat)), ["a.jpg", "odd.png"]);
        let all = ["a.jpg", "odd.png", "b/p2.PNG", "b/p10.png", "c/deep/x.webp"];
        assert_eq!(relative(find(&named, Depth::Recursive)), all);
    }

    #[test]
    fn a_pattern_gives_what_it_matches_and_a_file_is_itself_even_if_it_is_not_there() {
        let folder = folder();
        let named = |names: &[&str]| names.iter().map(|name| folder.path().join(name)).collect::<Vec<_>>();
        assert_eq!(relative(find(&named(&["*/p*"]), Depth::Flat)), ["b/p2.PNG", "b/p10.png"]);
        let twice = named(&["notes.txt", "gone.png", "notes.txt"]);
        assert_eq!(relative(find(&twice, Depth::Flat)), ["notes.txt", "gone.png"]);
        assert!(find(&named(&["*.tif"]), Depth::Flat).is_err(), "nothing matches");
    }
}
