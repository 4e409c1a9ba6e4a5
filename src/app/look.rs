//! How tiles look: the flags about masks and shaders, which several commands share, and the masks that they ask for.

use std::num::NonZeroU8;
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use serde::Deserialize;

use super::presets::{Preset, Shaders};
use super::values;
use crate::error::{Error, Result};
use crate::evolve::style::Style;
use crate::model::{Blend, MaskSet};
use crate::shapes::{BuiltIn, Outfit, Shader, Template, Wardrobe};

/// The flags.
#[derive(Clone, Debug, Default, Args)]
#[command(next_help_heading = "Tiles")]
pub(super) struct LookArgs {
    /// Shape of the tiles: square, border, lines, flower, disc, triangle, hexagon, brush, or a PNG or SVG file; several
    /// with commas or repeated, for a mix, in which --scheme cells counts each once [default: square, or as the style or
    /// the population has it]
    #[arg(long = "mask", value_name = "NAME|FILE", value_delimiter = ',')]
    pub masks: Vec<PathBuf>,
    /// What the drawing of a mask becomes: template (its own shading), flat, outline, emboss, soft, hollow, negative, fade
    /// or wash; for the masks that are named [default: template, or as the style has it]
    #[arg(long, value_name = "NAME")]
    pub shader: Option<Shader>,
    /// Whether a mask's coverage cuts the tile out or is its opacity [default: translucent with --opacity or the shaders
    /// soft, fade and wash, or as the style has it, else opaque]
    #[arg(long, value_enum, value_name = "KIND")]
    pub blend: Option<BlendName>,
    /// Opacity of whole tiles, 0.01 to 1 [default: 1, or as the style has it]
    #[arg(long, value_name = "A", value_parser = values::number)]
    pub opacity: Option<f64>,
}

impl LookArgs {
    /// These flags, each of which goes before what `style` says of the same; with opaque tiles its opacity has no use.
    ///
    /// # Errors
    /// [`Error::Usage`] if there is no such shader as the style names.
    pub(super) fn or_style(&self, style: &Style) -> Result<Self> {
        let masks = style.masks.iter().map(PathBuf::from);
        // An opaque style leaves it to the shader and the opacity.
        let blend = self.blend.or((style.blend == Blend::Translucent).then_some(BlendName::Translucent));
        let opacity = (style.blend == Blend::Translucent && blend == Some(BlendName::Translucent))
            .then(|| f64::from(style.opacity) / 255.0);
        Ok(Self {
            masks: if self.masks.is_empty() { masks.collect() } else { self.masks.clone() },
            shader: Some(self.shader.map_or_else(|| style.shader.parse(), Ok)?),
            blend,
            opacity: self.opacity.or(opacity),
        })
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub(super) enum BlendName {
    Opaque,
    Translucent,
}

/// What was asked for, checked.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Look {
    masks: Vec<PathBuf>,
    /// Worn from the first restart on; empty if they stay.
    restart_masks: Vec<PathBuf>,
    shader: Shader,
    blend: Blend,
    opacity: NonZeroU8,
}

/// Why a population's own masks stay as they are.
pub(super) const KEEPS_MASKS: &str =
    "a population keeps its masks as they were shaded and blended; name the mask to change to with --mask";

/// The masks of an evolution, and who wears them when.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Dress {
    pub masks: MaskSet,
    /// Layers of `masks` that flies wear, by run; later runs wear the last, and an empty entry is what they wear already.
    pub layers_by_run: Vec<Vec<u16>>,
}

impl Dress {
    /// Whether all flies are plain opaque squares from first to last.
    pub(super) fn is_plain(&self) -> bool {
        self.masks == MaskSet::default() && self.layers_by_run.iter().flatten().all(|&layer| layer == 0)
    }
}

