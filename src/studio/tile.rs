//! Tiles as plain data, for whoever draws or counts them.

use std::fmt;

use crate::model::{Fly, Rgb};

/// A tile of a mosaic. Pixel (i, j) of the evolved picture has its centre at (i, j); y points down.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Tile {
    index: usize,
    fly: Fly,
    fitness: Option<i64>,
}

impl Tile {
    /// The tiles of living flies, in the order of the population; `fitness` is of all flies, if it is known.
    pub(super) fn of<'a>(flies: &'a [Fly], fitness: Option<&'a [i64]>) -> impl Iterator<Item = Self> + 'a {
        let living = flies.iter().enumerate().filter(|(_, fly)| fly.alive);
        living.map(move |(index, &fly)| Self { index, fly, fitness: fitness.map(|fitness| fitness[index]) })
    }

    /// Its number in the population.
    #[must_use]
    pub fn index(&self) -> usize {
        self.index
    }

    /// Its centre in px of the evolved picture: x, y.
    #[must_use]
    pub fn center_px(&self) -> (f32, f32) {
        let genes = self.fly.genes();
        (genes.x, genes.y)
    }

    /// Its width and height in px of the evolved picture, before it is turned.
    #[must_use]
    pub fn size_px(&self) -> (f32, f32) {
        let genes = self.fly.genes();
        (genes.w, genes.h)
    }

    /// Its angle in degrees, 0 to 360, from +x towards +y, so clockwise on the screen.
    #[must_use]
    pub fn angle_deg(&self) -> f32 {
        self.fly.genes().angle_deg
    }

    /// Its colour as 8-bit sRGB.
    #[must_use]
    pub fn rgb(&self) -> Rgb {
        self.fly.color()
    }

    /// Its depth in [-1, 1): smaller is nearer the eye; of equal ones the lower index is nearer.
    #[must_use]
    pub fn depth(&self) -> f32 {
        self.fly.genes().z
    }

    /// The layer of the population's masks that it wears; 0 is the square.
    #[must_use]
    pub fn mask(&self) -> u16 {
        self.fly.mask
    }

    /// How much the tile helps: what the mosaic would lose in likeness without it. In the paper's scheme that is the
    /// SAE without it minus the SAE with it; a search in cells adds penalties and weights. None while a picture is
    /// still on its way.
    #[must_use]
    pub fn fitness(&self) -> Option<i64> {
        self.fitness
    }
}

impl fmt::Debug for Tile {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.debug_struct("Tile")
            .field("index", &self.index())
            .field("center_px", &self.center_px())
            .field("size_px", &self.size_px())
            .field("angle_deg", &self.angle_deg())
            .field("rgb", &self.rgb())
            .field("depth", &self.depth())
            .field("mask", &self.mask())
            .field("fitness", &self.fitness())
            .finish()
    }
}
