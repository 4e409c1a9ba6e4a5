//! The places of a batch's files. Results and trace must not collide with any picture, and what killed processes left
//! is removed.

use std::collections::HashSet;
use std::path::Path;

use crate::cli::files::destination::sweep;
use crate::cli::files::inputs::{Depth, Givers};
use crate::cli::files::places::Inputs;
use crate::cli::list::{BatchArgs, Item, rows};
use crate::error::{Error, Result, in_words};
use crate::output::{self, Journal};

/// The places of all pictures that a batch reads or writes.
pub(super) struct Taken<'a> {
    places: Inputs,
    givers: Givers<'a>,
}

impl<'a> Taken<'a> {
    pub(super) fn new(items: &[Item], args: &'a BatchArgs) -> Self {
        let depth = if args.recursive { Depth::Recursive } else { Depth::Flat };
        let manifest = args.manifest.as_deref();
        let read = items.iter().flat_map(Item::files_read).chain(manifest);
        let written = items.iter().flat_map(|item| &item.outputs).map(|output| output.path.as_path());
        let places = Inputs::new(read.chain(written));
        Self { places, givers: Givers::new(&args.inputs, depth, &args.output) }
    }

    /// Refuses the file of `flag` if it is one of these, or would count as a picture the next time.
    pub(super) fn check(&self, flag: &str, path: &Path) -> Result<()> {
        let path_told = path.display();
        if self.places.has(path) {
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

    /// Refuses a results file that holds something else, since lines would be appended to it.
    pub(super) fn check_results(&self, results: &Path) -> Result<()> {
        if results == Path::new("-") {
            return Err(Error::Usage("--results needs a file, not -; use --json to print the lines".to_owned()));
        }
        self.check("--results", results)?;
        if results.is_file() && !rows::holds_result_rows(results) {
            let path = results.display();
            return Err(Error::Usage(format!(
                "--results: {path} exists and holds no rows of results; name another file"
            )));
        }
        Ok(())
    }
}

/// Creates the output folder, removes what killed processes left in it, and opens the results file.
pub(super) fn prepare(args: &BatchArgs, items: &[Item], results: &Path) -> Result<Journal> {
    std::fs::create_dir_all(&args.output).map_err(|error| {
        Error::output(
            &args.output,
            format!("the folder cannot be created, since {}; name another one", in_words(&error)),
        )
    })?;
    output::check_folder_writable(&args.output)?;
    let outputs = items.iter().flat_map(|item| &item.outputs).map(|output| output.path.as_path());
    let mut folders: HashSet<&Path> = outputs.map(folder_of).collect();
    folders.insert(&args.output);
    folders.iter().filter(|folder| folder.is_dir()).try_for_each(|folder| sweep(folder))?;
    for beside in args.trace.as_deref().into_iter().chain([results]).map(folder_of) {
        if !folders.contains(beside) {
            // A failure is ignored: we may be allowed to write a file in a folder but not to list it.
            let _ = sweep(beside);
        }
    }
    Journal::open(results)
}

/// The folder that holds a file.
fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}
