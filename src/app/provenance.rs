//! How a result came to be: everything that decides it, the key made from that, and the metadata in every output.
//!
//! Only what decides the result is told: never the device, driver, threads, paths, host or time. So the same command
//! writes the same bytes everywhere, and the key tells whether a file is what a command would write.

use serde_json::{Map, Value, json};
use sha2::{Digest, Sha256};

use super::destination::{Content, Destination};
use super::job::Job;
use super::options::{EvolveOptions, SchemeOptions};
use super::outputs::Told;
use super::report::Status;
use super::scheme;
use crate::archive;
use crate::error::Result;
use crate::evolve::{ALGORITHM_VERSION, Evolution, Outcome, StopReason};
use crate::model::cells::Standing;
use crate::model::{Blend, MaskSet, Population};
use crate::openraster;
use crate::photo::{self, Metadata};
use crate::vector;

/// The program's name in metadata.
pub(super) const SOFTWARE: &str = "smalti";
/// Keyword of the text chunk or comment that holds the metadata as JSON.
pub(super) const KEYWORD: &str = "smalti";
/// What the header of a population file already tells.
const HEADER_KEYS: [&str; 6] = ["width_px", "height_px", "background", "transparent", "blend", "grout"];

/// Everything that decides a result.
#[derive(Clone, Debug)]
pub(super) struct Provenance {
    decisive: Map<String, Value>,
    key: String,
}

/// How an evolution ended, as its outputs tell it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ending {
    pub status: Status,
    pub stop: StopReason,
    pub sae: u64,
    pub course: Course,
}

/// What an evolution counted on its way.
#[derive(Clone, Copy, Debug)]
pub(super) enum Course {
    Paper { outcome: Outcome, births_in_last_run: u64 },
    Cells(Standing),
}

impl Ending {
    /// The ending for this reason, with this SAE.
    pub(super) fn new(stop: StopReason, sae: u64, course: Course) -> Self {
        let status = if stop == StopReason::Interrupted { Status::Partial } else { Status::Complete };
        Self { status, stop, sae, course }
    }

    /// How `evolution`, which has ended, ended.
    pub(super) fn of(evolution: &Evolution) -> Self {
        let (outcome, births_in_last_run) = (evolution.outcome(), evolution.births_in_run());
        let stop = evolution.stop_reason().unwrap_or(StopReason::Births);
        Self::new(stop, evolution.best_sae().unwrap_or_default(), Course::Paper { outcome, births_in_last_run })
    }

    /// What was to be lowered, and the number of restarts before it came so low.
    pub(super) fn lowered(&self) -> (i64, u64) {
        match self.course {
            Course::Paper { outcome, .. } => (self.sae as i64, u64::from(outcome.restarts)),
            Course::Cells(standing) => (standing.objective, 0),
        }
    }
}

/// The provenance of everything that one command writes.
#[derive(Clone, Debug)]
pub(super) struct Provenances {
    /// Of the pictures of the mosaic, at the size that was asked for.
    pub picture: Provenance,
    /// Of the population, which has no size of its own.
    pub population: Provenance,
    /// Of the fitted picture.
    pub target: Provenance,
}

impl Provenances {
    /// What decides the outputs of `options`; `resized_px` is the longer side of the pictures, unless it is as evolved.
    pub(super) fn new(options: &EvolveOptions, job: &Job, resized_px: Option<u32>) -> Self {
        let target_sha256 = hexadecimal(&Sha256::digest(job.target.pixels().as_flattened()));
        Self {
            picture: Provenance::of_mosaic(options, job, &target_sha256, resized_px),
            population: Provenance::of_mosaic(options, job, &target_sha256, None),
            target: Provenance::of_target(job, &target_sha256),
        }
    }

    /// The one that the row of the result tells: of the pictures, if there are any.
    pub(super) fn of_row(&self, options: &EvolveOptions) -> &Provenance {
        if options.outputs.iter().any(Destination::is_picture) { &self.picture } else { &self.population }
    }

