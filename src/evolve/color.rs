//! Where the colour of a new fly comes from (paper Fig. 6 compares evolved colours with picked ones).

use super::palette::Palette;
use super::showing::Wanted;
use crate::model::rng::Stream;
use crate::model::{Canvas, Fly, Lane, Rgb, Target, Tile};

/// Where the colour of a new fly comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum ColorMode {
    /// From its genes: inherited and mutated.
    #[default]
    Evolved,
    /// From the target: the pixel nearest to the tile's centre.
    Pick,
    /// From the target: the mean of what the tile shows, per channel.
    Mean,
    /// From the target: the median of what the tile shows, per channel.
    Median,
}

/// The colour mode, and the palette.
///
/// A tile *shows* at the pixels where it would be in front of all others, if it took the place of the fly that it
/// replaces in the population before the generation. Each target channel is divided by the texel's shade, so that the
/// shaded colour fits. A tile that shows nowhere takes all pixels that it covers, and one that covers none takes the
/// pixel nearest to its centre. So do the flies of a whole new population, which have no others to show in front of.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ColorRule {
    /// Where colours come from.
    pub mode: ColorMode,
    /// With a palette, every colour becomes the nearest one of the palette.
    pub palette: Option<Palette>,
}

impl ColorRule {
    /// The colour rule for `mutant`, whose genes before mutation were `origin`. With a palette an evolved colour takes
    /// no small step, which would lead back to the colour that it had. Instead it becomes any colour of the palette one
    /// time in eight, and stays otherwise.
    pub(super) fn mutated(&self, origin: &Fly, mutant: Fly, stream: &mut Stream) -> Fly {
        match (&self.palette, self.mode) {
            (Some(palette), ColorMode::Evolved) if stream.chance(1 << 13) => mutant.with_color(palette.random(stream)),
            (Some(palette), ColorMode::Evolved) => mutant.with_color(palette.nearest(origin.color())),
            _ => mutant,
        }
    }

    /// `child` with the colour that it gets in the place of fly `index` of `lane`.
    pub(super) fn born(&self, lane: &Lane, index: u32, child: &Fly) -> Fly {
        let target = &lane.scene().target;
        let wanted = || {
            let tile = Tile::bake(child, &Canvas::evaluation(target.width_px(), target.height_px()));
            Wanted::by(lane, index, child.depth_key(index), &tile)
        };
        match self.mode {
            ColorMode::Evolved => self.snapped(child),
            ColorMode::Pick => self.alone(target, child),
            ColorMode::Mean => self.colored(child, wanted().map_or_else(|| nearest_pixel(target, child), |w| w.mean())),
            ColorMode::Median => {
                self.colored(child, wanted().map_or_else(|| nearest_pixel(target, child), |w| w.median()))
            }
        }
    }

    /// `fly` with the colour that it gets as part of a whole new population.
    pub(super) fn alone(&self, target: &Target, fly: &Fly) -> Fly {
        if self.mode == ColorMode::Evolved { self.snapped(fly) } else { self.colored(fly, nearest_pixel(target, fly)) }
    }

    /// `fly` with its own colour, or with the palette's nearest.
    pub(super) fn snapped(&self, fly: &Fly) -> Fly {
        self.palette.as_ref().map_or(*fly, |palette| palette.snapped(fly))
    }

    fn colored(&self, fly: &Fly, color: Rgb) -> Fly {
        fly.with_color(self.palette.as_ref().map_or(color, |palette| palette.nearest(color)))
    }
}

/// The target's pixel nearest to the fly's centre.
fn nearest_pixel(target: &Target, fly: &Fly) -> Rgb {
    let nearest = |place: i32, side_px: u32| ((place + 32) / 64).clamp(0, side_px as i32 - 1) as usize;
    let (i, j) = (nearest(fly.x, target.width_px()), nearest(fly.y, target.height_px()));
    target.pixels()[j * target.width_px() as usize + i]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::rng::Purpose;

    #[test]
    fn the_picked_pixel_is_the_nearest_to_the_centre() {
        let pixels = (0..12).map(|pixel| [pixel, 0, 0]).collect();
        let target = Target::new(4, 3, pixels).expect("4x3 pixels");
        let at = |x, y| nearest_pixel(&target, &Fly { x, y, ..Fly::ABSENT })[0];
        assert_eq!([at(0, 0), at(31, 0), at(32, 0), at(95, 0), at(192, 128), at(40, 64)], [0, 0, 1, 1, 11, 5]);
    }

    #[test]
    fn with_a_palette_an_evolved_colour_stays_or_becomes_any_one_time_in_eight() {
        let colors = [[0, 0, 0], [255, 0, 0], [0, 255, 0], [0, 0, 255]];
        let rule = ColorRule { palette: Some(Palette::new(colors).expect("four colours")), mode: ColorMode::Evolved };
        let parent = Fly { alive: true, ..Fly::ABSENT }.with_color([255, 0, 0]);
        let mutant = Fly { r: 60_000, g: 3_000, ..parent };
        let mut stream = Stream::new(3, Purpose::Birth, 0, 0);
        let children: Vec<Rgb> = (0..8_000).map(|_| rule.mutated(&parent, mutant, &mut stream).color()).collect();
        let count = |color: Rgb| children.iter().filter(|&&child| child == color).count();
        assert!(colors.iter().map(|&color| count(color)).sum::<usize>() == children.len(), "all are of the palette");
        assert!((7_150..7_350).contains(&count([255, 0, 0])), "7/8, and a quarter of the rest");
        assert!(colors.iter().all(|&color| count(color) > 180));
    }
}
