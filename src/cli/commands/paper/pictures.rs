//! The pictures of a figure, and the plain grids that mosaics are compared with.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::cli::terminal::{self, Verbosity};
use crate::error::{Error, Result};
use crate::metrics;
use crate::model::Target;
use crate::photo::{self, Loaded, Photo, ReadOptions};

/// Endings that mark the pictures of a folder.
const EXTENSIONS: [&str; 8] = ["png", "jpg", "jpeg", "webp", "tif", "tiff", "bmp", "gif"];

/// Longer sides in px at which the paper evolves pictures.
pub(super) const SIDES_PX: [u32; 2] = [256, 512];

/// A picture with its name.
#[derive(Clone, Debug)]
pub(super) struct Picture {
    /// The file's name without its ending.
    pub name: String,
    /// Reduced to each of [`SIDES_PX`].
    photos: [Photo; SIDES_PX.len()],
}

impl Picture {
    /// The picture as a target: reduced to `side_px`, one of [`SIDES_PX`], and to `color_count` colours.
    pub(super) fn target(&self, side_px: u32, color_count: Option<usize>) -> Result<Arc<Target>> {
        let index = SIDES_PX.iter().position(|&px| px == side_px);
        let index = index.ok_or_else(|| Error::Internal(format!("no picture is kept at {side_px} px")))?;
        let mut photo = self.photos[index].clone();
        if let Some(count) = color_count {
            let palette = photo::palette_of(&photo.pixels, count)?;
            photo::reduce(&mut photo, &palette);
        }
        Target::new(photo.width_px, photo.height_px, photo.pixels).map(Arc::new)
    }
}

/// The pictures in `folder`, sorted by name. Files that do not end like pictures are skipped.
///
/// # Errors
/// [`Error::Input`] if the folder or a picture cannot be read, if there is none, or if one is too narrow to be scored;
/// [`Error::Usage`] if the names of two differ only in their endings.
pub(super) fn in_folder(folder: &Path, verbosity: Verbosity) -> Result<Vec<Picture>> {
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
    let pictures = paths.iter().map(|path| read(path, verbosity)).collect::<Result<Vec<_>>>()?;
    check_names(&paths, &pictures)?;
    Ok(pictures)
}

/// Refuses pictures whose results would have the same name, also on systems that do not tell small letters from
/// capitals.
fn check_names(paths: &[PathBuf], pictures: &[Picture]) -> Result<()> {
    for (later, picture) in pictures.iter().enumerate() {
        let is_same = |other: &Picture| other.name.to_lowercase() == picture.name.to_lowercase();
        if let Some(earlier) = pictures[..later].iter().position(is_same) {
            return Err(Error::Usage(format!(
                "{} and {} would write the same files; rename one of them",
                paths[earlier].display(),
                paths[later].display()
            )));
        }
    }
    Ok(())
}

/// The picture at `path` at every size, each reduced from the original. Prints a warning about what was ignored in the
/// file.
fn read(path: &Path, verbosity: Verbosity) -> Result<Picture> {
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let Loaded { photo, warnings, .. } = photo::read(path, &ReadOptions::default())?;
    if verbosity > Verbosity::Quiet {
        warnings.iter().for_each(|warning| terminal::error(&format!("{}: {warning}", path.display())));
    }
    let photos = SIDES_PX.map(|side_px| photo::fitted(&photo, side_px));
    for (Photo { width_px, height_px, .. }, side_px) in photos.iter().zip(SIDES_PX) {
        if *width_px.min(height_px) < metrics::SIDE_MIN_PX {
            let least = metrics::SIDE_MIN_PX;
            return Err(Error::input(
                path,
                format!(
                    "has {width_px}x{height_px} px when its longer side is at most {side_px} px, fewer than the {least}x{least} that a score needs; \
                     use a larger or less narrow one"
                ),
            ));
        }
    }
    Ok(Picture { name, photos })
}

/// A target as a picture.
pub(super) fn photo_of(target: &Target) -> Photo {
    Photo { width_px: target.width_px(), height_px: target.height_px(), pixels: target.pixels().to_vec() }
}

/// The plainest mosaic of about `cell_count` tiles: a grid of squares, each in the mean colour of the pixels that it
/// covers.
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
