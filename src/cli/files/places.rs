//! No output may be an input: not under another spelling of its path, and not through a link. Every command that writes
//! asks here, and nothing such as `--force` overrides the answer.

use std::collections::HashSet;
use std::path::{Component, Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use crate::error::{Error, Result};

/// Files of flags, which were read before the command itself is known.
static FLAGS_READ: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// Remembers that a file of flags was read, so that no command writes to it.
pub(crate) fn note_flags_read(path: &Path) {
    let mut known = FLAGS_READ.lock().unwrap_or_else(PoisonError::into_inner);
    if !known.iter().any(|known| known == path) {
        known.push(path.to_owned());
    }
}

/// The files that a command reads.
#[derive(Debug, Default)]
pub(crate) struct Inputs {
    places: HashSet<PathBuf>,
    /// What the file system calls the files, whatever their names.
    identities: HashSet<Identity>,
}

impl Inputs {
    pub(crate) fn new<'a>(paths: impl IntoIterator<Item = &'a Path>) -> Self {
        let mut inputs = Self::default();
        FLAGS_READ.lock().unwrap_or_else(PoisonError::into_inner).iter().for_each(|path| inputs.add(path));
        // A manifest may name the same mask ten thousand times.
        let paths: HashSet<&Path> = paths.into_iter().collect();
        paths.into_iter().for_each(|path| inputs.add(path));
        inputs
    }

    fn add(&mut self, path: &Path) {
        self.places.insert(only_place_of(path));
        self.identities.extend(identity(path));
    }

    /// Whether an output is one of them.
    pub(crate) fn has(&self, output: &Path) -> bool {
        self.places.contains(&only_place_of(output))
            || identity(output).is_some_and(|identity| self.identities.contains(&identity))
    }

    /// Whether one of them lies in a folder, but not in a folder below.
    pub(crate) fn are_in(&self, folder: &Path) -> bool {
        let folder = only_place_of(folder);
        self.places.iter().any(|place| place.parent() == Some(&folder))
    }

    /// Refuses outputs that are among them.
    ///
    /// # Errors
    /// [`Error::Usage`] that names the first one.
    pub(crate) fn refuse<'a>(&self, outputs: impl IntoIterator<Item = &'a Path>) -> Result<()> {
        outputs.into_iter().find(|output| self.has(output)).map_or(Ok(()), |output| {
            Err(Error::Usage(format!("{} is an input; name another file for the output", output.display())))
        })
    }
}

#[cfg(unix)]
type Identity = (u64, u64);
#[cfg(not(unix))]
type Identity = ();

/// Device and number of a file, which two names share if they are hard links. Devices and pipes are not replaced.
#[cfg(unix)]
fn identity(path: &Path) -> Option<Identity> {
    use std::os::unix::fs::MetadataExt;
    path.metadata().ok().filter(std::fs::Metadata::is_file).map(|found| (found.dev(), found.ino()))
}

#[cfg(not(unix))]
fn identity(_path: &Path) -> Option<Identity> {
    None
}

/// The place of a file; in small letters on systems that do not tell small letters from capitals in names.
pub(crate) fn only_place_of(path: &Path) -> PathBuf {
    let place = place_of(path);
    if cfg!(any(windows, target_os = "macos")) { place.to_string_lossy().to_lowercase().into() } else { place }
}

/// One name for one file, however its path was written, even if its folder does not exist yet.
pub(crate) fn place_of(path: &Path) -> PathBuf {
    let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    for known in absolute.ancestors() {
        let Ok(mut place) = known.canonicalize() else { continue };
        let unknown = absolute.strip_prefix(known).unwrap_or(Path::new(""));
        // What does not exist cannot be a link, so `..` leads back to its parent.
        unknown.components().for_each(|part| match part {
            Component::ParentDir => drop(place.pop()),
            Component::CurDir => {}
            part => place.push(part),
        });
        return place;
    }
    absolute
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_has_one_place_even_in_a_folder_that_is_still_to_be_made() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let place = |name: &str| place_of(&folder.path().join(name));
        assert_eq!(place("new/deep/a.png"), place("new/./x/../deep/a.png"));
        assert_ne!(place("new/deep/a.png"), place("new/a.png"));
        assert!(place("new/a.png").is_absolute());
    }

    #[cfg(unix)]
    #[test]
    fn an_input_is_known_by_another_spelling_through_a_link_and_under_another_name() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let at = |name: &str| folder.path().join(name);
        std::fs::write(at("a.png"), b"whatever").expect("the folder is ours");
        std::fs::write(at("other.png"), b"whatever").expect("the folder is ours");
        std::fs::hard_link(at("a.png"), at("hard.png")).expect("the folder is ours");
        std::os::unix::fs::symlink("a.png", at("soft.png")).expect("the folder is ours");
        std::os::unix::fs::symlink(".", at("round")).expect("the folder is ours");
        let inputs = Inputs::new([at("a.png").as_path(), &at("gone.png")]);
        for name in ["a.png", "./a.png", "round/a.png", "hard.png", "soft.png", "round/round/gone.png"] {
            assert!(inputs.has(&at(name)), "{name}");
            let refusal = inputs.refuse([at(name).as_path()]).expect_err("it is an input").to_string();
            assert!(refusal.contains(&format!("{} is an input", at(name).display())), "{refusal}");
        }
        assert!(!inputs.has(&at("other.png")) && !inputs.has(&at("new.png")));
        assert!(inputs.are_in(&at("round")) && !inputs.are_in(&at("new")));
    }
}