impl Look {
    /// Checks the flags; `restart_masks` are those from the first restart on, and what is not told is as in `preset`.
    ///
    /// # Errors
    /// [`Error::Usage`] that names the flag and what it may be.
    pub(super) fn new(args: &LookArgs, restart_masks: &[PathBuf], preset: Option<Preset>) -> Result<Self> {
        let opacity = args.opacity.unwrap_or(1.0);
        if !(0.01..=1.0).contains(&opacity) {
            return Err(Error::Usage(format!("--opacity {opacity}: must be 0.01 to 1")));
        }
        let blend = match args.blend {
            Some(BlendName::Translucent) => Blend::Translucent,
            Some(BlendName::Opaque) if opacity < 1.0 => {
                return Err(Error::Usage("--opacity below 1 needs --blend translucent, or none".to_owned()));
            }
            None if opacity < 1.0 || args.shader.is_some_and(Shader::is_translucent) => Blend::Translucent,
            _ => Blend::Opaque,
        };
        // What a preset says of "complex shapes" is not in the paper; any other mask takes its place.
        let complex = || vec![PathBuf::from(BuiltIn::Flower.name())];
        let (masks, restart_masks) = match preset.map(|preset| preset.shaders) {
            Some(Shaders::Two) if args.masks.is_empty() => (complex(), restart_masks.to_vec()),
            Some(Shaders::OneThenTwo) if restart_masks.is_empty() => {
                let later = if args.masks.is_empty() { complex() } else { args.masks.clone() };
                (Vec::new(), later)
            }
            _ => (args.masks.clone(), restart_masks.to_vec()),
        };
        let opacity = NonZeroU8::new((opacity * 255.0).round() as u8).unwrap_or(NonZeroU8::MAX);
        Ok(Self { masks, restart_masks, shader: args.shader.unwrap_or(Shader::Template), blend, opacity })
    }

    /// The masks as they were named: those built in, and files.
    pub(super) fn named_masks(&self) -> impl Iterator<Item = &PathBuf> {
        self.masks.iter().chain(&self.restart_masks)
    }

    /// Whether nothing was asked for.
    pub(super) fn is_default(&self) -> bool {
        self.masks.is_empty()
            && self.restart_masks.is_empty()
            && self.shader == Shader::Template
            && self.blend == Blend::Opaque
    }

    /// Whether tiles change their masks at the first restart.
    pub(super) fn changes_at_restart(&self) -> bool {
        !self.restart_masks.is_empty()
    }

    /// Reads and shades the masks.
    ///
    /// # Errors
    /// If a mask cannot be read, or covers nothing.
    pub(super) fn dress(&self) -> Result<Dress> {
        let first = if self.masks.is_empty() { vec![self.plain_outfit()] } else { self.outfits(&self.masks)? };
        let later = self.outfits(&self.restart_masks)?;
        let first_count = first.len();
        let Wardrobe { masks, layers } = Wardrobe::new(&[first, later].concat(), self.blend, self.opacity)?;
        let (first, later) = layers.split_at(first_count);
        let mut layers_by_run = vec![first.to_vec()];
        if !later.is_empty() {
            layers_by_run.push(later.to_vec());
        }
        Ok(Dress { masks, layers_by_run })
    }

    /// As [`Look::dress`], for flies that come in masks of their own and keep them until they are told to change.
    ///
    /// # Errors
    /// As [`Look::dress`], and [`Error::Usage`] if what was asked for cannot be done to masks that are there.
    pub(super) fn dress_over(&self, worn: &MaskSet) -> Result<Dress> {
        if !self.masks.is_empty() {
            return self.dress();
        }
        if self.restart_masks.is_empty() || self.blend != worn.blend() {
            return Err(Error::Usage(KEEPS_MASKS.to_owned()));
        }
        let Wardrobe { masks, layers } = Wardrobe::new(&self.outfits(&self.restart_masks)?, self.blend, self.opacity)?;
        let shift = worn.layers().len() as u16 - 1;
        let shifted = layers.into_iter().map(|layer| if layer == 0 { 0 } else { layer + shift }).collect();
        let others = worn.layers().iter().skip(1).chain(masks.layers().iter().skip(1)).cloned().collect();
        let masks = MaskSet::with_layers(others)?.with_blend(self.blend);
        Ok(Dress { masks, layers_by_run: vec![Vec::new(), shifted] })
    }

