//! Whether a result may replace an existing file, judged by the file's metadata.

use super::destination::{Destination, Overwrite};
use super::story;
use crate::archive;
use crate::error::{Error, Result};
use crate::evolve::Ending;
use crate::studio::Content;

/// Refuses to replace a file that the same command, perhaps interrupted, would not have written.
pub(crate) fn check_replaceable(destination: &Destination, key: &str, overwrite: Overwrite) -> Result<()> {
    if overwrite == Overwrite::Force || !destination.replaces_file() {
        return Ok(());
    }
    let why = match story::story_of_file(destination) {
        Some(found) if found.is_of(key) => return Ok(()),
        None if destination.content == Content::Csv && archive::is_csv_without_rows(&destination.path) => return Ok(()),
        Some(_) => "made with other options",
        None => "not made by smalti",
    };
    let path = destination.path.display();
    Err(Error::Usage(format!("{path} exists and was {why}; name another file, or replace it with --force")))
}

/// Whether the existing file holds a better result of the same command, which must not be lost. Ctrl-C or the clock may
/// have ended this run earlier than the one before it.
pub(crate) fn should_keep(destination: &Destination, key: &str, ending: &Ending, overwrite: Overwrite) -> bool {
    if overwrite == Overwrite::Force || !destination.replaces_file() {
        return false;
    }
    story::story_of_file(destination).is_some_and(|found| found.is_of(key) && found.is_better_than(ending))
}
