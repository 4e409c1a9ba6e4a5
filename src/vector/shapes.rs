//! Masks as SVG definitions: `#m1`, `#m2`, .. for the layers that flies wear. The element that uses a definition sets
//! its fill. With grout there are also `#o1`, `#o2`, ..: the outlines without shade.
//!
//! An opaque mask is the outline of its solid texels, and a translucent one is a picture whose alpha is the coverage.
//! Shade is drawn as black over the colour: c * shade / 255 is c under black with the opacity 255 - shade.

use super::outline::path_data;
use super::{base64, push};
use crate::error::Result;
use crate::model::mask::{COVERAGE_THRESHOLD, MASK_SIDE, Texel};
use crate::model::{Blend, Fly, Mask, Population};
use crate::photo::{self, Metadata};

/// Path data of the whole mask.
const SQUARE: &str = "M-128-128h256v256h-256z";

/// The definitions of a document.
pub(super) struct Shapes {
    definitions: String,
}

impl Shapes {
    /// The masks of `population` that `flies` wear; the full square needs none.
    pub(super) fn of(population: &Population, flies: &[&Fly]) -> Result<Self> {
        let mut definitions = String::new();
        for (layer, mask) in population.masks.layers().iter().enumerate().skip(1) {
            if flies.iter().any(|fly| usize::from(fly.mask) == layer) {
                push_definition(&mut definitions, layer, mask, population)?;
            }
        }
        if !definitions.is_empty() {
            definitions = format!("<defs>\n{definitions}</defs>\n");
        }
        Ok(Self { definitions })
    }

    /// The `<defs>` element; empty if no fly wears a mask.
    pub(super) fn definitions(&self) -> &str {
        &self.definitions
    }
}

fn push_definition(svg: &mut String, layer: usize, mask: &Mask, population: &Population) -> Result<()> {
    let blend = population.masks.blend();
    let is_there = |texel: &Texel| match blend {
        Blend::Opaque => texel.coverage >= COVERAGE_THRESHOLD,
        Blend::Translucent => texel.coverage > 0,
    };
    let is_shaded = mask.texels().iter().any(|texel| is_there(texel) && texel.shade < 255);
    let shade = if is_shaded {
        let black = |texel: &Texel| [0, 0, 0, if is_there(texel) { 255 - texel.shade } else { 0 }];
        picture(&mask.texels().iter().map(black).collect::<Vec<_>>())?
    } else {
        String::new()
    };
    match blend {
        Blend::Opaque if population.grout.is_some() => {
            let outline = path_data(mask);
            push(
                svg,
                format_args!("<path id=\"o{layer}\" fill-rule=\"evenodd\" clip-rule=\"evenodd\" d=\"{outline}\"/>\n"),
            );
            push_cut_out(svg, layer, &format!("<use xlink:href=\"#o{layer}\"/>"), &shade);
        }
        Blend::Opaque if !is_shaded => {
            let outline = path_data(mask);
            push(svg, format_args!("<path id=\"m{layer}\" fill-rule=\"evenodd\" d=\"{outline}\"/>\n"));
        }
        Blend::Opaque => {
            let outline = path_data(mask);
            push_cut_out(svg, layer, &format!("<path clip-rule=\"evenodd\" d=\"{outline}\"/>"), &shade);
        }
        Blend::Translucent => {
            // White with alpha: whichever colour space a program takes the luminance in, it agrees with alpha.
            let white: Vec<[u8; 4]> = mask.texels().iter().map(|texel| [255, 255, 255, texel.coverage]).collect();
            let coverage = picture(&white)?;
            push(
                svg,
                format_args!(
                    "<mask id=\"c{layer}\" maskUnits=\"userSpaceOnUse\" x=\"-128\" y=\"-128\" width=\"256\" \
                     height=\"256\">{coverage}</mask>\n\
                     <g id=\"m{layer}\" mask=\"url(#c{layer})\"><path d=\"{SQUARE}\"/>{shade}</g>\n"
                ),
            );
        }
    }
    Ok(())
}

/// The square under its `shade`, cut to `shape`.
fn push_cut_out(svg: &mut String, layer: usize, shape: &str, shade: &str) {
    push(
        svg,
        format_args!(
            "<clipPath id=\"c{layer}\">{shape}</clipPath>\n\
             <g id=\"m{layer}\" clip-path=\"url(#c{layer})\"><path d=\"{SQUARE}\"/>{shade}</g>\n"
        ),
    );
}

/// A picture of texels with hard edges: browsers follow `pixelated`, and programs for SVG 1.1 follow the attribute.
fn picture(texels: &[[u8; 4]]) -> Result<String> {
    let png = photo::encode_png_with_alpha(MASK_SIDE as u32, MASK_SIDE as u32, texels, &Metadata::new())?;
    Ok(format!(
        "<image x=\"-128\" y=\"-128\" width=\"256\" height=\"256\" image-rendering=\"optimizeSpeed\" \
         style=\"image-rendering:pixelated\" xlink:href=\"data:image/png;base64,{}\"/>",
        base64::encode(&png)
    ))
}