    fn outfits(&self, names: &[PathBuf]) -> Result<Vec<Outfit>> {
        names.iter().map(|name| Ok(Outfit { template: Template::find(name)?, shader: self.shader })).collect()
    }

    /// What flies wear that were given no mask: the square, shaded only if it is all that there is.
    fn plain_outfit(&self) -> Outfit {
        let shader = if self.restart_masks.is_empty() { self.shader } else { Shader::Flat };
        Outfit { template: BuiltIn::Square.template(), shader }
    }

    /// The masks, their shader and how they are blended, for people.
    pub(super) fn describe(&self) -> String {
        let list = |names: &[PathBuf]| {
            let names: Vec<String> = names.iter().map(|name| name.display().to_string()).collect();
            if names.is_empty() { BuiltIn::Square.name().to_owned() } else { names.join(" and ") }
        };
        let mut told = list(&self.masks);
        if self.changes_at_restart() {
            told += &format!(", from the first restart {}", list(&self.restart_masks));
        }
        told += &format!(", shader {}", self.shader.name());
        if self.blend == Blend::Translucent {
            told += &format!(", translucent, opacity {:.2}", f64::from(self.opacity.get()) / 255.0);
        }
        told
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The look of these flags over the style of this name.
    fn look(style: &str, flags: &LookArgs) -> Look {
        let style = Style::named(style).expect("there is such a style");
        let filled = flags.or_style(&style).expect("its shader is known");
        Look::new(&filled, &[], None).expect("the flags fit together")
    }

    #[test]
    fn each_flag_of_the_look_takes_the_place_of_its_own_part_of_the_style() {
        let flags = LookArgs::default;
        let (disc, flower) = (vec![PathBuf::from("disc")], vec![PathBuf::from("flower")]);
        let spray = look("spray", &flags());
        assert_eq!((&spray.masks, spray.shader, spray.blend), (&disc, Shader::Soft, Blend::Translucent));
        assert_eq!(spray.opacity.get(), 200);
        let other_mask = look("spray", &LookArgs { masks: flower.clone(), ..flags() });
        assert_eq!(other_mask, Look { masks: flower, ..spray.clone() });
        let other_opacity = look("spray", &LookArgs { opacity: Some(0.2), ..flags() });
        assert_eq!(other_opacity, Look { opacity: NonZeroU8::new(51).expect("51 is not 0"), ..spray.clone() });
        let other_shader = look("spray", &LookArgs { shader: Some(Shader::Flat), ..flags() });
        assert_eq!(other_shader, Look { shader: Shader::Flat, ..spray.clone() });
        let cut_out = look("spray", &LookArgs { blend: Some(BlendName::Opaque), ..flags() });
        assert_eq!(cut_out, Look { blend: Blend::Opaque, opacity: NonZeroU8::MAX, ..spray });
    }

    #[test]
    fn an_opaque_style_becomes_translucent_by_any_flag_that_asks_for_it() {
        let brush = look("paint", &LookArgs::default());
        assert_eq!((brush.blend, &brush.masks), (Blend::Opaque, &vec![PathBuf::from("brush")]));
        for flags in [
            LookArgs { opacity: Some(0.5), ..LookArgs::default() },
            LookArgs { shader: Some(Shader::Soft), ..LookArgs::default() },
            LookArgs { blend: Some(BlendName::Translucent), ..LookArgs::default() },
        ] {
            let look = look("paint", &flags);
            assert_eq!((look.blend, &look.masks), (Blend::Translucent, &brush.masks));
        }
        assert!(look("free", &LookArgs::default()).is_default() && look("mosaic", &LookArgs::default()).is_default());
    }
}
