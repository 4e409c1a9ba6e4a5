//! The script of `--replay`, read from its file and followed in the place of a search. What is wrong with it is told
//! with the name of the file.

use std::path::{Path, PathBuf};

use crate::cli::files::places;
use crate::error::{Error, Result};
use crate::photo::CutShort;
use crate::studio::{Device, Job, Outlook, Picture, SCRIPT_BYTES_MAX, Script, Session, Settings, read_text};

/// A script that decides a picture.
#[derive(Clone, Debug)]
pub(crate) struct Replay {
    path: PathBuf,
    script: Script,
    /// What is done about a picture that ends too early.
    cut_short: CutShort,
}

impl Replay {
    /// Reads the script at `path`.
    ///
    /// # Errors
    /// [`Error::Input`] if it cannot be read, or not be followed whatever the picture is.
    pub fn read(path: &Path, cut_short: CutShort) -> Result<Self> {
        places::note_flags_read(path);
        let text = read_text(path, "a script", SCRIPT_BYTES_MAX)?;
        let script = Script::read(text.as_bytes()).map_err(|error| of_file(path, error))?;
        Ok(Self { path: path.to_owned(), script, cut_short })
    }

    /// The settings of its last recipe.
    ///
    /// # Errors
    /// As [`Replay::read`].
    pub fn settings(&self) -> Result<Settings> {
        self.script.settings().map_err(|error| self.told(error))
    }

    /// Reads the picture at `input`, and looks what becomes of it.
    ///
    /// # Errors
    /// [`Error::Input`] if the picture cannot be read, or the script cannot be followed with it.
    pub fn outlook(&self, input: &Path) -> Result<(Picture, Outlook)> {
        let picture = match self.cut_short {
            CutShort::Refuse => Picture::open(input)?,
            CutShort::Take => Picture::open_lenient(input)?,
        };
        let outlook = self.script.outlook(&picture).map_err(|error| match error {
            Error::Parameter { name, reason, .. } if name == "picture" => Error::input(input, reason),
            other => self.told(other),
        })?;
        Ok((picture, outlook))
    }

    /// The evals at which it ends; `last` is the job of its last recipe.
    pub fn evals_planned(&self, last: &Job) -> u64 {
        self.script.evals_planned(last)
    }

    /// Follows it; nothing comes of it if `watch` returns false.
    ///
    /// # Errors
    /// As [`Replay::outlook`], or if the device fails.
    pub fn follow<'d>(
        &self,
        picture: &Picture,
        device: &'d Device,
        watch: &mut dyn FnMut(&mut Session<'_>) -> bool,
    ) -> Result<Option<Session<'d>>> {
        self.script.follow(picture, device, watch).map_err(|error| self.told(error))
    }

    /// What there is to say if it was recorded with another picture than that with this hash.
    pub fn note(&self, input: &Path, input_sha256: &str) -> Option<String> {
        (self.script.input_sha256 != input_sha256).then(|| {
            let (input, path) = (input.display(), self.path.display());
            format!("{input} is not the picture that {path} was recorded with, so the result is another")
        })
    }

    fn told(&self, error: Error) -> Error {
        of_file(&self.path, error)
    }
}

/// The refusal of a script, as one of the file that it is in.
fn of_file(path: &Path, error: Error) -> Error {
    match error {
        Error::Parameter { name, reason, .. } if name == "script" => Error::input(path, reason),
        other => other,
    }
}
