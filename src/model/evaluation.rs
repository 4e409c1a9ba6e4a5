//! The interface of an evaluator: global and marginal fitness, and layers.

use super::fly::Fly;
use super::lane::{Lane, Scene};
use crate::error::Result;

/// No fly: the background shows.
pub const NO_FLY: u32 = u32::MAX;

/// One fly of one lane is replaced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Change {
    /// Lane, in the order of the scenes.
    pub lane: usize,
    /// Index of the fly that is replaced.
    pub index: u32,
    /// What takes its place.
    pub fly: Fly,
}

/// The fitness of a lane's population.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Evaluation<'a> {
    /// Global fitness: the sum of absolute errors over all pixels and channels; lower is better.
    pub sae: u64,
    /// Marginal fitness of each fly (paper Eq. 3): the SAE without it minus the SAE with it; positive means it helps.
    pub marginal: &'a [i64],
}

/// Per pixel, row by row, the two nearest flies that cover it, or [`NO_FLY`]. A translucent fly covers a pixel where
/// its coverage is above 0.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layers {
    /// The fly that shows; among translucent flies, the nearest one that shows.
    pub top: Vec<u32>,
    /// The fly that would show without the top one; among translucent flies, the next one.
    pub under: Vec<u32>,
}

/// Evaluates the populations of several pictures (lanes) at once, exactly.
///
/// Every implementation gives the same numbers.
pub trait Evaluator: Send {
    /// What the host keeps of `lane`: its scene, and the tiles and block lists of the loaded population.
    ///
    /// # Panics
    /// If there is no such lane. This holds for every method that names one.
    fn lane(&self, lane: usize) -> &Lane;

    /// What stays the same while `lane` evolves.
    fn scene(&self, lane: usize) -> &Scene {
        self.lane(lane).scene()
    }

    /// Number of lanes.
    fn lane_count(&self) -> usize;

    /// Adds a lane for `scene`, which is empty until it is loaded. Returns the lowest free lane number, or `None` if
    /// there is no room beside the other lanes.
    ///
    /// # Errors
    /// If the scene does not fit even alone, or the device fails.
    fn admit(&mut self, scene: Scene) -> Result<Option<usize>>;

    /// Removes a lane; its number and its room are free for another.
    fn release(&mut self, lane: usize);

    /// Loads whole populations into lanes and evaluates these lanes in one dispatch.
    ///
    /// # Errors
    /// If the device fails.
    fn load(&mut self, populations: &[(usize, &[Fly])]) -> Result<()>;

    /// Replaces flies and refreshes only the blocks that the changes touch, in one dispatch for all lanes.
    ///
    /// # Errors
    /// If the device fails.
    fn replace(&mut self, changes: &[Change]) -> Result<()>;

    /// Fitness of `lane` after the last [`Evaluator::load`] or [`Evaluator::replace`].
    fn evaluation(&self, lane: usize) -> Evaluation<'_>;

    /// The two nearest flies of every pixel of `lane`.
    ///
    /// # Errors
    /// If the device fails.
    fn read_back_layers(&mut self, lane: usize) -> Result<Layers>;
}
