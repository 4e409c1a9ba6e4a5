//! The files of the frames: whether each is there and whole, or may be written.

use std::fs;
use std::path::PathBuf;

use super::options::VideoOptions;
use super::plan::Planned;
use crate::app::destination::{self, Destination};
use crate::app::options::Overwrite;
use crate::app::provenance;
use crate::archive::{self, Archive};
use crate::error::{Error, Result};
use crate::photo;

/// Digits of the number in a name.
const DIGITS: usize = 6;

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

    /// Creates the folders, and takes away what killed processes left in them.
    ///
    /// # Errors
    /// [`Error::Output`].
    pub(super) fn create(&self) -> Result<()> {
        for folder in self.folder.iter().chain([&self.populations]) {
            fs::create_dir_all(folder)
                .map_err(|error| Error::output(folder, format!("cannot be created as a folder ({error})")))?;
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

    /// The population of a frame, if the file is whole and what this command writes.
    pub(super) fn whole_population(&self, frame: &Planned) -> Option<Archive> {
        let archive = archive::read(&self.population(frame.number)).ok()?;
        let key = archive.meta.get("key").and_then(serde_json::Value::as_str);
        (key == Some(frame.population.key())).then_some(archive)
    }

    /// Whether the picture of a frame is there, whole and what this command writes, or none is wanted.
    pub(super) fn has_picture(&self, frame: &Planned) -> Result<bool> {
        let destinations = self.destinations(frame.number)?;
        let Some(picture) = destinations.get(1) else { return Ok(true) };
        let story = provenance::story_of_file(picture);
        Ok(story.is_some_and(|story| story.is_of(frame.picture.key())) && photo::is_whole(&picture.path))
    }

    /// Refuses to replace whole files that this command would not have written.
    ///
    /// # Errors
    /// [`Error::Usage`] with the first such file.
    pub(super) fn check(&self, planned: &[Planned]) -> Result<()> {
        if self.overwrite == Overwrite::Force {
            return Ok(());
        }
        for frame in planned {
            for destination in self.destinations(frame.number)? {
                let path = &destination.path;
                let key = if destination.is_picture() { frame.picture.key() } else { frame.population.key() };
                let why = match provenance::story_of_file(&destination) {
                    Some(story) if story.is_of(key) => continue,
                    Some(_) => "made with other options",
                    // What was cut short, perhaps when the machine went down, is nothing to keep.
                    None if !path.is_file() || !destination.is_picture() || !photo::is_whole(path) => continue,
                    None => "not made by smalti",
                };
                let path = path.display();
                return Err(Error::Usage(format!(
                    "{path} exists and was {why}; name another folder, or replace it with --force"
                )));
            }
        }
        Ok(())
    }
}
