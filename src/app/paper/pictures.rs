//! The pictures of a figure, and what other tools would make of them.

use std::ffi::OsStr;
use std::path::Path;
use std::sync::Arc;

use crate::error::{Error, Result};
use crate::model::Target;
use crate::photo::{self, Photo, ReadOptions};

/// Endings of the files that are taken for pictures.
const EXTENSIONS: [&str; 8] = ["png", "jpg", "jpeg", "webp", "tif", "tiff", "bmp", "gif"];

/// A picture with its name.
#[derive(Clone, Debug)]
pub(super) struct Picture {
    /// The file's name without its ending.
    pub name: String,
    photo: Photo,
}

impl Picture {
    /// The picture as evolutions aim at it: reduced to `side_px` and to `color_count` colours.
    pub(super) fn target(&self, side_px: u32, color_count: Option<usize>) -> Result<Arc<Target>> {
        let mut photo = photo::fitted(&self.photo, side_px);
        if let Some(count) = color_count {
            let palette = photo::palette_of(&photo, count)?;
            photo::reduce(&mut photo, &palette);
        }
        Target::new(photo.width_px, photo.height_px, photo.pixels).map(Arc::new)
    }
}

/// The pictures in `folder`, by name; files that do not end like pictures are passed over.
///
/// # Errors
/// [`Error::Input`] if the folder or a picture cannot be read, or if there is none.
pub(super) fn in_folder(folder: &Path, long_side_px: u32) -> Result<Vec<Picture>> {
    let unreadable = |error: std::io::Error| Error::input(folder, photo::why_unreadable(&error));
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        let extension = path.extension().and_then(OsStr::to_str).unwrap_or_default().to_lowercase();
        if EXTENSIONS.contains(&extension.as_str()) && path.is_file() {
            paths.push(path);
        }
    }
    if paths.is_empty() {
        return Err(Error::input(folder, "has no pictures in it; name a folder with PNG or JPEG files"));
    }
    paths.sort();
    let reading = ReadOptions { long_side_px: Some(long_side_px), ..ReadOptions::default() };
    let read = |path: &std::path::PathBuf| {
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        Ok(Picture { name, photo: photo::read(path, &reading)?.photo })
    };
    paths.iter().map(read).collect()
}

/// A target as a picture.
pub(super) fn photo_of(target: &Target) -> Photo {
    Photo { width_px: target.width_px(), height_px: target.height_px(), pixels: target.pixels().to_vec() }
}

/// The plainest mosaic of about `cell_count` tiles: a grid of squares, each in the mean colour of what it covers.
pub(super) fn plain_grid(target: &Target, cell_count: usize) -> Photo {
    let (width, height) = (target.width_px() as usize, target.height_px() as usize);
    let columns = ((cell_count * width) as f64 / height as f64).sqrt().round().clamp(1.0, width as f64) as usize;
    let rows = cell_count.div_ceil(columns).clamp(1, height);
    let mut pixels = target.pixels().to_vec();
    let edge = |cell: usize, cells: usize, side: usize| cell * side / cells;
    for row in 0..rows {
        for column in 0..columns {
            let across = edge(column, columns, width)..edge(column + 1, columns, width);
            let down = edge(row, rows, height)..edge(row + 1, rows, height);
            let count = (across.len() * down.len()) as u64;
            let mut sums = [0_u64; 3];
            for pixel in down.clone().flat_map(|j| &target.pixels()[j * width..][across.clone()]) {
                sums.iter_mut().zip(pixel).for_each(|(sum, &channel)| *sum += u64::from(channel));
            }
            let mean = sums.map(|sum| ((sum + count / 2) / count) as u8);
            down.for_each(|j| pixels[j * width..][across.clone()].fill(mean));
        }
    }
    Photo { width_px: width as u32, height_px: height as u32, pixels }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grid_of_as_many_cells_as_pixels_is_the_picture_and_of_one_cell_its_mean() {
        let pixels: Vec<[u8; 3]> = (0..12_u8).map(|i| [i * 20, 255 - i, i]).collect();
        let target = Target::new(4, 3, pixels.clone()).expect("a valid size");
        assert_eq!(plain_grid(&target, 12).pixels, pixels);
        assert_eq!(plain_grid(&target, 1).pixels, vec![[110, 250, 6]; 12]);
    }
}
