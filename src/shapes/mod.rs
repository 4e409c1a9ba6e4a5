//! Tile shapes: the templates that come with smalti, masks of the user's own, and the shaders that turn either into the
//! [`Mask`](crate::model::Mask)s that flies wear (paper, Figs 7 and 8).
//!
//! A [`Template`] is the raw drawing: an alpha and an intensity per texel. A [`Shader`] makes a mask of it: coverage and
//! shade per texel. A [`Wardrobe`] is the set of masks of one evolution. Everything but the rasteriser of SVG is
//! integers, so every machine draws the same texels. Knows no device, no fly and no target.

mod brush;
mod built_in;
mod depth;
mod drawing;
mod noise;
mod outlines;
mod read;
mod resample;
mod shader;
mod svg;
mod template;
mod wardrobe;

pub use built_in::BuiltIn;
pub use read::{MASK_FILE_BYTES_MAX, read};
pub use shader::Shader;
pub use template::{Ink, Source, Template};
pub use wardrobe::{Outfit, Wardrobe};
