//! Wishes as a recipe that a file can hold.

use super::interface::encoded_map;
use super::wishes::{ColorWish, GroundWish, GroutWish, MaskWish, Wishes};
use crate::error::Result;
use crate::evolve::cells::EVALS_PER_FLY;
use crate::model::Rgb;
use crate::photo::fitted_size;
use crate::studio::{
    CarriedMask, LONG_SIDE_PX, MaskKind, WrittenBounds, WrittenMask, WrittenRecipe, default_fly_count, hexadecimal,
};

impl Wishes {
    /// The recipe for a picture of so many px. What is as by default is not written.
    ///
    /// # Errors
    /// If the map of weights cannot be encoded.
    pub(super) fn written(&self, picture: (u32, u32)) -> Result<WrittenRecipe> {
        let few = if let ColorWish::Few(count) = self.colors { Some(count) } else { None };
        let palette: &[Rgb] = if let ColorWish::Palette { colors, .. } = &self.colors { colors } else { &[] };
        let tiles = self.tiles.unwrap_or_else(|| usual_tiles(picture, self.size));
        let bounds = WrittenBounds {
            side: self.bounds.side,
            aspect: self.bounds.aspect,
            overlap: self.bounds.overlap.map(f64::from),
            hole: self.bounds.hole.map(f64::from),
            turn: self.bounds.turn.map(f64::from),
            ..WrittenBounds::default()
        };
        Ok(WrittenRecipe {
            style: Some(self.style.name().to_owned()),
            bounds,
            tiles: self.tiles,
            size: Some(self.size).filter(|&size| size != LONG_SIDE_PX),
            seed: Some(self.seed).filter(|&seed| seed != 0),
            evals: (self.evals_per_tile != EVALS_PER_FLY).then(|| self.evals_per_tile.saturating_mul(tiles)),
            colors: few,
            palette: palette.iter().map(|color| hexadecimal(color)).collect(),
            background: match self.ground {
                GroundWish::OfStyle => None,
                GroundWish::None => Some("none".to_owned()),
                GroundWish::Color(color) => Some(hexadecimal(&color)),
            },
            masks: self.masks.iter().map(written_mask).collect(),
            shader: self.shader.map(|shader| shader.name().to_owned()),
            grout: match self.grout {
                GroutWish::OfStyle => None,
                GroutWish::None => Some("none".to_owned()),
                GroutWish::Auto => Some("auto".to_owned()),
                GroutWish::Color(color) => Some(hexadecimal(&color)),
            },
            grout_width: self.grout_width,
            weight: self.weight.as_deref().map(encoded_map).transpose()?,
            ..WrittenRecipe::default()
        })
    }
}

/// As many tiles as there are where nobody says a number.
fn usual_tiles(picture: (u32, u32), size: u64) -> u64 {
    let (width_px, height_px) = fitted_size(picture, u32::try_from(size).ok());
    default_fly_count(width_px, height_px) as u64
}

fn written_mask(mask: &MaskWish) -> WrittenMask {
    match mask {
        MaskWish::BuiltIn(name) => WrittenMask::Named((*name).to_owned()),
        MaskWish::File { name, bytes } => {
            let is_svg = name.to_ascii_lowercase().ends_with(".svg");
            let kind = if is_svg { MaskKind::Svg } else { MaskKind::Png };
            WrittenMask::Carried(CarriedMask { name: name.clone(), kind, bytes: bytes.to_vec() })
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::shapes::Shader;
    use crate::view::wishes::{BoundWishes, StyleWish, WeightMap};

    #[test]
    fn the_first_wishes_are_a_mosaic_and_nothing_more() {
        let written = Wishes::default().written((600, 400)).expect("it is written");
        let mosaic = WrittenRecipe { style: Some("mosaic".to_owned()), ..WrittenRecipe::default() };
        assert_eq!(written, mosaic);
    }

    #[test]
    fn every_wish_is_written_and_makes_a_recipe() {
        let bytes: Arc<[u8]> = std::fs::read("tests/photos/rgb.png").expect("it is there").into();
        let bounds =
            BoundWishes { side: Some([0.5, 2.0]), aspect: Some(3.0), overlap: Some(1), hole: Some(2), turn: Some(3) };
        let wishes = Wishes {
            style: StyleWish::Paint,
            tiles: Some(700),
            size: 300,
            evals_per_tile: 100,
            seed: 9,
            masks: vec![MaskWish::BuiltIn("disc"), MaskWish::File { name: "own.png".to_owned(), bytes }],
            shader: Some(Shader::Outline),
            grout: GroutWish::Color([1, 2, 255]),
            grout_width: Some(0.5),
            ground: GroundWish::Color([255, 0, 16]),
            colors: ColorWish::Palette { name: "two".to_owned(), colors: Arc::new([[0; 3], [255; 3]]) },
            bounds,
            weight: Some(Arc::new(WeightMap { size: [3, 2], luma: vec![0, 50, 100, 150, 200, 255] })),
        };
        let written = wishes.written((600, 400)).expect("it is written");
        assert_eq!((written.tiles, written.evals, written.seed), (Some(700), Some(70_000), Some(9)));
        assert_eq!((written.grout.as_deref(), written.background.as_deref()), (Some("0102ff"), Some("ff0010")));
        assert_eq!(written.palette, ["000000", "ffffff"]);
        assert_eq!((written.masks.len(), written.bounds.turn), (2, Some(3.0)));
        assert!(written.weight.is_some() && written.flags().is_none());
        written.recipe().expect("it can be asked for");
        let fewer = Wishes { colors: ColorWish::Few(8), ..Wishes::default() };
        let flags = fewer.written((9, 9)).expect("it is written").flags().expect("flags say it");
        assert_eq!(flags, ["--style", "mosaic", "--colors", "8"]);
    }
}
