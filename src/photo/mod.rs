//! Pictures in and out: decode, bring upright and to sRGB, fit to size, encode; and the metadata in what we wrote.
//!
//! The only user of the image crates. The pixels decide everything that evolves from them, so every step gives the same
//! bytes on every machine and with any number of threads; a test compares decoded pictures with known hashes. Knows no
//! fly and no target.

mod animation;
mod camera_raw;
mod color;
mod color_words;
mod decode;
mod encode;
mod frames;
mod from_jpeg;
mod from_jpeg_xl;
mod from_png;
mod from_tiff;
mod icc;
mod jpeg_segments;
mod kinds;
mod metadata;
mod moving;
mod palette;
mod png_space;
mod raw;
mod resize;
mod stencil;
mod tiff_directories;
mod webp;
mod weights;
pub(crate) mod xml;

pub use animation::{ApngEncoder, Frames, GIF_FRAMES_PER_S_MAX, GifEncoder, Timing};
pub use color_words::{COLOR_FORMS, color};
pub(crate) use decode::why_unreadable;
pub use decode::{Background, Decoded, Loaded, ReadOptions, decoding_bytes, is_whole, kind_of_file, read};
pub use encode::{Format, encode, encode_jpeg, encode_png, encode_png_with_alpha, encode_webp, encode_with_alpha};
pub use kinds::{Coding, Foreign, Kind, kind_of};
pub(crate) use metadata::png_metadata;
pub use metadata::{Metadata, read_jpeg_metadata, read_metadata, read_png_metadata};
pub use moving::{MovingFrame, frame_count, take_apart};
pub use palette::{COLOR_COUNT_MAX, palette_of, read_palette, reduce};
pub(crate) use raw::is_in_part;
pub use raw::{CutShort, PIXEL_COUNT_MAX, SIDE_MAX_PX};
pub use resize::{fitted, fitted_size, fitted_to};
pub use stencil::{Stencil, decode_stencil, is_picture};
pub use webp::WEBP_SIDE_MAX_PX;
pub use weights::{decode_weights, read_weights};

/// A picture in memory: 8-bit sRGB, no alpha.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Photo {
    /// Width in px, at least 1.
    pub width_px: u32,
    /// Height in px, at least 1.
    pub height_px: u32,
    /// Red, green and blue of every pixel, row by row from the top; `width_px * height_px` of them.
    pub pixels: Vec<[u8; 3]>,
}
