//! How tiles look: masks, their shader and how they are blended, and the mask layers that become of them.

use std::fmt;
use std::num::NonZeroU8;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::parameters::{contradiction, real_in_range};
use super::presets::{PaperPreset, Shaders};
use crate::error::{Error, Result};
use crate::evolve::style::Style;
use crate::model::mask::MASK_LAYERS_MAX;
use crate::model::{Blend, MaskSet};
use crate::shapes::{self, BuiltIn, Outfit, Shader, Source, Template, Wardrobe};

/// The shape of a tile.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mask(MaskSource);

#[derive(Clone, Debug, PartialEq, Eq)]
enum MaskSource {
    /// The name of a built-in shape, or else a file that is read when it is needed.
    Named(PathBuf),
    Template(Arc<Template>),
}

impl Mask {
    /// A shape that comes with smalti: square, border, lines, flower, disc, triangle, hexagon or brush.
    ///
    /// # Errors
    /// [`Error::Parameter`] that lists the names.
    pub fn named(name: &str) -> Result<Self> {
        let is_known = BuiltIn::ALL.iter().any(|shape| shape.name() == name);
        let names = || BuiltIn::ALL.map(BuiltIn::name).join(", ");
        let refusal = || Error::value("mask", name, format!("there is no such mask; there are {}", names()));
        is_known.then(|| Self::named_or_file(name)).ok_or_else(refusal)
    }

    /// The shape in a picture (PNG, JPEG, JPEG XL, WebP, TIFF, BMP or GIF) or an SVG file.
    ///
    /// # Errors
    /// [`Error::Input`] if the file cannot be read or draws nothing.
    pub fn from_file(path: impl AsRef<Path>) -> Result<Self> {
        Ok(Self(MaskSource::Template(Arc::new(shapes::read(path.as_ref())?))))
    }

    /// The shape that a picture or SVG file of these bytes would hold.
    ///
    /// # Errors
    /// [`Error::Parameter`] if it cannot be read or draws nothing.
    pub fn from_encoded(bytes: &[u8]) -> Result<Self> {
        let template = shapes::decode(bytes).map_err(|reason| Error::parameter("mask", reason))?;
        Ok(Self(MaskSource::Template(Arc::new(template))))
    }

    /// As [`Mask::from_encoded`], of the bytes of a file that is called an SVG.
    ///
    /// # Errors
    /// [`Error::Parameter`] if it cannot be read or draws nothing.
    pub(super) fn from_svg(bytes: &[u8]) -> Result<Self> {
        let template = shapes::decode_svg(bytes).map_err(|reason| Error::parameter("mask", reason))?;
        Ok(Self(MaskSource::Template(Arc::new(template))))
    }

    /// A built-in shape if it has this name, in any case, else the file at this path, which is read when it is needed.
    pub(crate) fn named_or_file(name: impl Into<PathBuf>) -> Self {
        let path = name.into();
        let shape = path.to_str().and_then(|word| word.trim().parse::<BuiltIn>().ok());
        Self(MaskSource::Named(shape.map_or(path, |shape| shape.name().into())))
    }

    /// The name or path, if the mask has one.
    pub(crate) fn path(&self) -> Option<&Path> {
        match &self.0 {
            MaskSource::Named(path) => Some(path),
            MaskSource::Template(template) => match template.source() {
                Source::File(path) => Some(path),
                Source::BuiltIn(_) | Source::Memory => None,
            },
        }
    }

    /// Which of the shapes that come with smalti it is, if it is one.
    pub(super) fn built_in(&self) -> Option<BuiltIn> {
        match &self.0 {
            MaskSource::Named(path) => BuiltIn::ALL.into_iter().find(|shape| path.as_os_str() == shape.name()),
            MaskSource::Template(template) => match template.source() {
                Source::BuiltIn(shape) => Some(*shape),
                Source::File(_) | Source::Memory => None,
            },
        }
    }

    fn template(&self) -> Result<Template> {
        match &self.0 {
            MaskSource::Named(path) => Template::find(path),
            MaskSource::Template(template) => Ok(Template::clone(template)),
        }
    }
}

impl fmt::Display for Mask {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.0 {
            MaskSource::Named(path) => path.display().fmt(out),
            MaskSource::Template(template) => template.source().fmt(out),
        }
    }
}

/// What was asked for of the look of tiles; `None` is the default.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct LookChoices {
    pub masks: Vec<Mask>,
    pub shader: Option<Shader>,
    pub blend: Option<Blend>,
    /// 0.01 to 1.
    pub opacity: Option<f64>,
}

impl LookChoices {
    /// These choices, each of which overrides what `style` says of the same; opaque tiles have no use for its opacity.
    ///
    /// # Errors
    /// If there is no such shader as the style names.
    pub(crate) fn or_style(&self, style: &Style) -> Result<Self> {
        let masks = style.masks.iter().map(Mask::named_or_file);
        // An opaque style leaves it to the shader and the opacity.
        let blend = self.blend.or((style.blend == Blend::Translucent).then_some(Blend::Translucent));
        let opacity = (style.blend == Blend::Translucent && blend == Some(Blend::Translucent))
            .then(|| f64::from(style.opacity) / 255.0);
        Ok(Self {
            masks: if self.masks.is_empty() { masks.collect() } else { self.masks.clone() },
            shader: Some(self.shader.map_or_else(|| style.shader.parse(), Ok)?),
            blend,
            opacity: self.opacity.or(opacity),
        })
    }
}