    /// What the outputs tell of an evolution that ended like `ending`.
    pub(super) fn told(&self, ending: &Ending) -> Told {
        Told { picture: self.picture.describe(Some(ending)), population: self.population.describe(Some(ending)) }
    }

    /// The one of an output of the evolution.
    pub(super) fn of_output(&self, output: &Destination) -> &Provenance {
        if output.is_picture() { &self.picture } else { &self.population }
    }
}

impl Provenance {
    /// What decides a mosaic.
    fn of_mosaic(options: &EvolveOptions, job: &Job, target_sha256: &str, resized_px: Option<u32>) -> Self {
        let mut specific = json!({
            "content": "mosaic",
            "algorithm": ALGORITHM_VERSION,
            "tiles": job.fly_count,
            "init_sha256": job.init.as_ref().map(population_sha256),
            "time_ms": options.time_limit.map(|limit| u64::try_from(limit.as_millis()).unwrap_or(u64::MAX)),
            "output_size_px": resized_px,
        });
        if let Value::Object(specific) = &mut specific {
            specific.extend(match &job.scheme {
                SchemeOptions::Paper(scheme) => scheme::decisive(scheme),
                SchemeOptions::Cells(cells) => cells.decisive(job),
            });
            if let Some(dress) = &job.dress {
                specific.insert("masks_sha256".to_owned(), masks_sha256(&dress.masks).into());
            }
            if let Some(count) = job.color_count {
                specific.insert("colors".to_owned(), count.into());
            }
            // Not of the fitted picture, which is the same with any weights.
            if let Some(weights) = job.target.weights() {
                specific.insert("weights_sha256".to_owned(), hexadecimal(&Sha256::digest(weights)).into());
            }
        }
        Self::new(job, target_sha256, specific)
    }

    /// What decides the fitted picture.
    fn of_target(job: &Job, target_sha256: &str) -> Self {
        Self::new(job, target_sha256, json!({ "content": "target" }))
    }

    fn new(job: &Job, target_sha256: &str, specific: Value) -> Self {
        let mut decisive = Map::new();
        decisive.insert("input_sha256".to_owned(), job.input_sha256.clone().into());
        // The file does not decide alone: another version of a decoder may make other pixels of it.
        decisive.insert("target_sha256".to_owned(), target_sha256.into());
        if let Some(transparent) = job.target.transparent() {
            let hash = hexadecimal(&Sha256::digest(bytemuck::cast_slice(transparent)));
            decisive.insert("transparent_sha256".to_owned(), hash.into());
        }
        decisive.insert("width_px".to_owned(), job.target.width_px().into());
        decisive.insert("height_px".to_owned(), job.target.height_px().into());
        decisive.insert("background".to_owned(), hexadecimal(&job.background).into());
        if let Value::Object(specific) = specific {
            decisive.extend(specific);
        }
        Self::of(decisive)
    }

    /// The provenance of what `decisive` decides.
    pub(super) fn of(mut decisive: Map<String, Value>) -> Self {
        // The order of the keys must not depend on the map that holds them.
        decisive.sort_keys();
        let key = hexadecimal(&Sha256::digest(Value::Object(decisive.clone()).to_string()));
        Self { decisive, key }
    }

    /// The provenance of what `more` decides, too, or decides instead.
    pub(super) fn with(&self, more: Map<String, Value>) -> Self {
        let mut decisive = self.decisive.clone();
        decisive.extend(more);
        Self::of(decisive)
    }

    /// Something that decides the result.
    pub(super) fn decisive(&self, word: &str) -> &Value {
        &self.decisive[word]
    }

    /// SHA-256 over everything that decides the result, 64 lower-case hexadecimal digits.
    pub(super) fn key(&self) -> &str {
        &self.key
    }

