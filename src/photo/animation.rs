//! Animations frame by frame: APNG without loss, and GIF. Memory does not grow with the number of frames, and the same
//! frames give the same bytes.
//!
//! Of opaque frames only the box around the pixels that changed is stored, and in it every pixel that did not change is
//! transparent. That saves bytes. In a GIF it also gives finer colours, since the palette of a frame serves its changed
//! pixels alone, and unchanged pixels do not flicker.
//!
//! Where frames are transparent themselves, that cannot be: an APNG stores the whole box, and a GIF every frame anew. A
//! GIF knows no partial transparency: what is less than half opaque is clear there, and the rest is opaque.

use std::collections::HashMap;
use std::io::{self, Write};

use gif::{DisposalMethod, Frame, Repeat};
use png::{BlendOp, DeflateCompression};

use super::metadata::Metadata;
use super::palette::{COLOR_COUNT_MAX, nearest, palette_of};

/// Most frames a second of a GIF: viewers show shorter delays as a tenth of a second.
pub const GIF_FRAMES_PER_S_MAX: u16 = 50;
/// Deflate level of the frames, 1 to 9.
const LEVEL: u8 = 6;
/// Most bytes of a block of a GIF.
const GIF_BLOCK_BYTES: usize = 255;
/// The label of a comment block in a GIF.
const GIF_COMMENT: u8 = 0xFE;

/// How many frames an animation has, and when it shows them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timing {
    /// Number of frames, at least 1.
    pub frame_count: u32,
    /// Frames a second, at least 1; a GIF has at most [`GIF_FRAMES_PER_S_MAX`].
    pub frames_per_s: u16,
    /// How long the last frame is shown, in hundredths of a second.
    pub last_cs: u16,
    /// How often the animation plays; 0 repeats it forever.
    pub plays: u16,
}

impl Timing {
    /// How long frame `index` of a GIF is shown, in hundredths of a second, rounded so that errors do not add up.
    fn delay_cs(&self, index: u32) -> u16 {
        if index + 1 == self.frame_count {
            return self.last_cs;
        }
        let begin_cs = |index: u64| (index * 200 / u64::from(self.frames_per_s)).div_ceil(2);
        (begin_cs(u64::from(index) + 1) - begin_cs(u64::from(index))) as u16
    }
}

/// The frames of an animation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frames {
    /// Width and height of each, in px.
    pub size_px: (u32, u32),
    /// When they are shown.
    pub timing: Timing,
    /// Whether they may be transparent.
    pub has_alpha: bool,
}

/// A colour and its opacity.
type Rgba = [u8; 4];

/// The least opacity of a pixel that a GIF shows.
const GIF_ALPHA_MIN: u8 = 128;

/// The pixels of a frame, with their opacities if it has any.
fn rgba(pixels: &[[u8; 3]], alpha: Option<&[u8]>) -> Vec<Rgba> {
    match alpha {
        Some(alpha) => pixels.iter().zip(alpha).map(|(&[r, g, b], &a)| [r, g, b, a]).collect(),
        None => pixels.iter().map(|&[r, g, b]| [r, g, b, 255]).collect(),
    }
}

/// A rectangle of pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Area {
    x: usize,
    y: usize,
    width_px: usize,
    height_px: usize,
}

/// What changed from the frame before.
struct Changes {
    area: Area,
    /// The pixels of the area, row by row; `None` where a pixel did not change.
    pixels: Vec<Option<Rgba>>,
}

/// The previous frame, with which the next one is compared.
#[derive(Debug)]
struct Screen {
    width_px: usize,
    shown: Vec<Rgba>,
}

impl Screen {
    fn new(width_px: u32) -> Self {
        Self { width_px: width_px as usize, shown: Vec::new() }
    }

    /// Shows `pixels` and returns what changed: everything on the first frame, and an area of at least one pixel on any
    /// other.
    fn show(&mut self, pixels: &[Rgba]) -> Changes {
        let is_first = self.shown.is_empty();
        let has_changed = |place: &usize| is_first || self.shown[*place] != pixels[*place];
        let area = self.bounds((0..pixels.len()).filter(has_changed));
        let pixel = |place| has_changed(&place).then_some(pixels[place]);
        let changes = Changes { area, pixels: self.places(area).map(pixel).collect() };
        self.shown.clear();
        self.shown.extend_from_slice(pixels);
        changes
    }

    /// The pixels of a frame that a GIF shows.
    fn solid(&self, pixels: &[Rgba]) -> Changes {
        let is_shown = |place: &usize| pixels[*place][3] >= GIF_ALPHA_MIN;
        let area = self.bounds((0..pixels.len()).filter(is_shown));
        let pixel = |place| is_shown(&place).then_some(pixels[place]);
        Changes { area, pixels: self.places(area).map(pixel).collect() }
    }

    /// The places of an area, row by row.
    fn places(&self, area: Area) -> impl Iterator<Item = usize> {
        let rows = (area.y..area.y + area.height_px).map(move |y| y * self.width_px + area.x);
        rows.flat_map(move |start| start..start + area.width_px)
    }

