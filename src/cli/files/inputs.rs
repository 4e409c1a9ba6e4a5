//! Which pictures a command takes: folders, globs and single files, in natural order.

use std::collections::HashSet;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};

use glob::{MatchOptions, Pattern};

use super::left_out::LeftOut;
use super::places::place_of;
use crate::error::{Error, Result};
use crate::photo;

/// The characters that make a name a pattern.
const WILD: [char; 3] = ['*', '?', '['];
/// Endings that mark the pictures of a folder, in lower case.
const ENDINGS: [&str; 13] =
    ["png", "apng", "jpg", "jpeg", "jpe", "jfif", "jxl", "webp", "tif", "tiff", "bmp", "dib", "gif"];

/// A file that was found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Found {
    pub path: PathBuf,
    /// The path below the folder that was named; for a single file its name.
    pub relative: PathBuf,
}

/// Whether the folders below the named ones are searched, too.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Depth {
    Flat,
    Recursive,
}

/// The files that `named` stand for. A folder stands for the pictures in it, in natural order; an existing file for
/// itself; any other name with `*`, `?` or `[` for the files that match it. Each file comes once. Files in the folder
/// `outputs` do not count if it lies below a named folder: otherwise the next run would take the results of this one
/// for pictures.
///
/// A name that neither exists nor is a pattern becomes a picture that will fail, and so does whatever cannot be read
/// below a folder: neither may stop the other pictures. The other files of folders are counted in `left_out`.
///
/// # Errors
/// [`Error::Input`] if a folder that is named cannot be read; [`Error::Usage`] if a pattern is wrong.
pub(crate) fn find(named: &[PathBuf], depth: Depth, outputs: &Path, left_out: &mut LeftOut) -> Result<Vec<Found>> {
    let outputs = place_of(outputs);
    let mut listing = Listing { found: Vec::new(), left_out, depth, outputs: &outputs };
    for path in named {
        let text = path.to_string_lossy();
        if path.is_dir() {
            let unreadable = |error| Error::input(path, photo::why_unreadable(&error));
            listing.list(path, Path::new("")).map_err(unreadable)?;
        } else if is_pattern(path) {
            listing.found.extend(matches(&text, &outputs)?);
        } else {
            let relative = path.file_name().map_or_else(|| path.clone(), PathBuf::from);
            listing.found.push(Found { path: path.clone(), relative });
        }
    }
    let mut found = listing.found;
    let mut seen = HashSet::new();
    found.retain(|one: &Found| seen.insert(one.path.clone()));
    Ok(found)
}

/// The pictures in a folder, but not below it, in natural order.
///
/// # Errors
/// [`Error::Input`] if it cannot be read, or holds none.
pub(crate) fn in_folder(folder: &Path, left_out: &mut LeftOut) -> Result<Vec<PathBuf>> {
    if folder.is_file() {
        return Err(Error::input(folder, "is a file; name a folder of frames"));
    }
    let mut listing = Listing { found: Vec::new(), left_out, depth: Depth::Flat, outputs: Path::new("") };
    listing.list(folder, Path::new("")).map_err(|error| Error::input(folder, photo::why_unreadable(&error)))?;
    if listing.found.is_empty() {
        let reason = listing.left_out.told().map_or_else(
            || "holds no pictures; name another folder".to_owned(),
            |told| format!("holds no picture that is read, but {told}"),
        );
        return Err(Error::input(folder, reason));
    }
    Ok(listing.found.into_iter().map(|one| one.path).collect())
}

/// What folders hold.
struct Listing<'a> {
    found: Vec<Found>,
    left_out: &'a mut LeftOut,
    depth: Depth,
    /// The folder of outputs.
    outputs: &'a Path,
}

impl Listing<'_> {
    /// Adds the pictures in `folder` and, with [`Depth::Recursive`], in the folders below it: first its own, then
    /// folder by folder. A folder that is named like a picture counts as a picture, so that it fails and is reported.
    /// Links to folders are not followed, since they may lead in a circle.
    fn list(&mut self, folder: &Path, relative: &Path) -> std::io::Result<()> {
        let mut names = Vec::new();
        for entry in fs::read_dir(folder)? {
            let entry = entry?;
            names.push((entry.file_name(), entry.file_type()?.is_dir()));
        }
        names.retain(|(name, _)| !name.as_encoded_bytes().starts_with(b"."));
        names.sort_by(|(one, _), (other, _)| compare(one, other));
        let (folders, files): (Vec<_>, Vec<_>) =
            names.into_iter().partition(|(name, is_folder)| *is_folder && !is_named_like_a_picture(Path::new(name)));
        for (name, _) in files {
            let path = folder.join(&name);
            if is_named_like_a_picture(&path) {
                self.found.push(Found { path, relative: relative.join(&name) });
            } else if !path.is_dir() {
                self.left_out.note(&path);
            }
        }
        if self.depth == Depth::Flat {
            return Ok(());
        }
        for (name, _) in folders {
            let (path, relative) = (folder.join(&name), relative.join(&name));
            if place_of(&path) != self.outputs && self.list(&path, &relative).is_err() {
                self.found.push(Found { path, relative });
            }
        }
        Ok(())
    }
}

