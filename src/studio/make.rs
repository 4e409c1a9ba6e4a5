//! One picture made by a recipe, from the front door to the mosaic.

use super::device::Device;
use super::drawing::Pieces;
use super::job::Job;
use super::making::{Plain, evolve, finish_on};
use super::mosaic::Mosaic;
use super::picture::Picture;
use super::progress::{Caller, Progress};
use super::recipe::Recipe;
use super::settings::Settings;
use crate::error::Result;
use crate::evolve::{Observer, Undisturbed};

/// What is drawn of every mosaic.
pub(super) const PICTURE: Pieces = Pieces { picture: true, layers: false };

impl Recipe {
    /// Makes a mosaic of `picture` on `device`. `progress` is called many times a second; when it returns false, the
    /// mosaic is as it has become until then ([`crate::StopReason::Interrupted`]).
    ///
    /// ```
    /// # fn main() -> Result<(), smalti::Error> {
    /// let picture = smalti::Picture::from_rgb8(2, 2, &[200, 0, 0, 0, 200, 0, 0, 0, 200, 9, 9, 9])?;
    /// let mosaic = smalti::Recipe::new().tiles(20).make(&picture, &smalti::Device::cpu(), |_| true)?;
    /// assert!(mosaic.tiles().all(|tile| tile.size_px().0 > 0.0));
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`crate::Error::Parameter`] if the recipe is wrong or does not fit the picture; [`crate::Error::Input`] about a
    /// file that it names; or if the device fails or has no room.
    pub fn make(
        &self,
        picture: &Picture,
        device: &Device,
        progress: impl FnMut(&mut Progress<'_, '_>) -> bool,
    ) -> Result<Mosaic> {
        let (settings, job) = self.job(picture)?;
        made(&settings, &job, device, &mut Caller::new(&job, progress))
    }

    /// As [`Recipe::make`], without a callback.
    ///
    /// # Errors
    /// As [`Recipe::make`].
    pub fn make_quietly(&self, picture: &Picture, device: &Device) -> Result<Mosaic> {
        let (settings, job) = self.job(picture)?;
        made(&settings, &job, device, &mut Undisturbed)
    }

    /// What there is to do about a picture.
    pub(super) fn job(&self, picture: &Picture) -> Result<(Settings, Job)> {
        let settings = Settings::new(self)?;
        let job = Job::of_picture(picture.decoded(), &settings)?;
        job.check()?;
        Ok((settings, job))
    }
}

/// The mosaic of a job.
pub(super) fn made(settings: &Settings, job: &Job, device: &Device, observer: &mut dyn Observer) -> Result<Mosaic> {
    let ended = evolve(job, device, observer, &mut Plain)?;
    let finished = finish_on(device, job, ended, None, PICTURE)?;
    Ok(Mosaic::new(settings, job, finished))
}
