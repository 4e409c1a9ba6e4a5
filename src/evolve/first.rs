//! The population that an evolution begins with.

use super::scheme::PaperScheme;
use crate::model::operators::{RandomFlies, Rotation, random_layer, scaled_tile_side};
use crate::model::rng::{Purpose, Stream};
use crate::model::{Fly, Target};

/// Random flies for a population of which `living` flies live at first. They wear the mask `layers`.
pub(super) fn newcomers(
    scheme: &PaperScheme,
    (width_px, height_px): (u32, u32),
    living: usize,
    layers: &[u16],
) -> RandomFlies {
    let side = scaled_tile_side(width_px, height_px, living, scheme.tile_scale_q16);
    let layers = if layers.is_empty() { vec![0] } else { layers.to_vec() };
    RandomFlies { width_px, height_px, side, rotation: scheme.rotation, layers }
}

/// The first population of a scheme: uniform random flies with sides by Eq. 1 (paper section 4), coloured by the
/// scheme's rule. With mitosis only some live at first. They come first, and the rest are absent.
#[must_use]
pub fn first_population(scheme: &PaperScheme, target: &Target, fly_count: usize) -> Vec<Fly> {
    let living = scheme.living(0, fly_count);
    let newcomers = newcomers(scheme, (target.width_px(), target.height_px()), living, scheme.layers(0));
    let fly = |slot| newcomers.fly(&mut Stream::new(scheme.seed, Purpose::FirstPopulation, 0, slot));
    let mut flies: Vec<Fly> = (0..living as u64).map(|slot| scheme.color.alone(target, &fly(slot))).collect();
    flies.resize(fly_count, Fly::ABSENT);
    flies
}

/// The first population of the paper's scheme with its defaults.
#[must_use]
pub fn random_population(width_px: u32, height_px: u32, fly_count: usize, seed: u64) -> Vec<Fly> {
    let newcomers = newcomers(&PaperScheme::default(), (width_px, height_px), fly_count, &[]);
    let fly = |slot| newcomers.fly(&mut Stream::new(seed, Purpose::FirstPopulation, 0, slot));
    (0..fly_count as u64).map(fly).collect()
}

/// Adapts `flies` from elsewhere to a scheme that begins from them. They wear its first masks if it names any, take
/// colours of its palette if it has one, and lie straight if it turns no tiles. Everything else stays.
#[must_use]
pub fn begin_from(scheme: &PaperScheme, mut flies: Vec<Fly>) -> Vec<Fly> {
    for fly in flies.iter_mut().filter(|fly| fly.alive) {
        *fly = scheme.color.snapped(fly);
        if scheme.rotation == Rotation::None {
            fly.angle = 0;
        }
    }
    let layers = scheme.layers(0);
    if !layers.is_empty() {
        wear(&mut flies, layers, scheme.seed, 0);
    }
    flies
}

/// Gives every living fly one of `layers`, all equally likely, from `run` on.
pub(super) fn wear(flies: &mut [Fly], layers: &[u16], seed: u64, run: u32) {
    for (slot, fly) in (0..).zip(flies).filter(|(_, fly)| fly.alive) {
        fly.mask = random_layer(layers, &mut Stream::new(seed, Purpose::Mask, run, slot));
    }
}
