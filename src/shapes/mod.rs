//! Tile shapes: the templates that come with smalti, the user's own drawings, and the shaders that turn either into the
//! [`Mask`](crate::model::Mask)s that flies wear (paper, Figs 7 and 8).
//!
//! A [`Template`] is the raw drawing: an alpha and an intensity per texel. A [`Shader`] turns it into a mask: coverage
//! and shade per texel. A [`Wardrobe`] is the set of masks of one evolution. Apart from the rasteriser of SVG,
//! everything is integers, so every machine draws the same texels. Knows no device, no fly and no target.

mod brush;
mod built_in;
mod depth;
mod drawing;
mod find;
mod ink;
mod noise;
mod outlines;
mod read;
mod resample;
mod shader;
mod svg;
mod template;
mod wardrobe;

pub use built_in::BuiltIn;
pub use ink::Ink;
pub use read::{MASK_FILE_BYTES_MAX, decode, decode_svg, read};
pub use shader::Shader;
pub use template::{Source, Template};
pub use wardrobe::{Outfit, Wardrobe};
