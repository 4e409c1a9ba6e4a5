//! Populations as `.npz` files: results that can be drawn again at any size, evolved further, or opened with numpy.
//!
//! One array per gene (`x y z r g b w h angle`, f32), `fitness` (i64), `mask` (u16), `alive` (bool), the mask layers as
//! `mask_0`, `mask_1`, ... (u8, 256x256x2: coverage and shade), and `meta.json`. `numpy.load` opens such a file
//! directly. Dates, order and compression are fixed, so the same population gives the same bytes, and saving a loaded
//! population changes nothing. For programs that do not read `.npz` there are tables (`table.rs`), which smalti does
//! not read back.

mod array_header;
mod encode;
mod read;
mod table;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::model::{Blend, Grout, Population, Rgb};

pub use encode::{encode, encode_snapshot};
pub use read::{IS_A_PICTURE, decode, is_cut_short, read, read_meta};
pub use table::{
    KEY_DIGITS, encode_csv, encode_json, is_csv_without_rows, is_whole_csv, read_csv_meta, read_json_meta,
};

/// Version of the file's layout.
const SCHEMA: u32 = 1;
/// The columns of floats, in the order of the file.
const GENE_COLUMNS: [&str; 9] = ["x", "y", "z", "r", "g", "b", "w", "h", "angle"];
/// Member of the zip file that holds the [`Header`].
const HEADER_MEMBER: &str = "meta.json";

/// A population as it was read from a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Archive {
    /// The flies with their masks, size and background; every gene lies within its bounds.
    pub population: Population,
    /// Marginal fitness of every fly when the file was written; zeros if the file has none.
    pub fitness: Vec<i64>,
    /// The writer's own metadata: scheme, seed, versions, hash of the input.
    pub meta: Map<String, Value>,
}

/// The contents of `meta.json`: what is needed to understand the arrays, and the writer's own keys.
#[derive(Debug, Serialize, Deserialize)]
struct Header {
    schema: u32,
    width_px: u32,
    height_px: u32,
    background: [u8; 3],
    /// Whether nothing lies behind the tiles. `background` is then the colour for programs without alpha.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    transparent: bool,
    /// How coverage is read. Opaque masks are the default and are not mentioned.
    #[serde(default, skip_serializing_if = "BlendName::is_opaque")]
    blend: BlendName,
    /// Absent if tiles are drawn to their edges.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    grout: Option<GroutEntry>,
    #[serde(flatten)]
    meta: Map<String, Value>,
}

/// Keys of [`Header`], which the writer's own metadata must not use.
const HEADER_KEYS: [&str; 7] = ["schema", "width_px", "height_px", "background", "transparent", "blend", "grout"];

/// [`Grout`] as the file spells it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct GroutEntry {
    /// In 1/64 px.
    width: u32,
    color: Rgb,
}

impl From<Grout> for GroutEntry {
    fn from(Grout { width, color }: Grout) -> Self {
        Self { width, color }
    }
}

impl From<GroutEntry> for Grout {
    fn from(GroutEntry { width, color }: GroutEntry) -> Self {
        Self { width, color }
    }
}

/// [`Blend`] as the file spells it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum BlendName {
    #[default]
    Opaque,
    Translucent,
}

impl BlendName {
    fn is_opaque(&self) -> bool {
        *self == Self::Opaque
    }
}

impl From<Blend> for BlendName {
    fn from(blend: Blend) -> Self {
        match blend {
            Blend::Opaque => Self::Opaque,
            Blend::Translucent => Self::Translucent,
        }
    }
}

impl From<BlendName> for Blend {
    fn from(name: BlendName) -> Self {
        match name {
            BlendName::Opaque => Self::Opaque,
            BlendName::Translucent => Self::Translucent,
        }
    }
}
