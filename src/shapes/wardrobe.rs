//! The masks of one evolution: what its flies may wear.

use std::num::NonZeroU8;

use super::shader::Shader;
use super::template::{Source, Template};
use crate::error::{Error, Result};
use crate::model::mask::{COVERAGE_THRESHOLD, Texel};
use crate::model::{Blend, Mask, MaskSet};

/// A template drawn by a shader.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Outfit {
    /// What is drawn.
    pub template: Template,
    /// How it is drawn.
    pub shader: Shader,
}

/// A set of masks, and the layer of each outfit in it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Wardrobe {
    /// The masks. Layer 0 is the full square, whether any fly wears it or not.
    pub masks: MaskSet,
    /// The layer of each outfit, in the order asked for: the `mask` of the flies that wear it. Outfits with the same
    /// texels share a layer, and a full square has layer 0.
    pub layers: Vec<u16>,
}

impl Wardrobe {
    /// The masks of `outfits`.
    ///
    /// With [`Blend::Translucent`], `opacity` scales every coverage `c` to `(c * opacity + 127) / 255`; with
    /// [`Blend::Opaque`] it has no effect.
    ///
    /// # Errors
    /// If an outfit would cover nothing: [`Error::Input`] naming the file, or [`Error::Parameter`] for a built-in
    /// template. [`Error::Parameter`] if there are more masks than a set can hold.
    pub fn new(outfits: &[Outfit], blend: Blend, opacity: NonZeroU8) -> Result<Self> {
        let mut others: Vec<Mask> = Vec::new();
        let mut layers = Vec::with_capacity(outfits.len());
        let square = Mask::square();
        for (index, outfit) in outfits.iter().enumerate() {
            if let Some(known) = outfits[..index].iter().position(|earlier| earlier == outfit) {
                layers.push(layers[known]);
                continue;
            }
            let mask = match blend {
                Blend::Opaque => outfit.shader.mask(&outfit.template),
                Blend::Translucent => thinned(&outfit.shader.mask(&outfit.template), opacity),
            };
            if !covers_anything(&mask, blend) {
                return Err(covers_nothing(outfit));
            }
            let layer = if mask == square {
                0
            } else if let Some(known) = others.iter().position(|other| *other == mask) {
                known + 1
            } else {
                others.push(mask);
                others.len()
            };
            layers.push(layer as u16);
        }
        Ok(Self { masks: MaskSet::with_layers(others)?.with_blend(blend), layers })
    }
}

fn thinned(mask: &Mask, opacity: NonZeroU8) -> Mask {
    let scaled = |coverage: u8| ((u32::from(coverage) * u32::from(opacity.get()) + 127) / 255) as u8;
    let texels = mask.texels().iter().map(|texel| Texel { coverage: scaled(texel.coverage), ..*texel }).collect();
    Mask::new(texels).expect("as many texels as before")
}

fn covers_anything(mask: &Mask, blend: Blend) -> bool {
    let least = match blend {
        Blend::Opaque => COVERAGE_THRESHOLD,
        Blend::Translucent => 1,
    };
    mask.texels().iter().any(|texel| texel.coverage >= least)
}

fn covers_nothing(outfit: &Outfit) -> Error {
    let reason = format!(
        "under the shader `{}` its tiles would cover nothing; draw it more opaque, or take another shader or a higher \
         opacity",
        outfit.shader
    );
    match outfit.template.source() {
        Source::File(path) => Error::input(path, reason),
        source @ (Source::BuiltIn(_) | Source::Memory) => Error::parameter("mask", format!("`{source}`: {reason}")),
    }
}
