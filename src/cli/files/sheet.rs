//! Contact sheets: pictures side by side in one picture.

use crate::error::Result;
use crate::photo::{self, Photo};

/// Space between cells, in px.
const GAP_PX: u32 = 8;
/// Colour of the space: a neutral grey.
const PAPER: [u8; 3] = [128; 3];

/// The pictures of `rows` in cells of `cell_px` x `cell_px`, each reduced to fit and centred in its cell. A missing
/// picture leaves its cell empty. `rows` must hold at least one picture.
pub(crate) fn sheet(rows: &[Vec<Option<&Photo>>], cell_px: u32) -> Result<Photo> {
    let column_count = rows.iter().map(Vec::len).max().unwrap_or_default() as u32;
    let side = |cells: u32| cells * (cell_px + GAP_PX) + GAP_PX;
    let (width_px, height_px) = (side(column_count), side(rows.len() as u32));
    let pixels = vec![PAPER; width_px as usize * height_px as usize];
    let mut sheet = Photo { width_px, height_px, pixels };
    for (row, pictures) in (0..).zip(rows) {
        for (column, picture) in (0..).zip(pictures) {
            let Some(picture) = picture else { continue };
            let fitted = photo::fitted(picture, cell_px);
            let centre = |cell: u32, side_px: u32| side(cell) + (cell_px - side_px) / 2;
            paste(&mut sheet, &fitted, (centre(column, fitted.width_px), centre(row, fitted.height_px)));
        }
    }
    Ok(sheet)
}

fn paste(sheet: &mut Photo, picture: &Photo, (left, top): (u32, u32)) {
    for (row, pixels) in (top..).zip(picture.pixels.chunks_exact(picture.width_px as usize)) {
        let first = (row * sheet.width_px + left) as usize;
        sheet.pixels[first..first + pixels.len()].copy_from_slice(pixels);
    }
}
