//! Seeing inside: traces of what threads and devices do when (`--trace`), and RenderDoc captures (`--capture`).
//!
//! A [`Tracer`] is part of a picture's options, so whatever works on the picture can record what it does. A command
//! that works on many pictures gives each of them a copy of the same tracer.

mod capture;
mod device_track;
mod in_application;
mod traced;
mod tracer;

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;

pub(super) use self::capture::{Capture, CaptureRange};
use self::device_track::DeviceTrack;
pub(super) use self::traced::TraceInstruments;
pub(super) use self::tracer::Tracer;
use crate::cli::files::destination::Overwrite;
use crate::cli::files::places::Inputs;
use crate::error::{Error, NoDevice, Result};
use crate::studio::Device;

/// The flags.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Seeing inside")]
pub(super) struct TraceArgs {
    /// Write what threads and devices did at what time, to be seen in ui.perfetto.dev; the result stays the same
    #[arg(long, value_name = "FILE")]
    pub trace: Option<PathBuf>,
    /// Let RenderDoc capture some submissions to the Vulkan device: the first, counted from 1, and how many
    ///
    /// smalti must run under renderdoccmd capture.
    #[arg(long, value_name = "FIRST[+COUNT]", value_parser = capture::range)]
    pub capture: Option<CaptureRange>,
}

/// Begins the trace at `path`.
///
/// # Errors
/// [`Error::Usage`] if the file is one of `taken`, or exists and is not a trace of ours; [`Error::Output`] if it cannot
/// be written.
pub(super) fn begin_trace(path: &Path, taken: &[&Path], overwrite: Overwrite) -> Result<Tracer> {
    if Inputs::new(taken.iter().copied()).has(path) {
        let path = path.display();
        return Err(Error::Usage(format!("--trace {path}: it is an input or another output; name another file")));
    }
    if overwrite == Overwrite::Refuse && path.is_file() && !is_trace(path) {
        let path = path.display();
        return Err(Error::Usage(format!(
            "{path} exists and was not made by smalti; name another file, or replace it with --force"
        )));
    }
    Tracer::begin(path)
}

/// Whether a file begins as our traces do.
fn is_trace(path: &Path) -> bool {
    let mut head = Vec::new();
    let most = tracer::HEAD.len() as u64;
    File::open(path).and_then(|file| file.take(most).read_to_end(&mut head)).is_ok() && head == tracer::HEAD.as_bytes()
}

/// Records in the trace, if there is one, everything that the device is given.
pub(super) fn trace_device(tracer: &Tracer, device: &Device) {
    if let Some(device) = device.vulkan()
        && let Some(track) = DeviceTrack::new(tracer, device)
    {
        device.observe(Arc::new(track));
    }
}

/// Prepares a capture on the device.
///
/// # Errors
/// [`Error::NoSuitableDevice`] if it is the CPU; [`Error::Usage`] if RenderDoc is not loaded.
pub(super) fn begin_capture(range: CaptureRange, device: &Device) -> Result<Arc<Capture>> {
    let Some(device) = device.vulkan() else {
        let why = "--capture records a Vulkan device, and the CPU would compute; name one, such as --device vulkan";
        return Err(Error::NoSuitableDevice { why: NoDevice::Other(why.to_owned()) });
    };
    let capture = Arc::new(Capture::new(range, device)?);
    device.observe(Arc::<Capture>::clone(&capture));
    Ok(capture)
}
