//! Tile shapes: each mask is one layer of a texture array, with coverage and shade per texel.

use crate::error::{Error, Result};

/// Texels along each side of a mask layer.
pub const MASK_SIDE: usize = 256;
/// Texels of a mask layer.
pub const TEXELS: usize = MASK_SIDE * MASK_SIDE;
/// Coverage from which a texel belongs to the tile; below it the tile has a hole there.
pub const COVERAGE_THRESHOLD: u8 = 128;
/// Largest number of layers in a set: every Vulkan 1.3 device offers as many in an array image.
pub const MASK_LAYERS_MAX: usize = 256;

/// How a texel's coverage decides what shows through the tile.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Blend {
    /// From [`COVERAGE_THRESHOLD`] on, the texel belongs to the tile and hides what lies behind it.
    #[default]
    Opaque,
    /// Coverage is the tile's opacity: 0 shows what lies behind, 255 hides it ([`super::translucency`]).
    Translucent,
}

/// One texel: how much of it the tile covers, and how bright the tile's colour is there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Texel {
    /// 0 is a hole, 255 is full; [`Blend`] says what the values between mean.
    pub coverage: u8,
    /// Factor of every colour channel: a channel `c` becomes `(c * shade + 127) / 255`.
    pub shade: u8,
}

/// A tile shape of [`MASK_SIDE`] x [`MASK_SIDE`] texels; row 0 lies at v = -h/2, column 0 at u = -w/2.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mask {
    texels: Box<[Texel; TEXELS]>,
}

impl Mask {
    /// A mask from its texels, row by row.
    ///
    /// # Errors
    /// [`Error::Parameter`] if there are not exactly [`MASK_SIDE`]² texels.
    pub fn new(texels: Vec<Texel>) -> Result<Self> {
        let wrong = |texels: Box<[Texel]>| {
            Error::parameter("texels", format!("a mask needs {MASK_SIDE}x{MASK_SIDE}, not {}", texels.len()))
        };
        Ok(Self { texels: texels.into_boxed_slice().try_into().map_err(wrong)? })
    }

    /// The full square: every texel covered at full brightness.
    #[must_use]
    pub fn square() -> Self {
        Self { texels: Box::new([Texel { coverage: 255, shade: 255 }; TEXELS]) }
    }

    /// The texels, row by row.
    #[must_use]
    pub fn texels(&self) -> &[Texel; TEXELS] {
        &self.texels
    }

    /// The texel at `column`, `row`, both below [`MASK_SIDE`].
    #[must_use]
    pub fn texel(&self, column: u32, row: u32) -> Texel {
        self.texels[row as usize * MASK_SIDE + column as usize]
    }
}

/// The masks that the flies of a lane may wear; layer 0 is always [`Mask::square`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MaskSet {
    layers: Vec<Mask>,
    blend: Blend,
}

impl Default for MaskSet {
    fn default() -> Self {
        Self { layers: vec![Mask::square()], blend: Blend::Opaque }
    }
}

impl MaskSet {
    /// An opaque set of the square and `others`, which become layers 1, 2, ...
    ///
    /// # Errors
    /// [`Error::Parameter`] if there are more than [`MASK_LAYERS_MAX`] layers.
    #[doc(hidden)]
    pub fn with_layers(others: Vec<Mask>) -> Result<Self> {
        if others.len() >= MASK_LAYERS_MAX {
            return Err(Error::parameter(
                "mask",
                format!("at most {} besides the square, not {}", MASK_LAYERS_MAX - 1, others.len()),
            ));
        }
        let mut layers = vec![Mask::square()];
        layers.extend(others);
        Ok(Self { layers, blend: Blend::Opaque })
    }

    /// The same masks with their coverage read as `blend` says.
    #[must_use]
    pub fn with_blend(self, blend: Blend) -> Self {
        Self { blend, ..self }
    }

    /// How the masks' coverage is read.
    #[must_use]
    pub fn blend(&self) -> Blend {
        self.blend
    }

    /// All layers; the first is the square.
    #[must_use]
    #[doc(hidden)]
    pub fn layers(&self) -> &[Mask] {
        &self.layers
    }
}

/// A packed colour under a texel's shade: each channel `(c * shade + 127) / 255`.
#[inline(always)]
#[must_use]
pub fn shaded(color: u32, shade: u32) -> u32 {
    let channel = |shift: u32| (((color >> shift & 255) * shade + 127) / 255) << shift;
    channel(0) | channel(8) | channel(16)
}
