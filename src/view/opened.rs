//! The picture that is open: as it was read, and as the window shows it.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::news::PictureNews;
use crate::error::Result;
use crate::photo;
use crate::studio::{Picture, Session};

/// A picture that is evolved.
pub(super) struct Open {
    pub picture: Picture,
    pub news: Arc<PictureNews>,
    /// The bytes of a picture that is in no file.
    pub pasted: Option<Vec<u8>>,
}

/// Where a picture came from.
pub(super) struct Origin {
    /// What people know it by.
    pub name: String,
    pub path: Option<PathBuf>,
    pub pasted: Option<Vec<u8>>,
}

impl Origin {
    pub(super) fn file(path: PathBuf) -> Self {
        Self { name: super::name_of(&path), path: Some(path), pasted: None }
    }
}

/// A picture of four bytes for each pixel, as one from the PNG that can be written of it: so it can be made again.
///
/// # Errors
/// If there is no pixel, or there are too many.
pub(super) fn pasted([width_px, height_px]: [u32; 2], rgba: &[u8]) -> Result<(Picture, Origin)> {
    // Checks the size.
    Picture::from_rgba8(width_px, height_px, rgba)?;
    let pixels: Vec<[u8; 4]> = rgba.chunks_exact(4).map(|pixel| [pixel[0], pixel[1], pixel[2], pixel[3]]).collect();
    let bytes = photo::encode_png_with_alpha(width_px, height_px, &pixels, &Vec::new())?;
    let picture = Picture::from_encoded(&bytes)?;
    Ok((picture, Origin { name: "pasted picture".to_owned(), path: None, pasted: Some(bytes) }))
}

impl Open {
    /// A picture as a session evolves it; `serial` is another for each picture that is opened.
    pub(super) fn new(picture: Picture, origin: Origin, serial: u64, session: &Session<'_>) -> Self {
        let Origin { name, path, pasted } = origin;
        let target = session.target();
        let size = [target.width_px, target.height_px];
        let news = Arc::new(PictureNews { serial, name, path, size, rgba: target.rgba8() });
        Self { picture, news, pasted }
    }

    /// Follows a session that may evolve the picture at another size or in other colours; the news, if it does.
    pub(super) fn follow(&mut self, session: &Session<'_>) -> Option<Arc<PictureNews>> {
        let target = session.target();
        let (size, rgba) = ([target.width_px, target.height_px], target.rgba8());
        if (size, &rgba) == (self.news.size, &self.news.rgba) {
            return None;
        }
        let PictureNews { serial, name, path, .. } = &*self.news;
        let news = PictureNews { serial: *serial, name: name.clone(), path: path.clone(), size, rgba };
        self.news = Arc::new(news);
        Some(Arc::clone(&self.news))
    }

    /// The file of the picture, if it is in one.
    pub(super) fn path(&self) -> Option<&Path> {
        self.news.path.as_deref()
    }
}
