//! The files of the frames. Checks whether each is complete, or may be written.

use std::fs;
use std::path::{Path, PathBuf};

use super::options::VideoOptions;
use super::plan::Planned;
use crate::archive::{self, Archive};
use crate::cli::files::destination::{self, Destination, Overwrite};
use crate::cli::files::outputs::{self, EncodedFile};
use crate::cli::files::story;
use crate::error::{Error, Result, in_words};
use crate::photo;

/// Digits of the number in a name.
const DIGITS: usize = 6;

/// The end of a message about a file that may be the user's own.
const FOREIGN: &str = "not made by smalti";

/// Where the files of the frames are.
#[derive(Clone, Debug)]
pub(super) struct Store {
    populations: PathBuf,
    folder: Option<PathBuf>,
    ending: &'static str,
    overwrite: Overwrite,
}

impl Store {
    pub(super) fn new(options: &VideoOptions) -> Self {
        Self {
            populations: options.populations.clone(),
            folder: options.folder.clone(),
            ending: options.ending(),
            overwrite: options.overwrite,
        }
    }

    /// Creates the folders, and removes what killed processes left in them.
    ///
    /// # Errors
    /// [`Error::Output`].
    pub(super) fn create(&self) -> Result<()> {
        for folder in self.folder.iter().chain([&self.populations]) {
            fs::create_dir_all(folder).map_err(|error| {
                Error::output(folder, format!("cannot be created as a folder, since {}", in_words(&error)))
            })?;
            destination::sweep(folder)?;
        }
        Ok(())
    }

    /// The file of a frame's population.
    pub(super) fn population(&self, number: usize) -> PathBuf {
        self.populations.join(format!("{number:0DIGITS$}.npz"))
    }

    /// The files of a frame, its population first.
    ///
    /// # Errors
    /// Never: the endings are known.
    pub(super) fn destinations(&self, number: usize) -> Result<Vec<Destination>> {
        let picture = self.folder.iter().map(|folder| folder.join(format!("{number:0DIGITS$}.{}", self.ending)));
        [self.population(number)].into_iter().chain(picture).map(|path| Destination::for_result(&path)).collect()
    }

    /// The population of a frame, if its file is complete and was written by this command.
    pub(super) fn whole_population(&self, frame: &Planned) -> Option<Archive> {
        let archive = archive::read(&self.population(frame.number)).ok()?;
        let key = archive.meta.get("key").and_then(serde_json::Value::as_str);
        (key == Some(frame.population.key())).then_some(archive)
    }

    /// Whether the picture of a frame is complete and was written by this command, or is not wanted at all.
    pub(super) fn has_picture(&self, frame: &Planned) -> Result<bool> {
        let destinations = self.destinations(frame.number)?;
        let Some(picture) = destinations.get(1) else { return Ok(true) };
        let story = story::story_of_file(picture);
        Ok(story.is_some_and(|story| story.is_of(frame.picture.key())) && photo::is_whole(&picture.path))
    }

    /// Refuses to replace complete files that this command would not have written.
    ///
    /// # Errors
    /// [`Error::Usage`] that names the first such file.
    pub(super) fn check(&self, planned: &[Planned]) -> Result<()> {
        if self.overwrite == Overwrite::Force {
            return Ok(());
        }
        for frame in planned {
            for destination in self.destinations(frame.number)? {
                let path = &destination.path;
                let key = if destination.is_picture() { frame.picture.key() } else { frame.population.key() };
                let why = match story::story_of_file(&destination) {
                    Some(story) if story.is_of(key) => continue,
                    Some(_) => "made with other options",
                    None if !path.is_file() => continue,
                    // A file that may be ours is compared with the new bytes later, once they are known.
                    None if destination.is_picture() && !photo::is_whole(path) => continue,
                    None if !destination.is_picture() && archive::is_cut_short(path) => continue,
                    None => FOREIGN,
                };
                return Err(kept(path, why));
            }
        }
        Ok(())
    }

    /// Refuses to replace a file without smalti's metadata, unless it is the rest of these bytes.
    ///
    /// # Errors
    /// [`Error::Usage`] that names the file.
    pub(super) fn check_remade(&self, file: &EncodedFile<'_>) -> Result<()> {
        let path = &file.destination.path;
        let may_go = self.overwrite == Overwrite::Force
            || !path.is_file()
            || story::told_by_file(file.destination).is_some()
            || outputs::is_left_of(path, &file.bytes);
        if may_go { Ok(()) } else { Err(kept(path, FOREIGN)) }
    }
}

fn kept(path: &Path, why: &str) -> Error {
    let path = path.display();
    Error::Usage(format!("{path} exists and was {why}; name another folder, or replace it with --force"))
}