/// What was asked for, checked.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Look {
    masks: Vec<Mask>,
    /// Worn from the first restart on; empty if they stay.
    restart_masks: Vec<Mask>,
    shader: Shader,
    blend: Blend,
    opacity: NonZeroU8,
}

/// Most masks that may be named together: a set of masks has room for these and the square.
pub(super) const MASK_COUNT_MAX: usize = MASK_LAYERS_MAX - 1;

/// Why a population's own masks stay as they are.
pub(crate) const KEEPS_MASKS: &str =
    "a population keeps its masks as they were shaded and blended; name the mask to change to with `mask`";

/// The masks of an evolution, and who wears them when.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Dress {
    pub masks: MaskSet,
    /// Layers of `masks` that flies wear, by run; later runs wear the last, and an empty entry is what they wear
    /// already.
    pub layers_by_run: Vec<Vec<u16>>,
}

impl Dress {
    /// Whether all flies are plain opaque squares from first to last.
    pub(crate) fn is_plain(&self) -> bool {
        self.masks == MaskSet::default() && self.layers_by_run.iter().flatten().all(|&layer| layer == 0)
    }
}

impl Look {
    /// Checks the choices; `restart_masks` are those from the first restart on, and what is not told is as in `preset`.
    ///
    /// # Errors
    /// [`Error::Parameter`] if they contradict each other.
    pub(crate) fn new(choices: &LookChoices, restart_masks: &[Mask], preset: Option<PaperPreset>) -> Result<Self> {
        let mask_count = choices.masks.len() + restart_masks.len();
        if mask_count > MASK_COUNT_MAX {
            let reason = format!("{mask_count} masks are named, and at most {MASK_COUNT_MAX} are possible; drop some");
            return Err(contradiction("mask", reason));
        }
        let opacity = real_in_range("opacity", choices.opacity.unwrap_or(1.0), 0.01..=1.0, "")?;
        let blend = match choices.blend {
            Some(Blend::Translucent) => Blend::Translucent,
            Some(Blend::Opaque) if opacity < 1.0 => {
                return Err(contradiction("opacity", "below 1 needs `blend` translucent, or none"));
            }
            None if opacity < 1.0 || choices.shader.is_some_and(Shader::is_translucent) => Blend::Translucent,
            _ => Blend::Opaque,
        };
        // What a preset says of "complex shapes" is not in the paper; any other mask takes its place.
        let complex = || vec![Mask::named_or_file(BuiltIn::Flower.name())];
        let (masks, restart_masks) = match preset.map(|preset| preset.shaders) {
            Some(Shaders::Two) if choices.masks.is_empty() => (complex(), restart_masks.to_vec()),
            Some(Shaders::OneThenTwo) if restart_masks.is_empty() => {
                let later = if choices.masks.is_empty() { complex() } else { choices.masks.clone() };
                (Vec::new(), later)
            }
            _ => (choices.masks.clone(), restart_masks.to_vec()),
        };
        let opacity = NonZeroU8::new((opacity * 255.0).round() as u8).unwrap_or(NonZeroU8::MAX);
        Ok(Self { masks, restart_masks, shader: choices.shader.unwrap_or(Shader::Template), blend, opacity })
    }

    /// The names of masks: those built in, and files.
    pub(crate) fn mask_paths(&self) -> impl Iterator<Item = &Path> {
        self.masks.iter().chain(&self.restart_masks).filter_map(Mask::path)
    }

    /// Whether nothing was asked for.
    pub(crate) fn is_default(&self) -> bool {
        self.masks.is_empty()
            && self.restart_masks.is_empty()
            && self.shader == Shader::Template
            && self.blend == Blend::Opaque
    }

    /// The fewest choices that make this look over what `style` says of it, and the masks from the first restart on;
    /// none if nothing need be chosen. `is_plain` says that all tiles are plain squares, whatever was asked for.
    pub(super) fn asked(&self, style: Option<&Style>, is_plain: bool) -> Option<(LookChoices, &[Mask])> {
        let filled = |choices: &LookChoices| {
            let over_style = style.map_or_else(|| Ok(choices.clone()), |style| choices.or_style(style)).ok()?;
            Self::new(&over_style, &self.restart_masks, None).ok()
        };
        let usual = filled(&LookChoices::default())?;
        if is_plain && usual.is_default() {
            return None;
        }
        let opacity = super::decimal::of_units(u32::from(self.opacity.get()), 255.0);
        let base = LookChoices {
            masks: if self.masks == usual.masks { Vec::new() } else { self.masks.clone() },
            shader: Some(self.shader).filter(|&shader| shader != usual.shader),
            ..LookChoices::default()
        };
        let blends = [None, Some(self.blend)];
        let ways = [None, Some(opacity)].into_iter().flat_map(|opacity| blends.map(|blend| (opacity, blend)));
        let mut choices = ways.map(|(opacity, blend)| LookChoices { opacity, blend, ..base.clone() });
        let found = choices.find(|choices| filled(choices).as_ref() == Some(self))?;
        Some((found, &self.restart_masks))
    }

