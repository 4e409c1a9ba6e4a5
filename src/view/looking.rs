//! What somebody looks at beside the tiles: marginal fitness under the pointer, the error of each pixel.

use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::cpu::CpuPainter;
use crate::error::Result;
use crate::model::{Canvas, Painter, Population, Rgb};
use crate::studio::Session;

/// While the search runs, one part in so many of its time is spent on what somebody looks at: anew with each piece of
/// news, marginal fitness alone halves the search of 512x512 px.
const SHARE: u32 = 10;

/// What somebody looks at.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Wanted {
    pub marginal: bool,
    pub error_map: bool,
}

/// What was computed last for it.
#[derive(Clone, Default)]
pub(super) struct Looked {
    pub marginal: Option<Arc<Vec<i64>>>,
    pub error_map: Option<Arc<Vec<u16>>>,
}

/// Computes it, and not too often.
#[derive(Default)]
pub(super) struct Looking {
    wanted: Wanted,
    looked: Looked,
    /// When it was computed last, and how long that took.
    last: Option<(Instant, Duration)>,
}

impl Looking {
    /// Forgets what was computed, as where another search begins.
    pub(super) fn forget(&mut self) {
        *self = Self::default();
    }

    /// What is wanted of these tiles of `session`. Where the search runs, it may be of somewhat older tiles.
    pub(super) fn look(
        &mut self,
        session: &mut Session<'_>,
        tiles: &Population,
        wanted: Wanted,
        is_running: bool,
    ) -> Result<Looked> {
        let began = Instant::now();
        let is_known = self.wanted == wanted
            && is_running
            && self.last.is_some_and(|(then, cost)| began.duration_since(then) < cost * SHARE);
        if !is_known {
            // Not by `bool::then`, as the session may fail.
            let marginal = if wanted.marginal { Some(Arc::new(session.marginal()?)) } else { None };
            let target = if wanted.error_map { Some(session.target()) } else { None };
            let error_map = target.map(|target| errors(tiles, &target.pixels)).transpose()?.map(Arc::new);
            self.looked = Looked { marginal, error_map };
            self.wanted = wanted;
            let ended = Instant::now();
            self.last = Some((ended, ended.duration_since(began)));
        }
        Ok(self.looked.clone())
    }
}

/// The error of each pixel: the sum over its channels, 0 to 765.
fn errors(tiles: &Population, target: &[Rgb]) -> Result<Vec<u16>> {
    let canvas = Canvas::evaluation(tiles.width_px, tiles.height_px);
    let mosaic = CpuPainter.draw(tiles, &canvas, 1)?;
    let pixels = mosaic.over_black();
    let of_pixel = |(one, other): (&Rgb, &Rgb)| -> u16 {
        one.iter().zip(other).map(|(&one, &other)| u16::from(one.abs_diff(other))).sum()
    };
    Ok(pixels.iter().zip(target).map(of_pixel).collect())
}