    /// The smallest area around some places; the pixel in the corner if there are none.
    fn bounds(&self, places: impl Iterator<Item = usize>) -> Area {
        let around = |bounds: Option<[usize; 4]>, place: usize| {
            let (x, y) = (place % self.width_px, place / self.width_px);
            let [left, top, right, bottom] = bounds.unwrap_or([x, y, x, y]);
            Some([left.min(x), top.min(y), right.max(x), bottom.max(y)])
        };
        let [left, top, right, bottom] = places.fold(None, around).unwrap_or_default();
        Area { x: left, y: top, width_px: right - left + 1, height_px: bottom - top + 1 }
    }
}

/// Writes an animated PNG: 8-bit sRGB, exactly the frames.
pub struct ApngEncoder<W: Write> {
    writer: png::Writer<W>,
    screen: Screen,
    frames: Frames,
    next: u32,
}

impl<W: Write> ApngEncoder<W> {
    /// Begins an animation.
    ///
    /// # Errors
    /// If `out` cannot be written, or the width, the height or the number of frames is 0.
    pub fn new(out: W, frames: Frames, metadata: &Metadata) -> io::Result<Self> {
        let Frames { size_px, timing, .. } = frames;
        let mut encoder = png::Encoder::new(out, size_px.0, size_px.1);
        encoder.set_color(png::ColorType::Rgba);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        encoder.set_deflate_compression(DeflateCompression::Level(LEVEL));
        encoder.set_filter(png::Filter::Adaptive);
        encoder.validate_sequence(true);
        encoder.set_animated(timing.frame_count, u32::from(timing.plays))?;
        encoder.set_frame_delay(1, timing.frames_per_s)?;
        for (keyword, text) in metadata.iter().cloned() {
            encoder.add_itxt_chunk(keyword, text)?;
        }
        Ok(Self { writer: encoder.write_header()?, screen: Screen::new(size_px.0), frames, next: 0 })
    }

    /// Adds the next frame, row by row from the top, with its opacities if frames may be transparent.
    ///
    /// # Errors
    /// If it cannot be written, or if it is one frame too many.
    pub fn add(&mut self, pixels: &[[u8; 3]], alpha: Option<&[u8]>) -> io::Result<()> {
        let Frames { timing, has_alpha, .. } = self.frames;
        let frame = rgba(pixels, alpha);
        let Changes { area, pixels } = self.screen.show(&frame);
        if self.next > 0 {
            // The encoder checks that the frame lies within the picture after each call; in this order it always does.
            self.writer.reset_frame_position()?;
            self.writer.set_frame_dimension(area.width_px as u32, area.height_px as u32)?;
            self.writer.set_frame_position(area.x as u32, area.y as u32)?;
            self.writer.set_blend_op(if has_alpha { BlendOp::Source } else { BlendOp::Over })?;
        }
        if self.next + 1 == timing.frame_count {
            self.writer.set_frame_delay(timing.last_cs, 100)?;
        }
        let samples: Vec<Rgba> = if has_alpha {
            self.screen.places(area).map(|place| frame[place]).collect()
        } else {
            pixels.into_iter().map(Option::unwrap_or_default).collect()
        };
        self.writer.write_image_data(samples.as_flattened())?;
        self.next += 1;
        Ok(())
    }

    /// Ends the animation.
    ///
    /// # Errors
    /// If it cannot be written, or frames are missing.
    pub fn finish(self) -> io::Result<()> {
        Ok(self.writer.finish()?)
    }
}

/// Writes an animated GIF: as close to the frames as 255 colours per frame allow.
pub struct GifEncoder<W: Write> {
    encoder: gif::Encoder<W>,
    screen: Screen,
    frames: Frames,
    next: u32,
}

impl<W: Write> GifEncoder<W> {
    /// Begins an animation with frames of at most 65,535 px along a side.
    ///
    /// # Errors
    /// If `out` cannot be written, or a side is too long.
    pub fn new(out: W, frames: Frames, metadata: &Metadata) -> io::Result<Self> {
        let Frames { size_px, timing, .. } = frames;
        let side = |px| u16::try_from(px).map_err(|_| io::Error::other("a GIF has at most 65,535 px along a side"));
        let mut encoder = gif::Encoder::new(out, side(size_px.0)?, side(size_px.1)?, &[]).map_err(gif_failure)?;
        if timing.plays != 1 {
            // The file stores the number of repetitions, which is one less than the number of plays.
            let repeat = timing.plays.checked_sub(1).map_or(Repeat::Infinite, Repeat::Finite);
            encoder.set_repeat(repeat).map_err(gif_failure)?;
        }
        for (keyword, text) in metadata {
            let comment = format!("{keyword}={text}");
            let blocks: Vec<&[u8]> = comment.as_bytes().chunks(GIF_BLOCK_BYTES).collect();
            encoder.write_raw_extension(gif::AnyExtension(GIF_COMMENT), &blocks).map_err(gif_failure)?;
        }
        Ok(Self { encoder, screen: Screen::new(size_px.0), frames, next: 0 })
    }

