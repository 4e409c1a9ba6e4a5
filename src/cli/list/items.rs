//! The pictures of a batch, each with its options and the places of its outputs. All are found and checked before the
//! first one is read.

use std::collections::{HashMap, HashSet};
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

use super::manifest::{ManifestRow, Outputs};
use super::name::{Known, NameTemplate, spelt};
use crate::cli::files::destination::Destination;
use crate::cli::files::inputs::Found;
use crate::cli::files::places::{Inputs, only_place_of, place_of};
use crate::cli::jobs::options::PictureOptions;
use crate::cli::terminal::advice;
use crate::cli::trace::Tracer;
use crate::error::{Error, Result};
use crate::studio::Scheme;

/// One picture of a batch.
#[derive(Clone, Debug)]
pub(crate) struct Item {
    /// Differs from the ids of all other items.
    pub id: String,
    pub input: PathBuf,
    pub outputs: Vec<Destination>,
    pub group: Option<String>,
    /// The id of a picture that must be finished first.
    pub after: Option<String>,
    /// The options that it shares with other pictures.
    common: Arc<PictureOptions>,
    /// Everything about it as a manifest row that needs neither the folders nor the names of the command line.
    pub row: ManifestRow,
}

impl Item {
    /// The options of this picture, as `smalti evolve` would have them. `tracer` records the work on it.
    pub(crate) fn options(&self, tracer: &Tracer) -> PictureOptions {
        let (input, outputs, tracer) = (self.input.clone(), self.outputs.clone(), tracer.clone());
        PictureOptions { input, outputs, tracer, ..(*self.common).clone() }
    }

    /// All files that are read for it.
    pub fn files_read(&self) -> impl Iterator<Item = &Path> {
        self.common.settings.files_read().chain([self.input.as_path()])
    }

    /// How it evolves.
    pub fn scheme(&self) -> Scheme {
        self.common.scheme()
    }

    /// The seed of its random numbers.
    pub fn seed(&self) -> u64 {
        self.common.seed()
    }
}

/// Where outputs go, and in which formats.
pub(crate) struct Naming<'a> {
    pub folder: &'a Path,
    pub template: &'a NameTemplate,
    /// File name endings, each of a different format.
    pub formats: &'a [String],
    /// Whether rows of the manifest may name outputs outside of the folder.
    pub allow_outside: bool,
}

/// A picture that has no unique id and no outputs yet.
struct Draft {
    row: ManifestRow,
    relative: PathBuf,
    common: Arc<PictureOptions>,
    /// Its line in the manifest, if it comes from there.
    line: Option<usize>,
}

/// The items of a batch: first the files that were found, then the rows of the manifest, each with its line number.
/// `options_with` returns the options for the command line together with the flags of a row.
///
/// # Errors
/// [`Error::Usage`] or [`Error::Input`] that names the row, or the two pictures that would be written to the same
/// place.
pub(crate) fn gather(
    found: Vec<Found>,
    manifest: &Path,
    rows: Vec<(usize, ManifestRow)>,
    options_with: &dyn Fn(&[String]) -> Result<PictureOptions>,
    naming: &Naming<'_>,
) -> Result<Vec<Item>> {
    let common = Arc::new(options_with(&[])?);
    let of_found = |Found { path, relative }| {
        let row = ManifestRow { input: path, ..ManifestRow::default() };
        Draft { row, relative, common: Arc::clone(&common), line: None }
    };
    let mut drafts: Vec<Draft> = found.into_iter().map(of_found).collect();
    let mut known: HashMap<Vec<String>, Arc<PictureOptions>> = HashMap::from([(Vec::new(), common.clone())]);
    for (line, row) in rows {
        let refuse = |reason: String| Error::input(manifest, format!("line {line}: {reason}"));
        let flags = row.flags().map_err(refuse)?;
        let common = match known.get(&flags) {
            Some(common) => Arc::clone(common),
            None => {
                let common = Arc::new(options_with(&flags).map_err(|error| refuse(advice::sentence(&error)))?);
                known.insert(flags, Arc::clone(&common));
                common
            }
        };
        let relative = relative_of(&row.input);
        drafts.push(Draft { row, relative, common, line: Some(line) });
    }
    let named: Vec<(&ManifestRow, &Path)> = drafts.iter().map(|draft| (&draft.row, draft.relative.as_path())).collect();
    let ids = ids(&named)?;
    let folder = place_of(naming.folder);
    let finish = |(index, (draft, id)): (usize, (Draft, String))| {
        let line = draft.line.filter(|_| !naming.allow_outside);
        let item = finish(draft, id, index, naming)?;
        let outside = item.outputs.iter().find(|output| !place_of(&output.path).starts_with(&folder));
        match (line, outside) {
            (Some(line), Some(output)) => Err(Error::input(
                manifest,
                format!(
                    "line {line}: {} lies outside of the folder {}; name a place in it, or allow this with --allow-outside",
                    output.path.display(),
                    naming.folder.display()
                ),
            )),
            _ => Ok(item),
        }
    };
    let items = drafts.into_iter().zip(ids).enumerate().map(finish).collect::<Result<Vec<Item>>>()?;
    check_places(&items, manifest)?;
    check_order(&items)?;
    Ok(items)
}

