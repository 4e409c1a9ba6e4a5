//! Animations of populations: `timelapse` shows those of one evolution, `video` those of a sequence.

mod apart;
mod ffmpeg;
mod file;
mod provenance;
mod shooting;

use std::borrow::Cow;
use std::fs::File;
use std::io::{self, BufWriter};

pub(super) use self::apart::take_apart;
use self::ffmpeg::{Codec, Ffmpeg};
pub(super) use self::file::{AnimationFile, AnimationFormat, FRAMES_PER_S_MAX, check_writable};
pub(super) use self::provenance::{AnimationProvenance, check_replaceable};
pub(super) use self::shooting::{Camera, End, Shown, shoot};
use crate::cli::terminal;
use crate::error::{Error, Result};
use crate::model::Mosaic;
use crate::output::PartialFile;
use crate::photo::{ApngEncoder, Frames, GifEncoder};

/// Says that a transparent mosaic is shown over black in this file.
pub(crate) fn say_shown_over_black(output: &AnimationFile) {
    let path = output.path.display();
    terminal::say(&format!("smalti: {path} cannot be transparent, so the mosaic is shown over black"));
}

/// An animation that grows frame by frame. If this is dropped before the end, no file remains.
pub(crate) struct Film {
    encoder: Encoder,
    // Must come after the encoder, which may still write to it when dropped.
    file: PartialFile,
    has_alpha: bool,
}

enum Encoder {
    Apng(ApngEncoder<BufWriter<File>>),
    Gif(GifEncoder<BufWriter<File>>),
    Ffmpeg(Ffmpeg),
}

impl Film {
    /// Begins an animation.
    ///
    /// # Errors
    /// [`Error::Output`] if it cannot be written, or a program that it needs is missing.
    pub(crate) fn open(output: &AnimationFile, frames: Frames, provenance: &AnimationProvenance) -> Result<Self> {
        let file = PartialFile::create(&output.path)?;
        let metadata = provenance.metadata();
        let writer = || file.writer().map(BufWriter::new);
        let failed = |error: io::Error| file.failure(&error);
        let ffmpeg = |codec| Ffmpeg::start(output, codec, file.growing_path(), &frames, &provenance.text);
        let encoder = match output.format {
            AnimationFormat::Apng => Encoder::Apng(ApngEncoder::new(writer()?, frames, &metadata).map_err(failed)?),
            AnimationFormat::Gif => Encoder::Gif(GifEncoder::new(writer()?, frames, &metadata).map_err(failed)?),
            AnimationFormat::Mp4 => Encoder::Ffmpeg(ffmpeg(Codec::H264)?),
            AnimationFormat::WebM => Encoder::Ffmpeg(ffmpeg(Codec::Vp9)?),
        };
        Ok(Self { encoder, file, has_alpha: frames.has_alpha })
    }

    /// Adds the next frame.
    ///
    /// # Errors
    /// [`Error::Output`].
    pub(crate) fn add(&mut self, frame: &Mosaic) -> Result<()> {
        let failed = |error: io::Error| self.file.failure(&error);
        let alpha = frame.alpha.as_deref().filter(|_| self.has_alpha);
        let pixels = if alpha.is_some() { Cow::Borrowed(&frame.pixels[..]) } else { frame.over_black() };
        match &mut self.encoder {
            Encoder::Apng(encoder) => encoder.add(&pixels, alpha).map_err(failed),
            Encoder::Gif(encoder) => encoder.add(&pixels, alpha).map_err(failed),
            Encoder::Ffmpeg(ffmpeg) => ffmpeg.add(frame),
        }
    }

    /// Ends the animation. Its file is then complete, but still has its temporary name.
    ///
    /// # Errors
    /// [`Error::Output`].
    pub(crate) fn finish(self) -> Result<PartialFile> {
        let Self { encoder, file, .. } = self;
        let finished: Result<(), Error> = match encoder {
            Encoder::Apng(encoder) => encoder.finish().map_err(|error| file.failure(&error)),
            Encoder::Gif(encoder) => encoder.finish().map_err(|error| file.failure(&error)),
            Encoder::Ffmpeg(ffmpeg) => ffmpeg.finish(),
        };
        finished.map(|()| file)
    }
}
