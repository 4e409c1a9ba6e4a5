//! A script: the recipes of a session as a file, with the evals at which each took over. It makes the same bytes again.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::device::Device;
use super::job::Job;
use super::mosaic::Mosaic;
use super::parameters::contradiction;
use super::picture::Picture;
use super::provenance::Provenances;
use super::recipe::Recipe;
use super::session::{Session, check_goes_on};
use super::settings::Settings;
use super::story::Story;
use super::text_file::brief;
use super::written::WrittenRecipe;
use crate::error::{Error, Result};

/// Most bytes of a script: 64 MiB, since it may carry masks and maps.
pub const SCRIPT_BYTES_MAX: u64 = 1 << 26;

/// What a file says that it is.
const KIND: &str = "script";
/// The version of the format that is written, the only one that is read.
const VERSION: u64 = 1;

/// The recipes of a session, and when each took over.
///
/// [`Script::replay`] makes of the same picture the bytes that the session made. A session is recorded by noting
/// [`Session::evals`] and the recipe of each change, and at the end [`Session::until`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Script {
    /// [`Picture::sha256`] of the picture of the session.
    pub input_sha256: String,
    /// What was asked for, in order; the first one at 0 evals.
    pub steps: Vec<Step>,
    /// The evals at which the session was ended; without it, the last recipe ends it.
    pub until: Option<u64>,
}

/// A recipe that takes over.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Step {
    /// The evals at which it does: those of [`Session::evals`] before [`Session::change`].
    pub evals: u64,
    /// What is asked for from then on.
    pub recipe: WrittenRecipe,
}

/// A script as it stands in its file.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct File {
    smalti: String,
    version: u64,
    input_sha256: String,
    steps: Vec<Step>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    until: Option<u64>,
}

/// What a script leads to, as far as that is known before it is followed.
#[derive(Debug)]
pub(crate) struct Outlook {
    /// What is asked for in the end.
    pub job: Job,
    /// What decides the result.
    pub provenances: Provenances,
}

impl Script {
    /// The script in the bytes of a file.
    ///
    /// # Errors
    /// [`Error::Parameter`] if it is no script, is too large, or cannot be followed.
    pub fn read(bytes: &[u8]) -> Result<Self> {
        if bytes.len() as u64 > SCRIPT_BYTES_MAX {
            return Err(refusal(format!("has more than {} MiB, the limit for a script", SCRIPT_BYTES_MAX >> 20)));
        }
        let mistake = |error: serde_json::Error| refusal(format!("is no script ({})", brief(&error.to_string())));
        let told: Value = serde_json::from_slice(bytes).map_err(mistake)?;
        if told.get("smalti").and_then(Value::as_str) != Some(KIND) {
            return Err(refusal("is no script of smalti; name a file that begins with {\"smalti\": \"script\""));
        }
        let version = told.get("version").and_then(Value::as_u64);
        if version != Some(VERSION) {
            let version = told.get("version").map_or_else(|| "none".to_owned(), Value::to_string);
            return Err(refusal(format!(
                "has the version {}, and this smalti reads version {VERSION}; use the smalti that wrote it",
                brief(&version)
            )));
        }
        // From the text again, so that a mistake is told with its line.
        let File { input_sha256, steps, until, .. } = serde_json::from_slice(bytes).map_err(mistake)?;
        let script = Self { input_sha256, steps, until };
        script.check().map(|()| script)
    }

    /// The script as the bytes of a file: JSON, and the same bytes for the same script.
    ///
    /// # Errors
    /// [`Error::Parameter`] if it cannot be followed, or would be too large to be read again.
    pub fn write(&self) -> Result<Vec<u8>> {
        self.check()?;
        let Self { input_sha256, steps, until } = self.clone();
        let file = File { smalti: KIND.to_owned(), version: VERSION, input_sha256, steps, until };
        let written = serde_json::to_vec_pretty(&file);
        let mut bytes =
            written.map_err(|error| Error::Internal(format!("a script cannot be written, since {error}")))?;
        bytes.push(b'\n');
        if bytes.len() as u64 > SCRIPT_BYTES_MAX {
            return Err(refusal(format!(
                "would have more than {} MiB, the limit; use smaller masks and maps",
                SCRIPT_BYTES_MAX >> 20
            )));
        }
        Ok(bytes)
    }

    /// Checks the order of the steps, and all recipes as far as that needs no picture.
    ///
    /// # Errors
    /// [`Error::Parameter`] that names the step.
    pub fn check(&self) -> Result<()> {
        let evals = |place: usize| self.steps.get(place).map(|step| step.evals);
        match evals(0) {
            None => return Err(refusal("has no step; the first one is at 0 evals")),
            Some(0) => {}
            Some(evals) => return Err(refusal(format!("step 1 is at {evals} evals, and the first one is at 0"))),
        }
        for (place, pair) in self.steps.windows(2).enumerate() {
            if pair[1].evals < pair[0].evals {
                let (number, evals, before) = (place + 2, pair[1].evals, pair[0].evals);
                return Err(refusal(format!(
                    "step {number} is at {evals} evals, before step {}, at {before}",
                    number - 1
                )));
            }
        }
        let last = self.steps.last().map_or(0, |step| step.evals);
        if let Some(until) = self.until.filter(|&until| until < last) {
            return Err(refusal(format!("until {until} is before the last step, which is at {last} evals")));
        }
        (0..self.steps.len()).try_for_each(|place| self.recipe(place).map(|_| ()))
    }

