//! What a search of a recipe goes by, for those that measure or test searches themselves.

use std::sync::Arc;

use super::job::Job;
use super::recipe::Recipe;
use super::settings::{SchemeSettings, Settings};
use crate::error::{Error, Result};
use crate::model::cells::Course;
use crate::model::{Population, Target};

/// The search that a recipe makes of a fitted picture.
#[derive(Clone, Debug)]
pub struct Work {
    /// What the search goes by.
    pub course: Course,
    /// A population of the picture, without flies: its masks, background and grout.
    pub stage: Population,
}

/// The search that `recipe` makes of a picture that is fitted already.
///
/// # Errors
/// [`Error::Parameter`] if the recipe is wrong, or asks for no search in cells.
pub fn work(target: &Arc<Target>, recipe: &Recipe) -> Result<Work> {
    let job = Job::of_target(target, &Settings::new(recipe)?)?;
    match &job.scheme {
        SchemeSettings::Cells(cells) => Ok(Work { course: job.course(cells), stage: job.population(Vec::new()) }),
        SchemeSettings::Paper(_) => Err(Error::parameter("scheme", "a course is of a search in cells")),
    }
}
