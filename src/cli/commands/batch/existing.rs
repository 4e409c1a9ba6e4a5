//! What to do about outputs that exist already.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use serde::de::IgnoredAny;
use serde_json::{Map, Value};

use crate::cli::files::destination::Destination;
use crate::cli::files::outputs;
use crate::cli::files::story::{self, Story};
use crate::cli::jobs::options::PictureOptions;
use crate::cli::jobs::prepared::Prepared;
use crate::cli::list::OnExists;
use crate::error::{Error, Result};
use crate::studio::Content;
use crate::{archive, openraster, output, photo};

/// What to do about a picture, given the state of its outputs.
#[derive(Debug)]
pub(super) enum Verdict {
    /// Write these outputs.
    Write(Vec<Destination>),
    /// Nothing: all are complete and up to date. Holds the metadata of the first one.
    Unchanged(Map<String, Value>),
}

/// Looks at the outputs before the picture is read; true if there is nothing to do.
///
/// # Errors
/// [`Error::Output`] if one exists and none may.
pub(super) fn is_skipped(outputs: &[Destination], on_exists: OnExists) -> Result<bool> {
    let is_there = |output: &&Destination| output.path.symlink_metadata().is_ok();
    match on_exists {
        OnExists::Skip => Ok(outputs.iter().all(|output| is_there(&output))),
        OnExists::Error => outputs.iter().find(is_there).map_or(Ok(false), |output| {
            let reason = "exists already; name another folder, or choose another --on-exists";
            Err(Error::output(&output.path, reason))
        }),
        OnExists::SkipSame | OnExists::Overwrite => Ok(false),
    }
}

/// Looks at the outputs once the key of the picture is known.
///
/// # Errors
/// [`Error::Output`] if a file exists that smalti did not make, or nothing can be written.
pub(super) fn judge(options: &PictureOptions, prepared: &Prepared, on_exists: OnExists) -> Result<Verdict> {
    let is_there = |output: &Destination| output.path.symlink_metadata().is_ok();
    let mut to_write = options.outputs.clone();
    match on_exists {
        OnExists::Overwrite | OnExists::Error => {}
        OnExists::Skip => to_write.retain(|output| !is_there(output)),
        OnExists::SkipSame => {
            let mut same = None;
            to_write.clear();
            for output in &options.outputs {
                let key = prepared.of_output(output).key();
                match told_by_same(output, key, prepared.job.fly_count)? {
                    Some(told) => same = same.or(Some(told)),
                    None => to_write.push(output.clone()),
                }
            }
            if let Some(told) = same.filter(|_| to_write.is_empty()) {
                return Ok(Verdict::Unchanged(told));
            }
        }
    }
    to_write.iter().try_for_each(check_place)?;
    Ok(Verdict::Write(to_write))
}

/// Whether one of these outputs is there and holds the result of other options or of another picture.
pub(super) fn replaces_other_result(to_write: &[Destination], prepared: &Prepared) -> bool {
    to_write.iter().any(|output| {
        let story = story::story_of_file(output);
        story.is_some_and(|story| !story.is_of(prepared.of_output(output).key()))
    })
}

/// How many of these outputs are there.
pub(super) fn count<'o>(outputs: impl Iterator<Item = &'o Destination>) -> usize {
    outputs.filter(|output| output.path.symlink_metadata().is_ok()).count()
}

/// Refuses places that cannot be written to, before the work is done: folders, pipes, and anything below a file.
fn check_place(output: &Destination) -> Result<()> {
    if output.is_stream() {
        let reason = "is a pipe or a device, not a file; move it away, or name another folder";
        return Err(Error::output(&output.path, reason));
    }
    match output.path.parent().map(Path::try_exists) {
        // A missing folder will be created.
        Some(Ok(false)) => Ok(()),
        _ => output::check_writable(&output.path),
    }
}

/// The metadata of the file at `output`, if it is complete and has this key. None if the file may be replaced, as far
/// as that is known now; [`check_remade`] checks the rest.
fn told_by_same(output: &Destination, key: &str, fly_count: usize) -> Result<Option<Map<String, Value>>> {
    if !output.path.is_file() {
        return Ok(None);
    }
    let is_whole = is_whole(output, fly_count);
    match story::told_by_file(output) {
        // No row can tell the key, so the table is made anew.
        None if is_table_without_rows(output) => Ok(None),
        // A file that ends in zeros may be ours, and have lost its metadata in a crash of the system.
        None if is_whole && !ends_in_zero(output) => Err(foreign(output)),
        None => Ok(None),
        Some(told) => {
            let is_same = Story::told(&told).is_some_and(|story| story.is_of(key) && story.is_complete);
            Ok((is_whole && is_same).then_some(told))
        }
    }
}

/// Refuses to replace a file without smalti's metadata, unless it is an output of this picture that was cut short. Then
/// it is a beginning of `bytes`, which are to be written now; a file system may have padded it with zeros.
///
/// # Errors
/// [`Error::Output`] that names the file.
pub(super) fn check_remade(output: &Destination, bytes: &[u8], on_exists: OnExists) -> Result<()> {
    if on_exists == OnExists::Overwrite || !output.path.is_file() || story::told_by_file(output).is_some() {
        return Ok(());
    }
    if is_table_without_rows(output) || outputs::is_left_of(&output.path, bytes) {
        Ok(())
    } else {
        Err(foreign(output))
    }
}

fn foreign(output: &Destination) -> Error {
    let reason = "exists and was not made by smalti; name another folder, or replace it with --on-exists overwrite";
    Error::output(&output.path, reason)
}

/// Whether the file is a CSV table of no tile.
fn is_table_without_rows(output: &Destination) -> bool {
    output.content == Content::Csv && archive::is_csv_without_rows(&output.path)
}

/// Whether the file is complete to its last byte. If it was cut short, it must be made anew.
fn is_whole(output: &Destination, fly_count: usize) -> bool {
    let ends_with = |end: &[u8]| read(output).is_some_and(|bytes| bytes.ends_with(end));
    match output.content {
        Content::Png | Content::Jpeg(_) | Content::WebP => photo::is_whole(&output.path),
        Content::OpenRaster => openraster::is_whole(&output.path),
        Content::Population => archive::read(&output.path).is_ok(),
        Content::Svg => ends_with(b"</svg>\n") && !has_zeros(output),
        Content::Json => {
            ends_with(b"\n") && read(output).is_some_and(|bytes| serde_json::from_slice::<IgnoredAny>(&bytes).is_ok())
        }
        Content::Csv => read(output).is_some_and(|bytes| archive::is_whole_csv(&bytes, fly_count)),
    }
}

fn ends_in_zero(output: &Destination) -> bool {
    read(output).is_some_and(|bytes| bytes.ends_with(&[0]))
}

fn has_zeros(output: &Destination) -> bool {
    read(output).is_some_and(|bytes| bytes.contains(&0))
}

fn read(output: &Destination) -> Option<Vec<u8>> {
    let mut bytes = Vec::new();
    File::open(&output.path).and_then(|mut file| file.read_to_end(&mut bytes)).ok()?;
    Some(bytes)
}
