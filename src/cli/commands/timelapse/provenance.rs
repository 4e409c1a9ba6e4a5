//! The metadata of a timelapse, which tell how it was made.

use serde_json::{Map, Value, json};
use sha2::{Digest, Sha256};

use super::frames::Spacing;
use super::options::TimelapseOptions;
use crate::archive;
use crate::cli::files::snapshots::Snapshot;
use crate::cli::film::AnimationProvenance;
use crate::error::Result;
use crate::model::Backdrop;
use crate::photo::Frames;
use crate::studio::{SOFTWARE, hexadecimal};

/// Metadata that differ from snapshot to snapshot.
const OF_SNAPSHOT: [&str; 8] = ["births", "evals", "sae", "objective", "run", "status", "version", "software"];

/// Everything that decides an animation of these snapshots: their evolution, which of them are shown, and how.
///
/// # Errors
/// [`Error::Input`] if a snapshot cannot be read.
pub(super) fn of_animation(
    options: &TimelapseOptions,
    snapshots: &[&Snapshot],
    frames: &Frames,
) -> Result<AnimationProvenance> {
    let mut told: Map<String, Value> = archive::read_meta(&snapshots[0].path)?;
    told.retain(|key, _| !OF_SNAPSHOT.contains(&key.as_str()));
    let run_key = told.remove("key");
    let evals: Vec<u64> = snapshots.iter().map(|snapshot| snapshot.evals).collect();
    let Frames { size_px: (width_px, height_px), timing, has_alpha } = *frames;
    let specific = json!({
        "content": "timelapse",
        "run_key": run_key,
        "width_px": width_px,
        "height_px": height_px,
        "background": options.background.map(|background| match background {
            Backdrop::Color(color) => hexadecimal(&color),
            Backdrop::Transparent => "none".to_owned(),
        }),
        "spacing": match options.spacing { Spacing::Error => "error", Spacing::Births => "births", Spacing::Snapshots => "snapshots" },
        "frames_per_s": timing.frames_per_s,
        "last_cs": timing.last_cs,
        "plays": timing.plays,
        "births_shown": evals,
    });
    if let Value::Object(specific) = specific {
        told.extend(specific);
    }
    if has_alpha {
        told.insert("transparent".to_owned(), true.into());
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
