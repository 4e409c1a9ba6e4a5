//! The folder for pages, pictures and tables.

use std::io::Read;
use std::path::{Path, PathBuf};

use super::page::{GENERATOR, Page};
use crate::cli::files::destination::{self, Overwrite};
use crate::cli::files::places::Inputs;
use crate::cli::terminal::interrupt::Interrupt;
use crate::error::{Error, Result, in_words};
use crate::output;
use crate::photo::{self, Metadata, Photo};

/// How many bytes at the beginning of a page are searched for its generator.
const HEAD_BYTES: u64 = 512;

/// A folder that holds nothing but our pages and their files.
#[derive(Debug)]
pub(super) struct Folder<'a> {
    root: PathBuf,
    metadata: Metadata,
    inputs: Inputs,
    interrupt: &'a Interrupt,
}

impl<'a> Folder<'a> {
    /// The folder at `root`, created if it is missing. Pictures in it have `software` in their metadata.
    ///
    /// # Errors
    /// [`Error::Usage`] if it is a file, or holds other files and `--force` was not given; [`Error::Output`] if it
    /// cannot be created.
    pub(super) fn open(root: &Path, overwrite: Overwrite, inputs: Inputs, interrupt: &'a Interrupt) -> Result<Self> {
        if root.is_file() {
            return Err(Error::Usage(format!("{} is a file; name a folder", root.display())));
        }
        if root.is_dir() {
            destination::sweep(root)?;
        }
        if overwrite == Overwrite::Refuse && root.is_dir() && !is_empty_or_ours(root)? {
            return Err(Error::Usage(format!(
                "{} holds files that smalti paper did not write; name another folder, or add to it with --force",
                root.display()
            )));
        }
        if inputs.are_in(root) {
            return Err(Error::Usage(format!(
                "{} holds the pictures that are read; name another folder",
                root.display()
            )));
        }
        create(root, root)?;
        output::check_writable(&root.join("index.html"))?;
        let software = format!("smalti {}", env!("CARGO_PKG_VERSION"));
        Ok(Self { root: root.to_owned(), metadata: vec![("Software".to_owned(), software)], inputs, interrupt })
    }

    /// Writes a file; `name` is its path in the folder.
    ///
    /// # Errors
    /// [`Error::Interrupted`] if the user interrupts; [`Error::Output`] if it cannot be written.
    pub(super) fn write(&self, name: &str, bytes: &[u8]) -> Result<()> {
        self.interrupt.check()?;
        let path = self.root.join(name);
        self.inputs.refuse([path.as_path()])?;
        if let Some(parent) = path.parent() {
            create(parent, &path)?;
        }
        self.interrupt.while_writing(|| output::write_atomically(&path, bytes))
    }

    /// Writes a picture as PNG.
    pub(super) fn write_picture(&self, name: &str, photo: &Photo) -> Result<()> {
        self.write(name, &photo::encode_png(photo, &self.metadata)?)
    }

    /// Writes the page `NAME.html`.
    pub(super) fn write_page(&self, name: &str, page: &Page, command: &str) -> Result<()> {
        self.write(&format!("{name}.html"), page.to_html(command).as_bytes())
    }

    /// The path of a file in the folder, for messages.
    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.root.join(name)
    }
}

fn create(folder: &Path, told: &Path) -> Result<()> {
    std::fs::create_dir_all(folder).map_err(|error| {
        Error::output(told, format!("its folder cannot be created, since {}; name another one", in_words(&error)))
    })
}

/// Whether `folder` is empty or holds a page of ours.
fn is_empty_or_ours(folder: &Path) -> Result<bool> {
    let unreadable = |error: std::io::Error| Error::output(folder, photo::why_unreadable(&error));
    let mut is_empty = true;
    for entry in std::fs::read_dir(folder).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        is_empty = false;
        if path.extension().is_some_and(|extension| extension == "html") && is_page(&path) {
            return Ok(true);
        }
    }
    Ok(is_empty)
}

fn is_page(path: &Path) -> bool {
    let mut head = Vec::new();
    let read = std::fs::File::open(path).and_then(|file| file.take(HEAD_BYTES).read_to_end(&mut head));
    read.is_ok() && String::from_utf8_lossy(&head).contains(&format!("content=\"{GENERATOR}\""))
}
