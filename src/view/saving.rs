//! Writing what the window shows: the same bytes as the command that it shows beside.

use std::path::{Path, PathBuf};

use super::news::SaveOrder;
use super::opened::Open;
use crate::error::Result;
use crate::output;
use crate::studio::{Device, Script, Session, quoted};

/// Draws the tiles of the first file into the second, with a longer side in px or as they evolved.
pub(crate) type Redraw = fn(&Path, &Path, Option<u32>) -> Result<()>;

/// Writes a file, and beside it what else the command needs that makes it again; a sentence about them.
///
/// # Errors
/// If the device fails, the format cannot hold the mosaic, or the file cannot be written.
pub(super) fn save(
    session: &mut Session<'_>,
    script: &Script,
    open: &Open,
    device: &Device,
    save: &SaveOrder,
) -> Result<String> {
    output::check_writable(&save.path)?;
    let is_at_end = session.stop_reason().is_some();
    let mut mosaic = session.mosaic()?;
    if let Some(px) = save.long_side_px {
        mosaic = mosaic.resized(px, device)?;
    }
    mosaic.save(&save.path)?;
    let mut wrote = save.path.display().to_string();
    let mut input = open.path().map(Path::to_owned);
    if let Some(bytes) = &open.pasted {
        let source = beside(&save.path, "source.png");
        output::write_atomically(&source, bytes)?;
        wrote += &format!(", {}", super::name_of(&source));
        input = Some(source);
    }
    if !can_be_asked_for(script, is_at_end) {
        let steps = beside(&save.path, "steps.json");
        let script = Script { until: session.until(), ..script.clone() };
        // The mosaic is there, whatever becomes of its steps.
        if let Err(error) = script.write().and_then(|bytes| output::write_atomically(&steps, &bytes)) {
            return Ok(format!("Wrote {wrote}, but not its steps, so that no command makes it again: {error}"));
        }
        wrote += &format!(", {}", super::name_of(&steps));
    }
    Ok(format!("Saved {wrote}.\nTo make it again: {}", command(script, is_at_end, input.as_deref(), Some(save))))
}

/// Whether flags alone ask for the same mosaic: it was not steered, nor ended by hand.
fn can_be_asked_for(script: &Script, is_at_end: bool) -> bool {
    is_at_end && script.steps.len() == 1 && script.steps[0].recipe.flags().is_some()
}

/// A file beside an output, whose whole name it has, since another format has other steps.
fn beside(path: &Path, ending: &str) -> PathBuf {
    path.with_file_name(format!("{}.{ending}", super::name_of(path)))
}

/// The command that makes the mosaic again. A search that is still running is told as if it went on to its end.
pub(super) fn command(script: &Script, is_at_end: bool, input: Option<&Path>, save: Option<&SaveOrder>) -> String {
    let word = |path: &Path| quoted(&path.display().to_string());
    let input = input.map_or_else(|| "PICTURE".to_owned(), word);
    let output = save.map_or_else(|| Path::new("mosaic.png"), |save| &save.path);
    let size = save.and_then(|save| save.long_side_px).map_or_else(String::new, |px| format!(" --output-size {px}"));
    let flags = match script.steps.as_slice() {
        [step] if is_at_end || save.is_none() => step.recipe.flags(),
        _ => None,
    };
    let rest = match flags {
        Some(flags) => flags.iter().map(|flag| format!(" {}", quoted(flag))).collect(),
        None => format!(" --replay {}", word(&beside(output, "steps.json"))),
    };
    format!("smalti evolve {input} -o {}{rest}{size}", word(output))
}
