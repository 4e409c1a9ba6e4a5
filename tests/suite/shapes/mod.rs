//! Templates, shaders, masks of the user's own, and wardrobes.

mod files;
mod masks;
mod wardrobes;

use std::num::NonZeroU8;
use std::sync::OnceLock;

use smalti::model::mask::{MASK_SIDE, Texel};
use smalti::model::{Blend, Mask};
use smalti::shapes::{BuiltIn, Outfit, Shader, Source, Template, Wardrobe};

const SIDE: u32 = MASK_SIDE as u32;

/// All templates in all shaders.
fn pairs() -> impl Iterator<Item = (BuiltIn, Shader)> {
    BuiltIn::ALL.into_iter().flat_map(|shape| Shader::ALL.into_iter().map(move |shader| (shape, shader)))
}

/// The mask of a pair; templates are drawn once for all tests.
fn mask(shape: BuiltIn, shader: Shader) -> Mask {
    static TEMPLATES: OnceLock<Vec<Template>> = OnceLock::new();
    let templates = TEMPLATES.get_or_init(|| BuiltIn::ALL.map(BuiltIn::template).to_vec());
    let is_its = |template: &&Template| *template.source() == Source::BuiltIn(shape);
    shader.mask(templates.iter().find(is_its).expect("all are there"))
}

/// The mean of `value` of the texels in a rectangle, `columns` by `rows`.
fn mean_in(mask: &Mask, columns: std::ops::Range<u32>, rows: std::ops::Range<u32>, value: impl Fn(Texel) -> u8) -> u32 {
    let count = columns.len() * rows.len();
    let texels = rows.flat_map(|row| columns.clone().map(move |column| mask.texel(column, row)));
    texels.map(|texel| u32::from(value(texel))).sum::<u32>() / count as u32
}

fn wardrobe(outfits: &[(&Template, Shader)], blend: Blend, opacity: u8) -> smalti::Result<Wardrobe> {
    let outfits: Vec<Outfit> =
        outfits.iter().map(|&(template, shader)| Outfit { template: template.clone(), shader }).collect();
    Wardrobe::new(&outfits, blend, NonZeroU8::new(opacity).expect("not 0"))
}
