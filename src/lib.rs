//! Turns pictures into mosaics by evolving thousands of tiles with the Fly algorithm.
//!
//! A [`Picture`] and a [`Recipe`] go to a [`Device`], and a [`Mosaic`] comes back. The same picture and the same recipe
//! give the same bytes on every device and with any number of threads.
//!
//! ```no_run
//! fn main() -> Result<(), Box<dyn std::error::Error>> {
//!     let picture = smalti::Picture::open("photo.jpg")?;
//!     let device = smalti::Device::auto()?;
//!     let mosaic = smalti::Recipe::mosaic().tiles(3_000).seed(7).make(&picture, &device, |p| {
//!         eprint!("\r{:3.0} %", 100.0 * p.share());
//!         true
//!     })?;
//!     for tile in mosaic.tiles() {
//!         println!("{:?} {:?} {} {:?}", tile.center_px(), tile.size_px(), tile.angle_deg(), tile.rgb());
//!     }
//!     std::fs::write("mosaic.svg", mosaic.svg()?)?;
//!     Ok(())
//! }
//! ```
//!
//! | to | use |
//! |---|---|
//! | give a picture, from a file or from memory | [`Picture`] |
//! | say what it becomes | [`Recipe`], with [`Mask`], [`Shader`], [`GroutColor`], [`ColorMode`] |
//! | choose what computes | [`Device`] |
//! | watch, and stop early | the callback of [`Recipe::make`], which gets a [`Progress`] |
//! | get tiles, pixels and files | [`Mosaic`], [`Tile`], [`Image`] |
//! | make many pictures on one device | [`make_all`] |
//! | go step by step, and change the recipe on the way | [`Session`] |
//! | keep such steps in a file, and repeat them | [`Script`] of [`Step`]s, each with a [`WrittenRecipe`] |
//! | go on from earlier tiles | [`Population`] and [`Recipe::init`] |
//! | know what went wrong | [`Error`] |
//!
//! **Axes.** Pixel `(i, j)` has its centre at `x = i`, `y = j`; y points down and angles turn from +x towards +y.
//! Colours and errors are on stored 8-bit sRGB values. Global fitness is the sum of absolute errors (SAE, lower is
//! better). The marginal fitness of a fly is the SAE without it minus the SAE with it: positive means that the fly
//! helps.
//!
//! **Features.** `cli` adds the command line and `view` the window, both on by default; `default-features = false`
//! embeds the engine alone.
//!
//! **Stability.** What this page lists is the interface. All other modules are public for the tests and benches of the
//! project, hidden from these pages, and change without notice.

#[doc(hidden)]
pub mod archive;
#[cfg(feature = "cli")]
#[doc(hidden)]
pub mod cli;
#[doc(hidden)]
pub mod cpu;
#[doc(hidden)]
pub mod engine;
mod error;
#[doc(hidden)]
pub mod evolve;
#[doc(hidden)]
pub mod gpu;
mod guard;
#[doc(hidden)]
pub mod guide;
mod memory;
#[doc(hidden)]
pub mod metrics;
#[doc(hidden)]
pub mod model;
#[doc(hidden)]
pub mod openraster;
#[doc(hidden)]
pub mod output;
#[doc(hidden)]
pub mod photo;
#[cfg(feature = "cli")]
#[doc(hidden)]
pub mod plot;
#[doc(hidden)]
pub mod shapes;
#[doc(hidden)]
pub mod studio;
#[doc(hidden)]
pub mod threads;
#[doc(hidden)]
pub mod vector;
#[cfg(feature = "view")]
mod view;
#[doc(hidden)]
pub mod vk;

#[doc(inline)]
pub use error::{Error, NoDevice, Remedy, Result};
#[doc(inline)]
pub use evolve::{ColorMode, OnDry, StopReason};
#[doc(inline)]
pub use model::fly::Genes;
#[doc(inline)]
pub use model::{Backdrop, Blend, Fly, Grout, MaskSet, Population, Rgb};
#[doc(inline)]
pub use shapes::Shader;
#[doc(inline)]
pub use studio::{
    CarriedMask, Device, GroutColor, Image, Mask, MaskKind, Mosaic, Picture, Progress, Recipe, Scheme, Script, Session,
    Step, Tile, WrittenBounds, WrittenClass, WrittenMask, WrittenRecipe, make_all,
};
