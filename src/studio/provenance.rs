//! How a result came to be: everything that decides it, the key made from that, and the metadata in every output.
//!
//! Only what decides the result is told: never the device, driver, threads, paths, host or time. So the same command
//! writes the same bytes everywhere, and the key tells whether a file is what a command would write.

use serde_json::{Map, Value, json};
use sha2::{Digest, Sha256};

use super::asked::{OUTPUT_SIZE, asked};
use super::cells::{CellsSettings, MaskLayers};
use super::hashes::{masks_sha256, population_sha256};
use super::hex::hexadecimal;
use super::job::Job;
use super::paper;
use super::settings::{SchemeSettings, Settings};
use crate::evolve::{ALGORITHM_VERSION, Ending, Tally};
use crate::model::Blend;
use crate::photo::Metadata;

/// The program's name in metadata.
pub(crate) const SOFTWARE: &str = "smalti";
/// Keyword of the text chunk or comment that holds the metadata as JSON.
pub(crate) const KEYWORD: &str = "smalti";
/// What the header of a population file already tells.
const HEADER_KEYS: [&str; 6] = ["width_px", "height_px", "background", "transparent", "blend", "grout"];

/// Everything that decides a result.
#[derive(Clone, Debug)]
pub(crate) struct Provenance {
    decisive: Map<String, Value>,
    key: String,
}

/// The provenance of everything that is made of one picture.
#[derive(Clone, Debug)]
pub(crate) struct Provenances {
    /// Of the pictures of the mosaic, at the size that was asked for.
    pub picture: Provenance,
    /// Of the population, which has no size of its own.
    pub population: Provenance,
    /// Of the fitted picture.
    pub target: Provenance,
}

impl Provenances {
    /// What decides the outputs of a job; `resized_px` is the longer side of the pictures, unless it is as evolved.
    pub(crate) fn new(settings: &Settings, job: &Job, resized_px: Option<u32>) -> Self {
        let target_sha256 = hexadecimal(&Sha256::digest(job.target.pixels().as_flattened()));
        let mosaic = |resized_px| {
            let specific = mosaic_specific(settings, job, resized_px, ALGORITHM_VERSION);
            Provenance::new(job, &target_sha256, specific)
        };
        Self {
            picture: mosaic(resized_px),
            population: mosaic(None),
            target: Provenance::new(job, &target_sha256, Map::from_iter([("content".to_owned(), "target".into())])),
        }
    }

    /// What the outputs tell of an evolution that ended like `ending`.
    pub(crate) fn told(&self, ending: &Ending) -> Told {
        Told { picture: self.picture.describe(Some(ending)), population: self.population.describe(Some(ending)) }
    }
}

/// The metadata of the outputs.
#[derive(Clone, Debug)]
pub(crate) struct Told {
    pub picture: Map<String, Value>,
    pub population: Map<String, Value>,
}