    /// The metadata as one JSON object: what decides the result, its key, and how the evolution ended.
    pub(super) fn describe(&self, ending: Option<&Ending>) -> Map<String, Value> {
        let mut told = self.decisive.clone();
        told.insert("software".to_owned(), SOFTWARE.into());
        told.insert("version".to_owned(), env!("CARGO_PKG_VERSION").into());
        told.insert("key".to_owned(), self.key.clone().into());
        if let Some(Ending { status, stop, sae, course }) = ending {
            told.insert("status".to_owned(), json!(status));
            told.insert("stop".to_owned(), stop.word().into());
            told.insert("sae".to_owned(), (*sae).into());
            told.extend(course.describe());
        }
        told.sort_keys();
        told
    }
}

impl Course {
    fn describe(&self) -> impl Iterator<Item = (String, Value)> {
        let told = match self {
            Self::Paper { outcome, births_in_last_run } => vec![
                ("births", json!(outcome.births)),
                ("births_in_last_run", json!(births_in_last_run)),
                ("fallback_kills", json!(outcome.fallback_kills)),
                ("restarts_made", json!(outcome.restarts)),
            ],
            Self::Cells(standing) => vec![
                ("objective", json!(standing.objective)),
                ("evals", json!(standing.evals)),
                ("births", json!(standing.births)),
            ],
        };
        told.into_iter().map(|(word, value)| (word.to_owned(), value))
    }
}

/// The metadata of a picture file that tells `told`.
pub(super) fn picture_metadata(told: &Map<String, Value>) -> Metadata {
    let software = format!("{SOFTWARE} {}", env!("CARGO_PKG_VERSION"));
    vec![("Software".to_owned(), software), (KEYWORD.to_owned(), Value::Object(told.clone()).to_string())]
}

/// The metadata of a population file that tells `told`, without what its header tells anyway.
pub(super) fn without_header(mut told: Map<String, Value>) -> Map<String, Value> {
    told.retain(|key, _| !HEADER_KEYS.contains(&key.as_str()));
    told
}

/// What a file tells about the result in it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Story {
    /// At least its first digits.
    pub key: String,
    /// Whether its evolution came to its end.
    pub is_complete: bool,
    /// What its evolution was to lower, as far as that came: the objective, or else the SAE; none for a fitted picture.
    pub lowered: Option<i64>,
    /// None for a fitted picture, and for a search in cells.
    pub restarts_made: Option<u64>,
}

impl Story {
    /// What metadata of smalti's tells.
    pub(super) fn told(told: &Map<String, Value>) -> Option<Self> {
        let text = |key| told.get(key).and_then(Value::as_str);
        let key = text("key")?.to_owned();
        // An unknown word is a result that somebody may want to keep.
        let is_complete = text("status") != Some("partial");
        let lowered = told.get("objective").or(told.get("sae")).and_then(Value::as_i64);
        let restarts_made = told.get("restarts_made").and_then(Value::as_u64);
        Some(Self { key, is_complete, lowered, restarts_made })
    }

    /// Whether the file is of what has this key.
    pub(super) fn is_of(&self, key: &str) -> bool {
        self.key.len() >= archive::KEY_DIGITS && key.starts_with(&self.key)
    }

    /// Whether the file should stay rather than make room for a result with the same key that ended like `ending`.
    ///
    /// Both are cut from one course, so the one of a later run got farther, and within a run the one of the lower SAE or
    /// objective. SAEs of different runs tell nothing: masks may have changed between them, or tiles split.
    pub(super) fn is_better_than(&self, ending: &Ending) -> bool {
        let new_is_complete = ending.status == Status::Complete;
        if self.is_complete != new_is_complete {
            return self.is_complete;
        }
        let (old_runs, (new, new_runs)) = (self.restarts_made.unwrap_or_default(), ending.lowered());
        old_runs > new_runs || old_runs == new_runs && self.lowered.is_some_and(|old| old < new)
    }
}

/// The story of the file at a destination, if smalti wrote it.
pub(super) fn story_of_file(destination: &Destination) -> Option<Story> {
    told_by_file(destination).and_then(|told| Story::told(&told))
}