    /// Makes the mosaic again. `watch` is called after every round with the share of the work that is done, 0 to 1;
    /// when it returns false, there is no mosaic.
    ///
    /// # Errors
    /// As [`Recipe::make`]; [`Error::Parameter`] that names the step that cannot be followed with this picture.
    pub fn replay(
        &self,
        picture: &Picture,
        device: &Device,
        watch: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Option<Mosaic>> {
        let outlook = self.outlook(picture)?;
        let planned = self.evals_planned(&outlook.job).max(1);
        let mut seen = |session: &mut Session<'_>| watch((session.evals() as f64 / planned as f64).min(1.0));
        self.follow(picture, device, &mut seen)?.map(Session::finish).transpose()
    }

    /// The settings of the last recipe, by which the result is drawn and told.
    ///
    /// # Errors
    /// [`Error::Parameter`] that names the step.
    pub(crate) fn settings(&self) -> Result<Settings> {
        let place = self.steps.len().saturating_sub(1);
        Settings::new(&self.recipe(place)?).map_err(|error| at_step(place, error))
    }

    /// What the script leads to with this picture.
    ///
    /// # Errors
    /// [`Error::Parameter`] that names the step that does not fit the picture, or the step before.
    pub(crate) fn outlook(&self, picture: &Picture) -> Result<Outlook> {
        self.check()?;
        let mut known: Option<(Job, Story)> = None;
        for (place, step) in self.steps.iter().enumerate() {
            let (settings, job) = self.recipe(place)?.job(picture).map_err(|error| at_step(place, error))?;
            let provenances = Provenances::new(&settings, &job, None);
            let story = match known {
                None => Story::begin(provenances),
                Some((present, mut story)) => {
                    check_goes_on(&present, &job).map_err(|error| at_step(place, error))?;
                    story.go_on(step.evals, provenances);
                    story
                }
            };
            known = Some((job, story));
        }
        let (job, story) = known.ok_or_else(|| refusal("has no step"))?;
        Ok(Outlook { provenances: story.provenances(self.until), job })
    }

    /// The evals at which the result is taken, unless something else ends the work before; `last` is the job of the
    /// last recipe.
    pub(crate) fn evals_planned(&self, last: &Job) -> u64 {
        self.until.unwrap_or_else(|| last.evals_planned())
    }

    /// Follows the script to its end; `watch` is called after every round, and ends it by returning false.
    ///
    /// # Errors
    /// As [`Script::replay`].
    pub(crate) fn follow<'d>(
        &self,
        picture: &Picture,
        device: &'d Device,
        watch: &mut dyn FnMut(&mut Session<'_>) -> bool,
    ) -> Result<Option<Session<'d>>> {
        let mut session = Session::begin(&self.recipe(0)?, picture, device).map_err(|error| at_step(0, error))?;
        for (place, step) in self.steps.iter().enumerate().skip(1) {
            let name = format!("step {} at {}", place + 1, step.evals);
            if !bring(&mut session, step.evals, &name, watch)? {
                return Ok(None);
            }
            session.change(&self.recipe(place)?).map_err(|error| at_step(place, error))?;
        }
        if let Some(until) = self.until {
            let name = format!("until {until}");
            if !bring(&mut session, until, &name, watch)? {
                return Ok(None);
            }
            if session.stop_reason().is_some() {
                return Err(refusal(format!("{name}: the last recipe ends there anyway; leave it out")));
            }
            return Ok(Some(session));
        }
        while session.step()?.is_none() {
            if !watch(&mut session) {
                return Ok(None);
            }
        }
        Ok(Some(session))
    }

    /// The recipe of the step at `place`, from 0.
    fn recipe(&self, place: usize) -> Result<Recipe> {
        let step = self.steps.get(place).ok_or_else(|| refusal("has no step"))?;
        step.recipe.recipe().map_err(|error| at_step(place, error))
    }
}

/// Goes on until so many evals are made; false if `watch` ended it. `name` is what of the script comes there.
fn bring(
    session: &mut Session<'_>,
    evals: u64,
    name: &str,
    watch: &mut dyn FnMut(&mut Session<'_>) -> bool,
) -> Result<bool> {
    while session.evals() < evals {
        let stop = session.step()?;
        let reached = session.evals();
        if stop.is_some() && reached < evals {
            return Err(refusal(format!("{name}: the work comes to its end before, at {reached} evals")));
        }
        if reached > evals {
            return Err(refusal(format!(
                "{name}: no round ends there with this picture, the next one ends at {reached} evals"
            )));
        }
        if !watch(session) {
            return Ok(false);
        }
    }
    Ok(true)
}

/// A refusal of a script.
fn refusal(reason: impl Into<String>) -> Error {
    contradiction("script", reason)
}

/// What is wrong with the step at `place`, from 0.
fn at_step(place: usize, error: Error) -> Error {
    match &error {
        Error::Parameter { name, .. } if !["script", "picture"].contains(&name.as_str()) => {
            refusal(format!("step {}: {error}", place + 1))
        }
        _ => error,
    }
}