/// What decides a mosaic, besides its picture. The version of the algorithm is of both schemes: raising it raises every
/// key.
fn mosaic_specific(settings: &Settings, job: &Job, resized_px: Option<u32>, version: u32) -> Map<String, Value> {
    let specific = json!({
        "content": content(&job.scheme),
        "algorithm": version,
        "tiles": job.fly_count,
        "init_sha256": job.init.as_deref().map(population_sha256),
        "time_ms": settings.time_limit.map(|limit| u64::try_from(limit.as_millis()).unwrap_or(u64::MAX)),
        "output_size_px": resized_px,
        "recipe": asked(settings, job, resized_px),
    });
    let mut specific = if let Value::Object(specific) = specific { specific } else { Map::new() };
    specific.extend(match &job.scheme {
        SchemeSettings::Paper(scheme) => paper::decisive(scheme),
        SchemeSettings::Cells(cells) => {
            let laid = job.laid(MaskLayers { first: 0, count: 1 });
            let layers_by_run = job.dress.as_ref().map(|dress| &dress.layers_by_run);
            cells.decisive(&laid, job.palette.as_ref(), layers_by_run)
        }
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
    specific
}

/// What a picture of this scheme is called.
fn content(scheme: &SchemeSettings) -> &'static str {
    let has_strokes = |cells: &CellsSettings| cells.style().is_stroke || cells.style().blend == Blend::Translucent;
    match scheme {
        SchemeSettings::Cells(cells) if has_strokes(cells) => "painting",
        SchemeSettings::Cells(_) | SchemeSettings::Paper(_) => "mosaic",
    }
}

impl Provenance {
    fn new(job: &Job, target_sha256: &str, specific: Map<String, Value>) -> Self {
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
        let background = if job.is_bare { "none".to_owned() } else { hexadecimal(&job.background) };
        decisive.insert("background".to_owned(), background.into());
        decisive.extend(specific);
        Self::of(decisive)
    }

    /// The provenance of what `decisive` decides.
    pub(crate) fn of(mut decisive: Map<String, Value>) -> Self {
        // The order of the keys must not depend on the map that holds them.
        decisive.sort_keys();
        let key = hexadecimal(&Sha256::digest(Value::Object(decisive.clone()).to_string()));
        Self { decisive, key }
    }

    /// The provenance of what `more` decides, too, or decides instead.
    pub(crate) fn with(&self, more: Map<String, Value>) -> Self {
        let mut decisive = self.decisive.clone();
        decisive.extend(more);
        Self::of(decisive)
    }

    /// The provenance of the same mosaic drawn with a longer side of `resized_px`, or as it evolved.
    pub(crate) fn resized(&self, resized_px: Option<u32>) -> Self {
        let mut recipe = self.decisive("recipe").as_object().cloned().unwrap_or_default();
        match resized_px {
            Some(px) => recipe.insert(OUTPUT_SIZE.to_owned(), px.into()),
            None => recipe.remove(OUTPUT_SIZE),
        };
        self.with(Map::from_iter([
            ("output_size_px".to_owned(), json!(resized_px)),
            ("recipe".to_owned(), Value::Object(recipe)),
        ]))
    }

    /// Something that decides the result.
    pub(crate) fn decisive(&self, word: &str) -> &Value {
        self.decisive.get(word).unwrap_or(&Value::Null)
    }

    /// SHA-256 over everything that decides the result, 64 lower-case hexadecimal digits.
    pub(crate) fn key(&self) -> &str {
        &self.key
    }

    /// The metadata as one JSON object: what decides the result, its key, and how the evolution ended.
    pub(crate) fn describe(&self, ending: Option<&Ending>) -> Map<String, Value> {
        let mut told = self.decisive.clone();
        told.insert("software".to_owned(), SOFTWARE.into());
        told.insert("version".to_owned(), env!("CARGO_PKG_VERSION").into());
        told.insert("key".to_owned(), self.key.clone().into());
        if let Some(ending) = ending {
            told.insert("status".to_owned(), if ending.is_complete() { "complete" } else { "partial" }.into());
            told.insert("stop".to_owned(), ending.stop.word().into());
            told.insert("sae".to_owned(), ending.sae.into());
            told.extend(counted(&ending.tally));
        }
        told.sort_keys();
        told
    }
}

fn counted(tally: &Tally) -> impl Iterator<Item = (String, Value)> {
    let told = match tally {
        Tally::Paper { outcome, births_in_last_run, .. } => vec![
            ("births", json!(outcome.births)),
            ("births_in_last_run", json!(births_in_last_run)),
            ("fallback_kills", json!(outcome.fallback_kills)),
            ("restarts_made", json!(outcome.restarts)),
        ],
        Tally::Cells(standing) => vec![
            ("objective", json!(standing.objective)),
            ("evals", json!(standing.evals)),
            ("births", json!(standing.births)),
        ],
    };
    told.into_iter().map(|(word, value)| (word.to_owned(), value))
}

/// The metadata of a picture file that tells `told`.
pub(crate) fn picture_metadata(told: &Map<String, Value>) -> Metadata {
    let software = format!("{SOFTWARE} {}", env!("CARGO_PKG_VERSION"));
    vec![("Software".to_owned(), software), (KEYWORD.to_owned(), Value::Object(told.clone()).to_string())]
}

/// The metadata of a population file that tells `told`, without what its header tells anyway.
pub(crate) fn without_header(mut told: Map<String, Value>) -> Map<String, Value> {
    told.retain(|key, _| !HEADER_KEYS.contains(&key.as_str()));
    told
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::sync::Arc;

    use super::*;
    use crate::error::Result;
    use crate::model::Target;
    use crate::studio::Recipe;

    fn job(recipe: &Recipe) -> (Settings, Job) {
        let settings = Settings::new(recipe).expect("the recipe is right");
        let photo = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/photos/rgb.png");
        let job = Job::load(&photo, &settings).expect("the picture can be read");
        (settings, job)
    }

    #[test]
    fn another_version_of_the_algorithm_is_another_key_in_both_schemes() {
        for recipe in [Recipe::new(), Recipe::mosaic(), Recipe::spray(), Recipe::paper()] {
            let (settings, job) = job(&recipe);
            let key = |version| {
                let specific = mosaic_specific(&settings, &job, None, version);
                Provenance::new(&job, "", specific).key().to_owned()
            };
            assert_ne!(key(ALGORITHM_VERSION), key(ALGORITHM_VERSION + 1), "{recipe:?}");
            let provenances = Provenances::new(&settings, &job, None);
            for provenance in [&provenances.picture, &provenances.population] {
                assert_eq!(provenance.decisive("algorithm"), &json!(ALGORITHM_VERSION), "{recipe:?}");
            }
        }
    }

    #[test]
    fn weights_and_transparency_are_in_the_keys_of_what_they_decide_and_nowhere_if_there_are_none() {
        let (settings, mut job) = job(&Recipe::new());
        let plain = job.target.as_ref().clone();
        let count = plain.pixels().len();
        let mut provenances = |target: Result<Target>| {
            job.target = Arc::new(target.expect("the planes fit"));
            let Provenances { picture, population, target } = Provenances::new(&settings, &job, None);
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
}
