//! The pictures of a batch: where they are, the options of each, and the shard it belongs to.

mod args;
mod items;
mod manifest;
mod name;
pub(crate) mod rows;
pub(crate) mod shard;

use std::collections::HashSet;
use std::path::Path;

pub(crate) use self::args::{BatchArgs, IoThreads, OnExists};
pub(crate) use self::items::Item;
use self::items::Naming;
pub(crate) use self::manifest::ManifestRow;
use crate::cli::args::picture::PictureArgs;
use crate::cli::args::typed::Typed;
use crate::cli::files::inputs::{self, Depth, Givers};
use crate::cli::files::left_out::LeftOut;
use crate::cli::jobs::options::PictureOptions;
use crate::cli::terminal::{self, Verbosity};
use crate::error::{Error, Result};
use crate::vk::Validation;

/// Finds the pictures, and gives each its options and outputs.
pub(crate) fn find(args: &BatchArgs, typed: &Typed) -> Result<Vec<Item>> {
    let depth = if args.recursive { Depth::Recursive } else { Depth::Flat };
    let mut left_out = LeftOut::default();
    let found = inputs::find(&args.inputs, depth, &args.output, &mut left_out)?;
    let none = Path::new("-");
    let (manifest, rows) = match &args.manifest {
        Some(path) => (path.as_path(), manifest::read(path)?),
        None => (none, Vec::new()),
    };
    if found.is_empty() && rows.is_empty() {
        let sentence = if args.inputs.is_empty() && args.manifest.is_none() {
            "name pictures, folders or patterns, or a --manifest; see smalti batch --help".to_owned()
        } else if let Some(told) = left_out.told() {
            format!("no picture that is read was found, but {told}; name other folders, or add --recursive")
        } else {
            "no picture was found; name other folders, or add --recursive".to_owned()
        };
        return Err(Error::Usage(sentence));
    }
    if let Some(sentence) = left_out.sentence().filter(|_| args.messages.verbosity() > Verbosity::Quiet) {
        terminal::say(&format!("smalti: {sentence}"));
    }
    args.computing.check(Validation::Off)?;
    let options_with = |flags: &[String]| -> Result<PictureOptions> {
        // Messages about single pictures go into their rows.
        let of_pictures = |picture: &PictureArgs| PictureOptions::new(picture, Verbosity::Quiet);
        if flags.is_empty() { of_pictures(&args.picture) } else { of_pictures(&typed.picture_with(flags)?) }
    };
    let formats = check_formats(&args.formats)?;
    let naming =
        Naming { folder: &args.output, template: &args.name, formats: &formats, allow_outside: args.allow_outside };
    let items = items::gather(found, manifest, rows, &options_with, &naming)?;
    let givers = Givers::new(&args.inputs, depth, &args.output);
    for output in items.iter().flat_map(|item| &item.outputs) {
        if let Some(folder) = givers.of(&output.path) {
            return Err(Error::Usage(format!(
                "{} would be taken for a picture of {} by the next run; name an output folder elsewhere or below it",
                output.path.display(),
                folder.display()
            )));
        }
    }
    Ok(items)
}

/// The formats as endings without a dot, each once.
fn check_formats(formats: &[String]) -> Result<Vec<String>> {
    let formats: Vec<String> = formats.iter().map(|format| format.trim_start_matches('.').to_lowercase()).collect();
    let mut seen = HashSet::new();
    if let Some(twice) = formats.iter().find(|format| !seen.insert(format.as_str())) {
        return Err(Error::Usage(format!("--format: {twice} is named twice")));
    }
    Ok(formats)
}

/// The ids of the pictures of a manifest, in its order.
///
/// # Errors
/// As [`manifest::read`].
pub(crate) fn ids(path: &Path) -> Result<Vec<String>> {
    let rows: Vec<ManifestRow> = manifest::read(path)?.into_iter().map(|(_, row)| row).collect();
    items::ids_of_rows(&rows)
}
