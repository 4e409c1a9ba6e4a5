//! How an animation came to be, told in its metadata, and whether a file may make room for it.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use serde_json::{Map, Value, json};
use sha2::{Digest, Sha256};

use super::frames::Spacing;
use super::options::TimelapseOptions;
use crate::app::options::Overwrite;
use crate::app::provenance::{KEYWORD, SOFTWARE, hexadecimal};
use crate::app::snapshots::Snapshot;
use crate::archive;
use crate::error::{Error, Result};
use crate::model::Canvas;
use crate::photo::Metadata;

/// What a snapshot tells about itself alone.
const OF_SNAPSHOT: [&str; 8] = ["births", "evals", "sae", "objective", "run", "status", "version", "software"];
/// Keyword of the key by itself.
const KEY_KEYWORD: &str = "smalti-key";
/// Bytes of a file that are looked through at a time.
const WINDOW_BYTES: usize = 1 << 20;

/// The provenance of an animation.
#[derive(Clone, Debug)]
pub(super) struct AnimationProvenance {
    /// SHA-256 over all that decides the animation, hexadecimal.
    pub key: String,
    /// The metadata as one JSON object.
    pub text: String,
}

impl AnimationProvenance {
    /// The metadata of the file.
    pub(super) fn metadata(&self) -> Metadata {
        // The blocks of a GIF would cut a key in the midst of a long text.
        vec![(KEY_KEYWORD.to_owned(), self.key.clone()), (KEYWORD.to_owned(), self.text.clone())]
    }
}

/// What decides an animation of these snapshots: their evolution, which of them are shown, and how.
///
/// # Errors
/// [`Error::Input`] if a snapshot cannot be read.
pub(super) fn of_animation(
    options: &TimelapseOptions,
    snapshots: &[&Snapshot],
    canvas: Canvas,
) -> Result<AnimationProvenance> {
    let mut told: Map<String, Value> = archive::read_meta(&snapshots[0].path)?;
    told.retain(|key, _| !OF_SNAPSHOT.contains(&key.as_str()));
    let run_key = told.remove("key");
    let evals: Vec<u64> = snapshots.iter().map(|snapshot| snapshot.evals).collect();
    let timing = options.timing(snapshots.len());
    let specific = json!({
        "content": "timelapse",
        "run_key": run_key,
        "width_px": canvas.width_px,
        "height_px": canvas.height_px,
        "background": options.background.map(|color| hexadecimal(&color)),
        "spacing": match options.spacing { Spacing::Error => "error", Spacing::Births => "births", Spacing::Snapshots => "snapshots" },
        "frames_per_s": timing.frames_per_s,
        "last_cs": timing.last_cs,
        "plays": timing.plays,
        "births_shown": evals,
    });
    if let Value::Object(specific) = specific {
        told.extend(specific);
    }
    told.sort_keys();
    let key = hexadecimal(&Sha256::digest(Value::Object(told.clone()).to_string()));
    told.remove("births_shown");
    told.insert("frames".to_owned(), snapshots.len().into());
    told.insert("key".to_owned(), key.clone().into());
    told.insert("software".to_owned(), SOFTWARE.into());
    told.insert("version".to_owned(), env!("CARGO_PKG_VERSION").into());
    told.sort_keys();
    Ok(AnimationProvenance { key, text: Value::Object(told).to_string() })
}

/// Refuses to replace a file that the same command would not have written: one without its key, whatever the format.
///
/// # Errors
/// [`Error::Usage`].
pub(super) fn check_replaceable(path: &Path, key: &str, overwrite: Overwrite) -> Result<()> {
    if overwrite == Overwrite::Force
        || !path.is_file()
        || File::open(path).is_ok_and(|file| holds(file, key.as_bytes()))
    {
        return Ok(());
    }
    let path = path.display();
    Err(Error::Usage(format!(
        "{path} exists and is not what this command writes; name another file, or replace it with --force"
    )))
}

/// Whether `bytes` occur in a file.
fn holds(mut file: impl Read, bytes: &[u8]) -> bool {
    let mut window = Vec::new();
    loop {
        // What begins at the end of one window goes on in the next.
        let kept = window.len().min(bytes.len() - 1);
        window.drain(..window.len() - kept);
        match file.by_ref().take(WINDOW_BYTES as u64).read_to_end(&mut window) {
            Ok(1..) if window.windows(bytes.len()).any(|part| part == bytes) => return true,
            Ok(1..) => {}
            _ => return false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_is_found_wherever_it_lies() {
        for place in [0, 1, WINDOW_BYTES - 3, WINDOW_BYTES, 2 * WINDOW_BYTES - 5] {
            let mut bytes = vec![b'.'; 2 * WINDOW_BYTES];
            bytes[place..place + 5].copy_from_slice(b"smalt");
            assert!(holds(&bytes[..], b"smalt"), "{place}");
            assert!(!holds(&bytes[..place + 4], b"smalt"), "{place}");
        }
    }
}