/// The metadata of the file at a destination, if smalti wrote it.
pub(super) fn told_by_file(destination: &Destination) -> Option<Map<String, Value>> {
    let path = &destination.path;
    let told = match destination.content {
        Content::Population => archive::read_meta(path).ok()?,
        Content::Json => archive::read_json_meta(path).ok()??,
        Content::Png | Content::Jpeg | Content::WebP => picture_description(photo::read_metadata(path)).ok()??,
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

/// SHA-256 over what evolves from a population: its flies and masks, whatever file held them.
pub(super) fn population_sha256(population: &Population) -> String {
    let mut hash = Sha256::new();
    for fly in &population.flies {
        let genes = [fly.x as u32, fly.y as u32, fly.z, fly.w, fly.h];
        let channels = [fly.r, fly.g, fly.b, fly.angle, fly.mask, u16::from(fly.alive)];
        genes.iter().for_each(|gene| hash.update(gene.to_le_bytes()));
        channels.iter().for_each(|channel| hash.update(channel.to_le_bytes()));
    }
    hash_masks(&population.masks, &mut hash);
    hexadecimal(&hash.finalize())
}

/// SHA-256 over the texels of masks and how they are read, whatever file held them.
fn masks_sha256(masks: &MaskSet) -> String {
    let mut hash = Sha256::new();
    hash_masks(masks, &mut hash);
    hexadecimal(&hash.finalize())
}

fn hash_masks(masks: &MaskSet, hash: &mut Sha256) {
    for mask in masks.layers() {
        hash.update(bytemuck::cast_slice(mask.texels()));
    }
    if masks.blend() == Blend::Translucent {
        hash.update(b"translucent");
    }
}

/// Two lower-case digits for each byte.
pub(super) fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::sync::Arc;

    use super::*;
    use crate::app::job::tests::plan;
    use crate::model::Target;

    #[test]
    fn weights_and_transparency_are_in_the_keys_of_what_they_decide_and_nowhere_if_there_are_none() {
        let (options, mut job) = plan(&Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/photos/rgb.png"), &[]);
        let plain = job.target.as_ref().clone();
        let count = plain.pixels().len();
        let mut provenances = |target: Result<Target>| {
            job.target = Arc::new(target.expect("the planes fit"));
            let Provenances { picture, population, target } = Provenances::new(&options, &job, None);
            [picture, population, target]
        };
        let keys = |all: &[Provenance; 3]| all.each_ref().map(|provenance| provenance.key().to_owned());
        let tells = |all: &[Provenance; 3], word| all.each_ref().map(|one| one.describe(None).contains_key(word));
        let (mut weights, mut transparent) = (vec![1; count], vec![false; count]);
        let of_plain = provenances(Ok(plain.clone()));
        let of_even = provenances(plain.clone().with_weights(vec![16; count]));
        assert_eq!(keys(&of_even), keys(&of_plain));
        (weights[7], transparent[7]) = (2, true);
        let of_weighted = provenances(plain.clone().with_weights(weights));
        let of_cut = provenances(plain.with_transparent(transparent));
        for (all, weighted, cut) in [
            (&of_plain, [false; 3], [false; 3]),
            (&of_weighted, [true, true, false], [false; 3]),
            (&of_cut, [false; 3], [true; 3]),
        ] {
            assert_eq!((tells(all, "weights_sha256"), tells(all, "transparent_sha256")), (weighted, cut));
            for (index, is_told) in weighted.into_iter().zip(cut).map(|(weighted, cut)| weighted || cut).enumerate() {
                assert_eq!(keys(all)[index] != keys(&of_plain)[index], is_told, "key {index}");
            }
        }
    }

    #[test]
    fn of_two_results_of_one_command_the_complete_one_is_better_then_the_later_run_then_the_lower_sae() {
        use Status::{Complete, Partial};
        let ending = |status, restarts, sae| Ending {
            status,
            stop: StopReason::Time,
            sae,
            course: Course::Paper { outcome: Outcome { restarts, ..Outcome::default() }, births_in_last_run: 0 },
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