    /// Adds the next frame, row by row from the top, with its opacities if frames may be transparent.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn add(&mut self, pixels: &[[u8; 3]], alpha: Option<&[u8]>) -> io::Result<()> {
        let Frames { timing, has_alpha, .. } = self.frames;
        let frame = rgba(pixels, alpha);
        let Changes { area, pixels } = if has_alpha { self.screen.solid(&frame) } else { self.screen.show(&frame) };
        let changed: Vec<[u8; 3]> = pixels.iter().flatten().map(|&[r, g, b, _]| [r, g, b]).collect();
        let palette = match changed.len() {
            0 => Vec::new(),
            _ => palette_of(&changed, COLOR_COUNT_MAX - 1).map_err(io::Error::other)?,
        };
        let transparent = palette.len() as u8;
        let mut indices = HashMap::new();
        let mut index_of = |[r, g, b, _]: Rgba| -> u8 {
            let color = [r, g, b];
            // The search needs the palette in rising order, which it is.
            *indices
                .entry(color)
                .or_insert_with(|| palette.binary_search(&nearest(color, &palette)).unwrap_or_default() as u8)
        };
        let frame = Frame {
            delay: timing.delay_cs(self.next),
            // Cleared before the next one, where the next one may have holes.
            dispose: if has_alpha { DisposalMethod::Background } else { DisposalMethod::Keep },
            transparent: Some(transparent),
            left: area.x as u16,
            top: area.y as u16,
            width: area.width_px as u16,
            height: area.height_px as u16,
            buffer: pixels.into_iter().map(|pixel| pixel.map_or(transparent, &mut index_of)).collect(),
            palette: Some(palette.iter().chain([&[0; 3]]).flatten().copied().collect()),
            ..Frame::default()
        };
        self.encoder.write_frame(&frame).map_err(gif_failure)?;
        self.next += 1;
        Ok(())
    }

    /// Ends the animation.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn finish(self) -> io::Result<()> {
        self.encoder.into_inner().map_err(io::Error::other)?.flush()
    }
}

/// The error of the file itself, if it is one, so that a full disk is recognised as such.
fn gif_failure(error: gif::EncodingError) -> io::Error {
    match error {
        gif::EncodingError::Io(error) => error,
        other => io::Error::other(other),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn timing(frame_count: u32, frames_per_s: u16) -> Timing {
        Timing { frame_count, frames_per_s, last_cs: 150, plays: 0 }
    }

    #[test]
    fn delays_of_a_gif_add_up_to_the_true_time() {
        for frames_per_s in [1, 7, 20, 24, 30, 50] {
            let frames = timing(u32::from(frames_per_s) + 1, frames_per_s);
            let delays: Vec<u16> = (0..frames.frame_count).map(|index| frames.delay_cs(index)).collect();
            assert_eq!(delays.last(), Some(&150));
            assert_eq!(delays.iter().sum::<u16>(), 250, "{frames_per_s}: {delays:?}");
            assert!(delays[..delays.len() - 1].iter().all(|delay| delay.abs_diff(100 / frames_per_s) <= 1));
        }
    }

    #[test]
    fn only_the_box_around_what_changed_is_kept() {
        let mut screen = Screen::new(4);
        let mut pixels = vec![[1; 4]; 12];
        let all = screen.show(&pixels);
        assert_eq!(all.area, Area { x: 0, y: 0, width_px: 4, height_px: 3 });
        assert!(all.pixels.iter().all(Option::is_some));
        pixels[5] = [2; 4];
        pixels[10] = [3; 4];
        let some = screen.show(&pixels);
        assert_eq!(some.area, Area { x: 1, y: 1, width_px: 2, height_px: 2 });
        assert_eq!(some.pixels, [Some([2; 4]), None, None, Some([3; 4])]);
        let none = screen.show(&pixels);
        assert_eq!(none.area, Area { x: 0, y: 0, width_px: 1, height_px: 1 });
        assert_eq!(none.pixels, [None]);
    }

    #[test]
    fn frames_that_are_missing_or_too_many_are_errors() {
        let frames = Frames { size_px: (1, 1), timing: timing(2, 20), has_alpha: false };
        let mut out = Vec::new();
        let mut encoder = ApngEncoder::new(&mut out, frames, &Vec::new()).expect("it begins");
        encoder.add(&[[1; 3]], None).expect("the first frame");
        encoder.add(&[[1; 3]], None).expect("the second frame");
        assert!(encoder.add(&[[1; 3]], None).is_err());
        let mut out = Vec::new();
        let mut encoder = ApngEncoder::new(&mut out, frames, &Vec::new()).expect("it begins");
        encoder.add(&[[1; 3]], None).expect("the first frame");
        assert!(encoder.finish().is_err());
    }
}
