//! What to do about outputs that are there already.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use clap::ValueEnum;
use serde::de::IgnoredAny;
use serde_json::{Map, Value};

use crate::app::destination::{Content, Destination};
use crate::app::options::EvolveOptions;
use crate::app::outputs;
use crate::app::prepared::Prepared;
use crate::app::provenance::{self, Story};
use crate::archive;
use crate::error::{Error, Result};
use crate::openraster;
use crate::output;
use crate::photo;

/// What `--on-exists` may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(in crate::app) enum OnExists {
    /// Keep what is whole and of the same picture, options and seed; make anew what smalti made otherwise, and what is damaged
    SkipSame,
    /// Keep whatever is there, without looking into it
    Skip,
    /// Make everything anew
    Overwrite,
    /// Fail
    Error,
}

/// What is to be done about a picture, as its outputs are.
#[derive(Debug)]
pub(super) enum Verdict {
    /// These outputs are to be written.
    Write(Vec<Destination>),
    /// Nothing: all are whole and the same; what the first of them tells.
    Unchanged(Map<String, Value>),
}

/// Looks at the outputs before the picture is read; true if nothing is left to do.
///
/// # Errors
/// [`Error::Output`] if one is there and none may be.
pub(super) fn is_skipped(outputs: &[Destination], on_exists: OnExists) -> Result<bool> {
    let is_there = |output: &&Destination| output.path.symlink_metadata().is_ok();
    match on_exists {
        OnExists::Skip => Ok(outputs.iter().all(|output| is_there(&output))),
        OnExists::Error => outputs.iter().find(is_there).map_or(Ok(false), |output| {
            let reason = "is there already; name another folder, or choose another --on-exists";
            Err(Error::output(&output.path, reason))
        }),
        OnExists::SkipSame | OnExists::Overwrite => Ok(false),
    }
}

/// Looks at the outputs once the key of the picture is known.
///
/// # Errors
/// [`Error::Output`] if a file is there that smalti did not make, or nothing can be written.
pub(super) fn judge(options: &EvolveOptions, prepared: &Prepared, on_exists: OnExists) -> Result<Verdict> {
    let is_there = |output: &Destination| output.path.symlink_metadata().is_ok();
    let mut to_write = options.outputs.clone();
    match on_exists {
        OnExists::Overwrite | OnExists::Error => {}
        OnExists::Skip => to_write.retain(|output| !is_there(output)),
        OnExists::SkipSame => {
            let mut same = None;
            to_write.clear();
            for output in &options.outputs {
                let key = prepared.provenances.of_output(output).key();
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

/// Refuses places that nothing can be written to, before the work is done: folders, pipes, and what is below a file.
fn check_place(output: &Destination) -> Result<()> {
    if output.is_stream() {
        let reason = "is there and is no file but a pipe or a device; move it away, or name another folder";
        return Err(Error::output(&output.path, reason));
    }
    match output.path.parent().map(Path::try_exists) {
        // It will be made.
        Some(Ok(false)) => Ok(()),
        _ => output::check_writable(&output.path),
    }
}

/// What the file at `output` tells, if it is whole and has this key; nothing if it may be replaced, as far as that is known now
/// ([`check_remade`]).
fn told_by_same(output: &Destination, key: &str, fly_count: usize) -> Result<Option<Map<String, Value>>> {
    if !output.path.is_file() {
        return Ok(None);
    }
    let is_whole = is_whole(output, fly_count);
    match provenance::told_by_file(output) {
        // What ends in zeros may be ours, and have lost what it told in a crash of the system.
        None if is_whole && !ends_in_zero(output) => Err(foreign(output)),
        None => Ok(None),
        Some(told) => {
            let is_same = Story::told(&told).is_some_and(|story| story.is_of(key) && story.is_complete);
            Ok((is_whole && is_same).then_some(told))
        }
    }
}

/// Refuses to replace a file that does not tell that smalti made it, unless it is an output of this picture that was cut short:
/// then `bytes`, which are to be written now, begin with what is left of it, and zeros may follow that a file system put there.
///
/// # Errors
/// [`Error::Output`] that names the file.
pub(super) fn check_remade(output: &Destination, bytes: &[u8], on_exists: OnExists) -> Result<()> {
    if on_exists == OnExists::Overwrite || !output.path.is_file() || provenance::told_by_file(output).is_some() {
        return Ok(());
    }
    if outputs::is_left_of(&output.path, bytes) { Ok(()) } else { Err(foreign(output)) }
}

fn foreign(output: &Destination) -> Error {
    let reason = "is there and was not made by smalti; name another folder, or replace it with --on-exists overwrite";
    Error::output(&output.path, reason)
}

/// Whether nothing of the file is missing, not even its last byte: what is cut short must be made anew.
fn is_whole(output: &Destination, fly_count: usize) -> bool {
    let ends_with = |end: &[u8]| read(output).is_some_and(|bytes| bytes.ends_with(end));
    match output.content {
        Content::Png | Content::Jpeg | Content::WebP => photo::is_whole(&output.path),
        Content::OpenRaster => openraster::is_whole(&output.path),
        Content::Population => archive::read(&output.path).is_ok(),
        Content::Svg => ends_with(b"</svg>\n") && !has_zeros(output),
        Content::Json => {
            ends_with(b"\n") && read(output).is_some_and(|bytes| serde_json::from_slice::<IgnoredAny>(&bytes).is_ok())
        }
        // A line of names, and a line for each fly.
        Content::Csv => read(output).is_some_and(|bytes| {
            let lines = bytes.iter().filter(|&&byte| byte == b'\n').count();
            bytes.ends_with(b"\n") && lines == fly_count + 1 && !bytes.contains(&0)
        }),
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
