//! What the user asks for one picture.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::replay::Replay;
use crate::cli::args::picture::PictureArgs;
use crate::cli::files::destination::Destination;
use crate::cli::terminal::Verbosity;
use crate::cli::terminal::progress::ProgressKind;
use crate::cli::trace::Tracer;
use crate::cli::values;
use crate::error::Result;
use crate::studio::{Scheme, Settings};

/// What one picture is to become, and how much is said during the work.
#[derive(Clone, Debug)]
pub(crate) struct PictureOptions {
    pub input: PathBuf,
    pub outputs: Vec<Destination>,
    /// Everything that decides the mosaic, except its picture.
    pub settings: Arc<Settings>,
    /// The script that decides the mosaic instead; `settings` are those of its end.
    pub replay: Option<Arc<Replay>>,
    /// Longer side of the written picture in px; `None` writes it as evolved.
    pub output_long_side_px: Option<u32>,
    pub progress: ProgressKind,
    pub verbosity: Verbosity,
    /// Records what the work on the picture does when.
    pub tracer: Tracer,
}

impl PictureOptions {
    /// The options that all pictures evolved with these flags share. The input and the outputs are still empty.
    ///
    /// # Errors
    /// As [`PictureArgs::settings`].
    pub fn new(args: &PictureArgs, verbosity: Verbosity) -> Result<Self> {
        Ok(Self {
            input: PathBuf::new(),
            outputs: Vec::new(),
            settings: Arc::new(args.settings()?),
            replay: None,
            output_long_side_px: args.output_size.map(|px| values::side_px("--output-size", px)).transpose()?,
            progress: ProgressKind::None,
            verbosity,
            tracer: Tracer::default(),
        })
    }

    /// How it evolves.
    pub fn scheme(&self) -> Scheme {
        self.settings.scheme.name()
    }

    /// The number that decides every random choice.
    pub fn seed(&self) -> u64 {
        self.settings.scheme.seed()
    }

    /// All files that are read for the picture. None of them may be overwritten.
    pub fn files_read(&self) -> impl Iterator<Item = &Path> {
        std::iter::once(self.input.as_path()).chain(self.settings.files_read())
    }

    /// Longer side of the written picture in px, if it differs from the size at which the mosaic was evolved.
    pub fn resized_px(&self, width_px: u32, height_px: u32) -> Option<u32> {
        self.output_long_side_px.filter(|&long| long != width_px.max(height_px))
    }
}
