//! The files of a batch beside its pictures: results and trace must be in nobody's way, and what killed processes left is taken
//! away.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use super::BatchArgs;
use super::items::Item;
use crate::app::destination::{place_of, sweep};
use crate::app::inputs::{Depth, Givers};
use crate::app::merge;
use crate::error::{Error, Result};
use crate::output::{self, Journal};

/// The places of all files that a batch reads, or writes of its pictures.
pub(super) struct Taken<'a> {
    places: HashSet<PathBuf>,
    givers: Givers<'a>,
}

impl<'a> Taken<'a> {
    pub(super) fn new(items: &[Item], args: &'a BatchArgs) -> Self {
        let depth = if args.recursive { Depth::Recursive } else { Depth::Flat };
        let manifest = args.manifest.iter().map(PathBuf::as_path);
        let read: HashSet<&Path> = items.iter().flat_map(Item::files_read).chain(manifest).collect();
        let written = items.iter().flat_map(|item| &item.outputs).map(|output| output.path.as_path());
        let places = read.into_iter().chain(written).map(place_of).collect();
        Self { places, givers: Givers::new(&args.inputs, depth, &args.output) }
    }

    /// Refuses the file of `flag` if it is one of these, or would be a picture the next time.
    pub(super) fn check(&self, flag: &str, path: &Path) -> Result<()> {
        let path_told = path.display();
        if self.places.contains(&place_of(path)) {
            return Err(Error::Usage(format!(
                "{flag}: {path_told} is read or written by the batch; name another file"
            )));
        }
        self.givers.of(path).map_or(Ok(()), |giver| {
            Err(Error::Usage(format!(
                "{flag}: {path_told} would be taken for a picture of {} by the next run; name another file",
                giver.display()
            )))
        })
    }

    /// Refuses a file of the results that is something else: lines would be added to it.
    pub(super) fn check_results(&self, results: &Path) -> Result<()> {
        if results == Path::new("-") {
            return Err(Error::Usage("--results - is no file; name one, and print the lines with --json".to_owned()));
        }
        self.check("--results", results)?;
        if results.is_file() && !merge::holds_result_rows(results) {
            let path = results.display();
            return Err(Error::Usage(format!(
                "--results: {path} exists and holds no rows of results; name another file"
            )));
        }
        Ok(())
    }
}

/// Makes the output folder, takes away what killed processes left in it, and opens the file of the results.
pub(super) fn prepare(args: &BatchArgs, items: &[Item], results: &Path) -> Result<Journal> {
    std::fs::create_dir_all(&args.output).map_err(|error| {
        Error::output(&args.output, format!("the folder cannot be created ({error}); name another one"))
    })?;
    output::check_folder_writable(&args.output)?;
    let outputs = items.iter().flat_map(|item| &item.outputs).map(|output| output.path.as_path());
    let mut folders: HashSet<&Path> = outputs.map(folder_of).collect();
    folders.insert(&args.output);
    folders.iter().filter(|folder| folder.is_dir()).try_for_each(|folder| sweep(folder))?;
    for beside in args.trace.as_deref().into_iter().chain([results]).map(folder_of) {
        if !folders.contains(beside) {
            // Somebody else's folder may let us write a file, and not look around.
            let _ = sweep(beside);
        }
    }
    Journal::open(results)
}

/// The folder that a file is in.
fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}