/// A manifest's input as a path below the current folder, or else its name alone.
fn relative_of(input: &Path) -> PathBuf {
    let is_below = input.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
    let name = || input.file_name().map_or_else(|| input.to_owned(), PathBuf::from);
    if is_below { input.components().filter(|part| *part != Component::CurDir).collect() } else { name() }
}

/// The id of each picture: the one in the manifest, or else its path below the named folder. The path loses its ending
/// if it stays unique.
fn ids(named: &[(&ManifestRow, &Path)]) -> Result<Vec<String>> {
    let short = |relative: &Path| {
        let text = spelt(relative.with_extension("").as_os_str());
        // The same on every system, so that a batch may go on elsewhere.
        if cfg!(windows) { text.replace('\\', "/") } else { text }
    };
    let mut counts: HashMap<String, usize> = HashMap::new();
    for (row, relative) in named {
        *counts.entry(row.id.clone().unwrap_or_else(|| short(relative))).or_default() += 1;
    }
    let mut taken = HashSet::new();
    let id = |&(row, relative): &(&ManifestRow, &Path)| {
        let id = row.id.clone().unwrap_or_else(|| match short(relative) {
            id if counts.get(&id) == Some(&1) => id,
            _ => spelt(row.input.as_os_str()),
        });
        if taken.insert(id.clone()) {
            Ok(id)
        } else {
            Err(Error::Usage(format!("two pictures have the id {id}; give each row of the manifest its own id")))
        }
    };
    named.iter().map(id).collect()
}

/// The ids of a manifest's pictures in a batch that consists of this manifest alone.
///
/// # Errors
/// [`Error::Usage`] if two pictures have the same id.
pub(crate) fn ids_of_rows(rows: &[ManifestRow]) -> Result<Vec<String>> {
    let relatives: Vec<PathBuf> = rows.iter().map(|row| relative_of(&row.input)).collect();
    let named: Vec<(&ManifestRow, &Path)> = rows.iter().zip(relatives.iter().map(PathBuf::as_path)).collect();
    ids(&named)
}

fn finish(draft: Draft, id: String, index: usize, naming: &Naming<'_>) -> Result<Item> {
    let Draft { row, relative, common, line: _ } = draft;
    let paths = match &row.output {
        Some(outputs) => outputs.paths().to_vec(),
        None => {
            let known = Known { relative: &relative, id: &id, group: row.group.as_deref(), index, seed: common.seed() };
            naming.formats.iter().map(|format| naming.template.path(&known, format)).collect()
        }
    };
    let destination = |path: &PathBuf| {
        if path == Path::new("-") {
            return Err(Error::Usage(format!("{id}: a batch writes files; name one instead of -")));
        }
        Destination::for_result(&naming.folder.join(path))
    };
    let outputs: Vec<Destination> = paths.iter().map(destination).collect::<Result<_>>()?;
    if outputs.is_empty() {
        return Err(Error::Usage(format!("{id}: has no output; name one")));
    }
    let row = ManifestRow { id: Some(id.clone()), output: Some(Outputs::Several(paths)), ..row };
    let (input, group, after) = (row.input.clone(), row.group.clone(), row.after.clone());
    Ok(Item { id, input, outputs, group, after, common, row })
}

/// Refuses outputs that would overwrite an input or another output.
fn check_places(items: &[Item], manifest: &Path) -> Result<()> {
    let inputs = Inputs::new(items.iter().flat_map(Item::files_read).chain([manifest]));
    let mut written: HashMap<PathBuf, &Item> = HashMap::new();
    for item in items {
        for output in &item.outputs {
            let (place, path) = (only_place_of(&output.path), output.path.display());
            if inputs.has(&output.path) {
                return Err(Error::Usage(format!("{path} is an input; name another place for the output")));
            }
            if let Some(other) = written.insert(place, item) {
                return Err(Error::Usage(format!(
                    "{} and {} would both be written to {path}; tell them apart with --name, as in \
                     '{{dir}}/{{stem}}-{{suffix}}.{{ext}}'",
                    other.input.display(),
                    item.input.display()
                )));
            }
        }
    }
    Ok(())
}

/// Refuses an order that cannot be kept: after a picture outside the group, or in a circle.
fn check_order(items: &[Item]) -> Result<()> {
    let by_id: HashMap<&str, &Item> = items.iter().map(|item| (item.id.as_str(), item)).collect();
    // The pictures whose chain is known to end at one that waits for no other.
    let mut kept: HashSet<&str> = HashSet::new();
    for item in items {
        let (mut at, mut way) = (item, HashSet::from([item.id.as_str()]));
        while !kept.contains(at.id.as_str()) {
            let Some(after) = &at.after else { break };
            let Some(first) = by_id.get(after.as_str()) else {
                return Err(Error::Usage(format!("{}: comes after {after}, which is not in the batch", at.id)));
            };
            if first.group != at.group || at.group.is_none() {
                return Err(Error::Usage(format!(
                    "{}: comes after {after}, which another shard may have; give both the same group",
                    at.id
                )));
            }
            if !way.insert(&first.id) {
                return Err(Error::Usage(format!("{}: comes after itself; break the circle of after", first.id)));
            }
            at = first;
        }
        kept.extend(way);
    }
    Ok(())
}
