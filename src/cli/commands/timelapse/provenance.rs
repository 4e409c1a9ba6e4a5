//! The metadata of a timelapse, which tell how it was made.

use serde_json::{Map, Value, json};
use sha2::{Digest, Sha256};

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

/// What was asked for of an animation, without what was not.
fn without_null(mut value: Value) -> Value {
    if let Value::Object(map) = &mut value {
        map.retain(|_, value| !value.is_null());
    }
    value
}

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
    let background = options.background.map(|background| match background {
        Backdrop::Color(color) => hexadecimal(&color),
        Backdrop::Transparent => "none".to_owned(),
    });
    let spacing = options.spacing.word();
    let specific = json!({
        "content": "timelapse",
        "run_key": run_key,
        "width_px": width_px,
        "height_px": height_px,
        "background": background,
        "spacing": spacing,
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
    let animation = json!({
        "output-size": options.long_side_px,
        "background": background,
        "fps": timing.frames_per_s,
        "frames": options.frame_count,
        "spacing": spacing,
        "hold": f64::from(timing.last_cs) / 100.0,
        "loop": timing.plays,
    });
    told.insert("animation".to_owned(), without_null(animation));
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