    /// Whether tiles change their masks at the first restart.
    pub(crate) fn changes_at_restart(&self) -> bool {
        !self.restart_masks.is_empty()
    }

    /// Reads and shades the masks.
    ///
    /// # Errors
    /// If a mask cannot be read, or covers nothing.
    pub(crate) fn dress(&self) -> Result<Dress> {
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
    /// As [`Look::dress`], and [`Error::Parameter`] if what was asked for cannot be done to masks that are there.
    pub(crate) fn dress_over(&self, worn: &MaskSet) -> Result<Dress> {
        if !self.masks.is_empty() {
            return self.dress();
        }
        if self.restart_masks.is_empty() || self.blend != worn.blend() {
            return Err(contradiction("mask", KEEPS_MASKS));
        }
        let Wardrobe { masks, layers } = Wardrobe::new(&self.outfits(&self.restart_masks)?, self.blend, self.opacity)?;
        let shift = worn.layers().len() as u16 - 1;
        let shifted = layers.into_iter().map(|layer| if layer == 0 { 0 } else { layer + shift }).collect();
        let others = worn.layers().iter().skip(1).chain(masks.layers().iter().skip(1)).cloned().collect();
        let masks = MaskSet::with_layers(others)?.with_blend(self.blend);
        Ok(Dress { masks, layers_by_run: vec![Vec::new(), shifted] })
    }

    /// A mask that is named more than once is read once, and stands there as often as it is named: flies choose among
    /// the outfits.
    fn outfits(&self, masks: &[Mask]) -> Result<Vec<Outfit>> {
        let mut outfits: Vec<Outfit> = Vec::with_capacity(masks.len());
        for (index, mask) in masks.iter().enumerate() {
            let template = match masks[..index].iter().position(|earlier| earlier == mask) {
                Some(known) => outfits[known].template.clone(),
                None => mask.template()?,
            };
            outfits.push(Outfit { template, shader: self.shader });
        }
        Ok(outfits)
    }

    /// What flies wear that were given no mask: the square, shaded only if it is all that there is.
    fn plain_outfit(&self) -> Outfit {
        let shader = if self.restart_masks.is_empty() { self.shader } else { Shader::Flat };
        Outfit { template: BuiltIn::Square.template(), shader }
    }

    /// The masks, their shader and how they are blended, for people.
    pub(crate) fn describe(&self) -> String {
        let list = |masks: &[Mask]| {
            let names: Vec<String> = masks.iter().map(Mask::to_string).collect();
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
    fn look(style: &str, choices: &LookChoices) -> Look {
        let style = Style::named(style).expect("there is such a style");
        let filled = choices.or_style(&style).expect("its shader is known");
        Look::new(&filled, &[], None).expect("the flags fit together")
    }

    #[test]
    fn each_flag_of_the_look_takes_the_place_of_its_own_part_of_the_style() {
        let flags = LookChoices::default;
        let (disc, flower) = (vec![Mask::named_or_file("disc")], vec![Mask::named_or_file("flower")]);
        let spray = look("spray", &flags());
        assert_eq!((&spray.masks, spray.shader, spray.blend), (&disc, Shader::Soft, Blend::Translucent));
        assert_eq!(spray.opacity.get(), 200);
        let other_mask = look("spray", &LookChoices { masks: flower.clone(), ..flags() });
        assert_eq!(other_mask, Look { masks: flower, ..spray.clone() });
        let other_opacity = look("spray", &LookChoices { opacity: Some(0.2), ..flags() });
        assert_eq!(other_opacity, Look { opacity: NonZeroU8::new(51).expect("51 is not 0"), ..spray.clone() });
        let other_shader = look("spray", &LookChoices { shader: Some(Shader::Flat), ..flags() });
        assert_eq!(other_shader, Look { shader: Shader::Flat, ..spray.clone() });
        let cut_out = look("spray", &LookChoices { blend: Some(Blend::Opaque), ..flags() });
        assert_eq!(cut_out, Look { blend: Blend::Opaque, opacity: NonZeroU8::MAX, ..spray });
    }

    #[test]
    fn an_opaque_style_becomes_translucent_by_any_flag_that_asks_for_it() {
        let brush = look("paint", &LookChoices::default());
        assert_eq!((brush.blend, &brush.masks), (Blend::Opaque, &vec![Mask::named_or_file("brush")]));
        for flags in [
            LookChoices { opacity: Some(0.5), ..LookChoices::default() },
            LookChoices { shader: Some(Shader::Soft), ..LookChoices::default() },
            LookChoices { blend: Some(Blend::Translucent), ..LookChoices::default() },
        ] {
            let look = look("paint", &flags);
            assert_eq!((look.blend, &look.masks), (Blend::Translucent, &brush.masks));
        }
        assert!(
            look("free", &LookChoices::default()).is_default() && look("mosaic", &LookChoices::default()).is_default()
        );
    }
}
