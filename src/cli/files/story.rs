//! What a file that smalti wrote tells of the result in it.

use serde_json::{Map, Value};

use super::destination::Destination;
use crate::error::Result;
use crate::evolve::Ending;
use crate::photo::{self, Metadata};
use crate::studio::{Content, KEYWORD, SOFTWARE};
use crate::{archive, openraster, vector};

/// What a file tells about the result in it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Story {
    /// The key of the result, or at least its first digits.
    pub key: String,
    /// Whether the evolution ran to its end.
    pub is_complete: bool,
    /// The value that the evolution had lowered so far: the objective or, without one, the SAE. None for a fitted
    /// picture.
    pub lowered: Option<i64>,
    /// None for a fitted picture, and for a search in cells.
    pub restarts_made: Option<u64>,
}

impl Story {
    /// The story in metadata that smalti wrote.
    pub(crate) fn told(told: &Map<String, Value>) -> Option<Self> {
        let text = |key| told.get(key).and_then(Value::as_str);
        let key = text("key")?.to_owned();
        // A file with an unknown status counts as complete, since somebody may want to keep it.
        let is_complete = text("status") != Some("partial");
        let lowered = told.get("objective").or(told.get("sae")).and_then(Value::as_i64);
        let restarts_made = told.get("restarts_made").and_then(Value::as_u64);
        Some(Self { key, is_complete, lowered, restarts_made })
    }

    /// Whether the file holds the result with this key.
    pub(crate) fn is_of(&self, key: &str) -> bool {
        self.key.len() >= archive::KEY_DIGITS && key.starts_with(&self.key)
    }

    /// Whether the file should stay, rather than be replaced by a result with the same key that ended like `ending`.
    ///
    /// Both are cut from one course. So the one of a later run got farther and, within a run, the one with the lower
    /// SAE or objective. SAEs of different runs cannot be compared: masks may have changed between them, or tiles
    /// split.
    pub(crate) fn is_better_than(&self, ending: &Ending) -> bool {
        if self.is_complete != ending.is_complete() {
            return self.is_complete;
        }
        let old_runs = self.restarts_made.unwrap_or_default();
        let (new, new_runs) = (ending.objective(), u64::from(ending.restarts()));
        old_runs > new_runs || old_runs == new_runs && self.lowered.is_some_and(|old| old < new)
    }
}

/// The story of the file at a destination, if smalti wrote it.
pub(crate) fn story_of_file(destination: &Destination) -> Option<Story> {
    told_by_file(destination).and_then(|told| Story::told(&told))
}

/// The metadata of the file at a destination, if smalti wrote it.
pub(crate) fn told_by_file(destination: &Destination) -> Option<Map<String, Value>> {
    let path = &destination.path;
    let told = match destination.content {
        Content::Population => archive::read_meta(path).ok()?,
        Content::Json => archive::read_json_meta(path).ok()??,
        Content::Png | Content::Jpeg(_) | Content::WebP => picture_description(photo::read_metadata(path)).ok()??,
        Content::OpenRaster => picture_description(openraster::read_metadata(path)).ok()??,
        Content::Svg => vector::read_meta(path).ok()??,
        Content::Csv => archive::read_csv_meta(path).ok()??,
    };
    let is_ours = destination.content == Content::Csv || told.get("software").and_then(Value::as_str) == Some(SOFTWARE);
    is_ours.then_some(told)
}

fn picture_description(metadata: Result<Metadata>) -> Result<Option<Map<String, Value>>> {
    let told = metadata?.into_iter().find(|(keyword, _)| keyword == KEYWORD);
    Ok(told.and_then(|(_, text)| serde_json::from_str(&text).ok()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evolve::{Outcome, StopReason, Tally};

    #[test]
    fn of_two_results_of_one_command_the_complete_one_is_better_then_the_later_run_then_the_lower_sae() {
        use StopReason::{Interrupted as Partial, Time as Complete};
        let ending = |stop, restarts, sae| {
            let outcome = Outcome { restarts, ..Outcome::default() };
            Ending { stop, sae, tally: Tally::Paper { outcome, births_in_last_run: 0, is_warming_up: false } }
        };
        let story = |is_complete, restarts_made, sae| Story {
            key: String::new(),
            is_complete,
            lowered: Some(sae),
            restarts_made: Some(restarts_made),
        };
        for (is_complete, old, status, new, stays) in [
            (true, (0, 9), Partial, (0, 8), true),
            (false, (0, 8), Complete, (0, 9), false),
            (true, (0, 8), Complete, (0, 9), true),
            (true, (0, 9), Complete, (0, 8), false),
            (true, (0, 9), Complete, (0, 9), false),
            (false, (0, 8), Partial, (0, 9), true),
            (false, (0, 8), Partial, (1, 9), false),
            (false, (1, 9), Partial, (0, 8), true),
            (true, (0, 8), Complete, (1, 9), false),
            (true, (1, 9), Complete, (0, 8), true),
        ] {
            let is_better = story(is_complete, old.0, old.1).is_better_than(&ending(status, new.0, new.1));
            assert_eq!(is_better, stays, "{is_complete} {old:?}, then {status:?} {new:?}");
        }
    }
}