/// The named folders and patterns. They tell which of them would find an output and take it for a picture the next
/// time.
pub(crate) struct Givers<'a> {
    /// As the user wrote them, each with the one name of its place.
    folders: Vec<(&'a Path, PathBuf)>,
    patterns: Vec<GivingPattern<'a>>,
    depth: Depth,
    outputs: PathBuf,
}

impl<'a> Givers<'a> {
    /// Of the names that [`find`] gets.
    pub(crate) fn new(named: &'a [PathBuf], depth: Depth, outputs: &Path) -> Self {
        let folders = named.iter().filter(|path| path.is_dir()).map(|path| (path.as_path(), place_of(path)));
        let patterns = named.iter().filter(|path| is_pattern(path)).filter_map(|path| GivingPattern::new(path));
        Self { folders: folders.collect(), patterns: patterns.collect(), depth, outputs: place_of(outputs) }
    }

    /// The folder or pattern that would find the file `written` and take it for a picture.
    pub(crate) fn of(&self, written: &Path) -> Option<&'a Path> {
        let has_name = is_named_like_a_picture(written);
        if self.patterns.is_empty() && (self.folders.is_empty() || !has_name) {
            return None;
        }
        let place = place_of(written);
        if let Some(pattern) = self.patterns.iter().find(|pattern| pattern.gives(&place, &self.outputs)) {
            return Some(pattern.named);
        }
        let gives = |folder: &Path| {
            let has_outputs = self.outputs != folder && self.outputs.starts_with(folder);
            match self.depth {
                Depth::Flat => place.parent() == Some(folder),
                Depth::Recursive => place.starts_with(folder) && !(has_outputs && place.starts_with(&self.outputs)),
            }
        };
        self.folders.iter().filter(|_| has_name).find(|(_, folder)| gives(folder)).map(|(named, _)| *named)
    }
}

/// A pattern that can be compared with places, whatever the current folder.
struct GivingPattern<'a> {
    named: &'a Path,
    /// The place of the folders that come before its first wildcard.
    base: PathBuf,
    whole: Pattern,
}

impl<'a> GivingPattern<'a> {
    fn new(named: &'a Path) -> Option<Self> {
        let plain = plain_part(named);
        let base = base_of(&plain);
        let rest = named.strip_prefix(&plain).ok()?;
        let whole = Path::new(&Pattern::escape(base.to_str()?)).join(rest);
        Some(Self { named, base, whole: Pattern::new(whole.to_str()?).ok()? })
    }

    /// Whether the pattern matches a place. Places in a folder of outputs below its first wildcard do not count.
    fn gives(&self, place: &Path, outputs: &Path) -> bool {
        let has_outputs = outputs != self.base && outputs.starts_with(&self.base);
        let is_output = has_outputs && place.parent().is_some_and(|folder| folder.starts_with(outputs));
        let how = MatchOptions { require_literal_separator: true, ..MatchOptions::new() };
        !is_output && self.whole.matches_path_with(place, how)
    }
}

/// Whether a name is a pattern rather than an existing file.
fn is_pattern(named: &Path) -> bool {
    named.symlink_metadata().is_err() && named.to_string_lossy().contains(WILD)
}

/// The folders before a pattern's first wildcard, as the user wrote them.
fn plain_part(pattern: &Path) -> PathBuf {
    pattern.components().take_while(|part| !part.as_os_str().to_string_lossy().contains(WILD)).collect()
}

/// The place of these folders.
fn base_of(plain: &Path) -> PathBuf {
    place_of(if plain.as_os_str().is_empty() { Path::new(".") } else { plain })
}

/// The files that a pattern matches, in natural order, relative to the folders before its first wildcard. Without those
/// in the folder `outputs`, if that lies below these folders.
fn matches(pattern: &str, outputs: &Path) -> Result<Vec<Found>> {
    let paths = glob::glob(pattern).map_err(|error| {
        Error::Usage(format!(
            "{pattern}: not a pattern ({error}); write a * for any part of a name, as in 'photos/*.jpg'"
        ))
    })?;
    let plain = plain_part(Path::new(pattern));
    let base = base_of(&plain);
    let has_outputs = outputs != base && outputs.starts_with(&base);
    let is_output =
        |path: &Path| has_outputs && path.parent().is_some_and(|folder| place_of(folder).starts_with(outputs));
    let mut found = Vec::new();
    for path in paths {
        // What cannot be read becomes a picture that will fail.
        let path = path.unwrap_or_else(|error| error.path().to_owned());
        if is_output(&path) || path == outputs {
            continue;
        }
        let relative = path.strip_prefix(&plain).unwrap_or(&path).to_owned();
        found.push(Found { path, relative });
    }
    if found.is_empty() {
        return Err(Error::Usage(format!("{pattern}: matches no file; check the pattern, or name a folder")));
    }
    found.sort_by(|one, other| compare(one.path.as_os_str(), other.path.as_os_str()));
    Ok(found)
}

