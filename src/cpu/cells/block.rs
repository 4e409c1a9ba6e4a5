//! What the search stores for 8x8 pixels: the target, what shows, and the stack of flies on each pixel.

use crate::model::NO_FLY;
use crate::model::cells::pixel::{BACKGROUND_Z, STACK_DEPTH};

/// Side of a block in px.
pub const SIDE: usize = 8;
/// Pixels of a block.
pub const PIXELS: usize = SIDE * SIDE;

/// One value per pixel.
pub type Plane<T> = [T; PIXELS];

/// A layer of pixels: which fly shows there, how deep it lies, and the error of its colour.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layer {
    /// The fly, or [`NO_FLY`] where the background shows.
    pub fly: Plane<u32>,
    /// Its depth, or [`BACKGROUND_Z`]; -1 outside the picture, where nothing is in front.
    pub z: Plane<i32>,
    /// Its error; that of the background includes the penalties.
    pub error: Plane<i32>,
}

/// The state of 8x8 pixels.
#[derive(Clone, Debug, PartialEq, Eq)]
#[repr(align(64))]
pub struct Block {
    /// The target, packed, with the flags of `model::cells::pixel`.
    pub target: Plane<u32>,
    /// The nearest fly.
    pub top: Layer,
    /// The fly behind it.
    pub under: Layer,
    /// Error of the background.
    pub ground: Plane<i32>,
    /// Factor of all errors.
    pub weight: Plane<i32>,
    /// Pixels whose stacks are full.
    pub full: u32,
    /// Flies on the pixel.
    pub depth: Plane<u8>,
    /// The flies of each pixel, nearest first, and their errors.
    pub stack: Plane<[Entry; STACK_DEPTH]>,
}

/// A fly on a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Entry {
    /// Its index.
    pub fly: u32,
    /// Its error there.
    pub error: i32,
}

impl Layer {
    fn empty() -> Self {
        Self { fly: [NO_FLY; PIXELS], z: [-1; PIXELS], error: [0; PIXELS] }
    }

    #[inline(always)]
    fn set(&mut self, pixel: usize, entry: Entry, z: i32) {
        self.fly[pixel] = entry.fly;
        self.z[pixel] = z;
        self.error[pixel] = entry.error;
    }
}

impl Block {
    /// A block outside the picture.
    pub fn outside() -> Self {
        Self {
            target: [0; PIXELS],
            top: Layer::empty(),
            under: Layer::empty(),
            ground: [0; PIXELS],
            weight: [1; PIXELS],
            full: 0,
            depth: [0; PIXELS],
            stack: [[Entry::default(); STACK_DEPTH]; PIXELS],
        }
    }

    /// Adds a fly to a pixel's stack, which must not be full, and returns its place there. `is_behind` says whether a
    /// fly lies behind the new one.
    #[inline(always)]
    pub fn insert(&mut self, pixel: usize, entry: Entry, is_behind: impl Fn(u32) -> bool) -> usize {
        let depth = usize::from(self.depth[pixel]);
        let stack = &mut self.stack[pixel];
        let mut place = depth;
        while place > 0 && is_behind(stack[place - 1].fly) {
            stack[place] = stack[place - 1];
            place -= 1;
        }
        stack[place] = entry;
        self.depth[pixel] = depth as u8 + 1;
        self.full += u32::from(depth + 1 == STACK_DEPTH);
        place
    }

    /// Removes a fly from a pixel's stack, where it must be, and returns the place it had.
    #[inline(always)]
    pub fn remove(&mut self, pixel: usize, fly: u32) -> usize {
        let depth = usize::from(self.depth[pixel]);
        let place = self.place_of(pixel, fly);
        let stack = &mut self.stack[pixel];
        for behind in place + 1..depth {
            stack[behind - 1] = stack[behind];
        }
        self.depth[pixel] = depth as u8 - 1;
        self.full -= u32::from(depth == STACK_DEPTH);
        place
    }

    /// Changes the error of a fly that is on a pixel, and returns its place there.
    #[inline(always)]
    pub fn recolor(&mut self, pixel: usize, entry: Entry) -> usize {
        let place = self.place_of(pixel, entry.fly);
        self.stack[pixel][place] = entry;
        place
    }

    #[inline(always)]
    fn place_of(&self, pixel: usize, fly: u32) -> usize {
        let depth = usize::from(self.depth[pixel]);
        let place = self.stack[pixel][..depth].iter().position(|entry| entry.fly == fly);
        debug_assert!(place.is_some(), "fly {fly} is not on this pixel");
        place.unwrap_or(0)
    }

    /// Sets the two layers of a pixel from its stack.
    #[inline(always)]
    pub fn surface(&mut self, pixel: usize, z_of: impl Fn(u32) -> i32) {
        let ground = Entry { fly: NO_FLY, error: self.ground[pixel] };
        let nth = |place: usize| if place < usize::from(self.depth[pixel]) { self.stack[pixel][place] } else { ground };
        let depth_of = |fly: u32| if fly == NO_FLY { BACKGROUND_Z as i32 } else { z_of(fly) };
        let (top, under) = (nth(0), nth(1));
        self.top.set(pixel, top, depth_of(top.fly));
        self.under.set(pixel, under, depth_of(under.fly));
    }
}
