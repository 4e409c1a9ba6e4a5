//! The one place where a picture is made: picture and recipe become a course, a search or an evolution, and a mosaic.
//!
//! ```text
//! Picture ─┐
//!          ├─> Job ──> Device opens a search ──> observers ──> Ended ──> Painter ──> Mosaic
//! Recipe ──┘
//! ```
//!
//! Knows no terminal, no clock and no environment, and of paths only those that a recipe names. Errors name parameters,
//! not flags.

#![cfg_attr(not(feature = "cli"), allow(dead_code, unused_imports, reason = "the command line uses the rest"))]

mod asked;
mod cells;
mod choices;
mod course;
mod crew;
mod decimal;
mod device;
mod drawing;
mod fitted;
mod grout;
mod hashes;
mod hex;
mod job;
mod look;
mod make;
mod making;
mod memory;
mod mosaic;
mod paper;
mod parameters;
mod picture;
mod preset;
mod preset_text;
mod presets;
mod progress;
mod provenance;
mod recipe;
mod script;
mod session;
mod settings;
mod stand_in;
mod story;
mod text_file;
mod tile;
mod words;
mod written;

pub use self::choices::{GroutColor, Scheme};
pub use self::course::{Work, work};
pub use self::crew::make_all;
pub use self::device::Device;
pub use self::look::Mask;
pub use self::mosaic::{Image, Mosaic};
pub use self::picture::Picture;
pub use self::progress::Progress;
pub use self::recipe::Recipe;
pub use self::script::{SCRIPT_BYTES_MAX, Script, Step};
pub use self::session::Session;
pub use self::tile::Tile;
pub use self::written::{CarriedMask, MaskKind, WrittenBounds, WrittenClass, WrittenMask, WrittenRecipe};

pub(crate) use self::asked::look_asked;
pub(crate) use self::cells::CellsSettings;
pub(crate) use self::choices::Colors;
#[cfg(feature = "view")]
pub(crate) use self::device::check_messages;
pub(crate) use self::device::{OpenedSearch, Opening, PipelineKeeper, select, select_all};
pub(crate) use self::drawing::{Content, Drawn, Pieces, SUPERSAMPLING_MAX, View, difference, usual_supersampling};
pub(crate) use self::hashes::population_sha256;
pub(crate) use self::hex::hexadecimal;
pub(crate) use self::job::{Job, default_fly_count};
pub(crate) use self::look::{Dress, KEEPS_MASKS, Look, LookChoices};
pub(crate) use self::making::{Instruments, Running, evolve, finish};
pub(crate) use self::memory::{drawing_bytes, estimate_bytes};
pub(crate) use self::preset::Preset;
pub(crate) use self::presets::{PaperPreset, Shaders};
pub(crate) use self::provenance::{KEYWORD, Provenance, Provenances, SOFTWARE, Told, picture_metadata, without_header};
pub(crate) use self::script::Outlook;
pub(crate) use self::settings::{LONG_SIDE_PX, SchemeSettings, Settings};
pub(crate) use self::text_file::{SETTINGS_BYTES_MAX, read_text, text_of, toml_mistake};
pub(crate) use self::words::{backdrop, color, color_count, grout_color, quoted};