pub(crate) fn is_named_like_a_picture(path: &Path) -> bool {
    let ending = path.extension().and_then(OsStr::to_str).unwrap_or_default().to_lowercase();
    ENDINGS.contains(&ending.as_str())
}

/// Natural order: 2 comes before 10. Names that differ only in leading zeros have an order, too.
pub(crate) fn compare(one: &OsStr, other: &OsStr) -> std::cmp::Ordering {
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
        found
            .expect("all can be read")
            .iter()
            .map(|one| one.relative.display().to_string().replace('\\', "/"))
            .collect()
    }

    #[test]
    fn folders_give_their_pictures_in_natural_order_and_what_is_below_only_if_asked() {
        let folder = folder();
        let named = [folder.path().to_owned()];
        let elsewhere = Path::new("elsewhere");
        assert_eq!(relative(find(&named, Depth::Flat, elsewhere, &mut LeftOut::default())), ["a.jpg", "odd.png"]);
        let all = ["a.jpg", "odd.png", "b/p2.PNG", "b/p10.png", "c/deep/x.webp"];
        assert_eq!(relative(find(&named, Depth::Recursive, elsewhere, &mut LeftOut::default())), all);
    }

    #[test]
    fn what_is_in_the_output_folder_is_no_picture_of_the_folder_that_it_is_in() {
        let folder = folder();
        let at = |name: &str| folder.path().join(name);
        let named = [folder.path().to_owned()];
        assert_eq!(
            relative(find(&named, Depth::Recursive, &at("b/../b"), &mut LeftOut::default())),
            ["a.jpg", "odd.png", "c/deep/x.webp"]
        );
        assert_eq!(
            relative(find(&named, Depth::Recursive, &at("c"), &mut LeftOut::default())),
            ["a.jpg", "odd.png", "b/p2.PNG", "b/p10.png"]
        );
        assert_eq!(
            relative(find(&[at("**/p*")], Depth::Flat, &at("c"), &mut LeftOut::default())),
            ["b/p2.PNG", "b/p10.png"]
        );
        assert!(find(&[at("**/p*")], Depth::Flat, &at("b"), &mut LeftOut::default()).is_err(), "nothing is left");
        assert_eq!(relative(find(&[at("b/*")], Depth::Flat, &at("b"), &mut LeftOut::default())), ["p2.PNG", "p10.png"]);
        for (written, depth, outputs, is_given) in [
            ("a.png", Depth::Flat, "", true),
            ("a.svg", Depth::Flat, "", false),
            ("out/a.png", Depth::Flat, "out", false),
            ("out/a.png", Depth::Recursive, "out", false),
            ("b/a.png", Depth::Recursive, "", true),
            ("b/a.png", Depth::Recursive, "out", true),
        ] {
            let givers = Givers::new(&named, depth, &at(outputs));
            assert_eq!(givers.of(&at(written)).is_some(), is_given, "{written} {depth:?} {outputs}");
        }
    }

    #[test]
    fn a_pattern_would_give_what_it_matches_but_nothing_from_a_folder_of_outputs_below() {
        let folder = folder();
        let at = |name: &str| folder.path().join(name);
        for (pattern, written, outputs, is_given) in [
            ("b/*.png", "b/p-m.png", "b", true),
            ("b/*.png", "b/../b/p-m.png", "b", true),
            ("b/*.png", "b/p-m.svg", "b", false),
            ("b/*", "b/p-m.svg", "b", true),
            ("b/*.png", "b/deep/p.png", "b", false),
            ("**/*.png", "b/out/p.png", "b", false),
            ("**/*.png", "b/out/p.png", "elsewhere", true),
            ("*/*.png", "b/p.png", "b", false),
        ] {
            let named = [at(pattern)];
            let givers = Givers::new(&named, Depth::Flat, &at(outputs));
            assert_eq!(givers.of(&at(written)).is_some(), is_given, "{pattern} {written} {outputs}");
        }
    }

    #[test]
    fn a_pattern_gives_what_it_matches_and_a_file_is_itself_even_if_it_is_not_there() {
        let folder = folder();
        let named = |names: &[&str]| names.iter().map(|name| folder.path().join(name)).collect::<Vec<_>>();
        let elsewhere = Path::new("elsewhere");
        assert_eq!(
            relative(find(&named(&["*/p*"]), Depth::Flat, elsewhere, &mut LeftOut::default())),
            ["b/p2.PNG", "b/p10.png"]
        );
        let twice = named(&["notes.txt", "gone.png", "notes.txt"]);
        assert_eq!(relative(find(&twice, Depth::Flat, elsewhere, &mut LeftOut::default())), ["notes.txt", "gone.png"]);
        assert!(find(&named(&["*.tif"]), Depth::Flat, elsewhere, &mut LeftOut::default()).is_err(), "nothing matches");
    }
}
