//! Fitness by brute force, written apart from the engine: only genes, the sine table and the rules of the design.

use smalti::model::blocks::index_of;
use smalti::model::mask::{COVERAGE_THRESHOLD, MASK_SIDE, MaskSet};
use smalti::model::tables::cos_sin;
use smalti::model::{Blend, Fly, Scene};

/// What each pixel of a picture shows, nearest to farthest, with every fly that covers it.
pub struct Reference {
    scene: Scene,
    /// Per pixel, row by row: every covering fly, nearest first.
    stacks: Vec<Vec<Layer>>,
}

/// What a fly shows at a pixel. Depth comes first, so that layers sort by it.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Layer {
    key: u64,
    color: [u8; 3],
    coverage: u8,
}

impl Reference {
    pub fn new(scene: &Scene, flies: &[Fly]) -> Self {
        let (width, height) = (i64::from(scene.target.width_px()), i64::from(scene.target.height_px()));
        let mut stacks = vec![Vec::new(); (width * height) as usize];
        for (index, fly) in flies.iter().enumerate().filter(|(_, fly)| fly.alive) {
            // No pixel is farther from the centre than half of both sides together.
            let reach = i64::from(fly.w + fly.h) / 128 + 2;
            let (x, y) = (i64::from(fly.x) / 64, i64::from(fly.y) / 64);
            for j in (y - reach).max(0)..(y + reach + 1).min(height) {
                for i in (x - reach).max(0)..(x + reach + 1).min(width) {
                    let key = (u64::from(fly.z) << 32) | index as u64;
                    stacks[(j * width + i) as usize].extend(layer_at(fly, key, &scene.masks, i, j));
                }
            }
        }
        stacks.iter_mut().for_each(|stack| stack.sort_unstable());
        Self { scene: scene.clone(), stacks }
    }

    /// Sum of absolute errors of the picture without `left_out`.
    pub fn sae_without(&self, left_out: Option<u32>) -> u64 {
        (0..self.stacks.len()).map(|pixel| self.error_without(pixel, left_out)).sum()
    }

    /// Marginal fitness of every fly: the error of each pixel with and without each fly that covers it.
    pub fn marginal(&self, fly_count: usize) -> Vec<i64> {
        // The third fly from the top of an opaque pixel matters to nobody, and neither do those behind it.
        let depth = if self.scene.masks.blend() == Blend::Opaque { 3 } else { usize::MAX };
        let mut marginal = vec![0; fly_count];
        for pixel in 0..self.stacks.len() {
            let with = self.error_without(pixel, None) as i64;
            for layer in self.stacks[pixel].iter().take(depth) {
                let fly = index_of(layer.key);
                marginal[fly as usize] += self.error_without(pixel, Some(fly)) as i64 - with;
            }
        }
        marginal
    }

    /// The `depth`-th nearest fly of every pixel (0 is the top), or `u32::MAX`.
    pub fn layer(&self, depth: usize) -> Vec<u32> {
        self.stacks.iter().map(|stack| stack.get(depth).map_or(u32::MAX, |layer| index_of(layer.key))).collect()
    }

    /// The colours that show.
    pub fn colors(&self) -> Vec<[u8; 3]> {
        (0..self.stacks.len()).map(|pixel| self.color_without(pixel, None)).collect()
    }

    fn error_without(&self, pixel: usize, left_out: Option<u32>) -> u64 {
        let (color, target) = (self.color_without(pixel, left_out), self.scene.target.pixels()[pixel]);
        color.iter().zip(target).map(|(&shown, wanted)| u64::from(shown.abs_diff(wanted))).sum()
    }

    fn color_without(&self, pixel: usize, left_out: Option<u32>) -> [u8; 3] {
        let background = self.scene.background;
        let mut layers = self.stacks[pixel].iter().filter(|layer| Some(index_of(layer.key)) != left_out);
        match self.scene.masks.blend() {
            Blend::Opaque => layers.next().map_or(background, |layer| layer.color),
            Blend::Translucent => composite(layers, background),
        }
    }
}

/// Layers over one another, nearest first, in 16-bit fixed point.
fn composite<'a>(layers: impl Iterator<Item = &'a Layer>, background: [u8; 3]) -> [u8; 3] {
    let (mut left, mut sums) = (65_536_u64, [32_768_u64; 3]);
    let mut add = |weight: u64, color: [u8; 3]| (0..3).for_each(|c| sums[c] += weight * u64::from(color[c]));
    for layer in layers {
        let coverage = u64::from(layer.coverage);
        let opacity = if coverage < 128 { coverage } else { coverage + 1 };
        let behind = left * (256 - opacity) / 256;
        add(left - behind, layer.color);
        left = behind;
        if left == 0 {
            break;
        }
    }
    add(left, background);
    sums.map(|sum| (sum / 65_536) as u8)
}

/// What `fly` shows at pixel `(i, j)`, if it covers it.
fn layer_at(fly: &Fly, key: u64, masks: &MaskSet, i: i64, j: i64) -> Option<Layer> {
    let (cos, sin) = cos_sin(fly.angle);
    let (dx, dy) = (i * 64 - i64::from(fly.x), j * 64 - i64::from(fly.y));
    let u = dx * i64::from(cos) + dy * i64::from(sin);
    let v = dy * i64::from(cos) - dx * i64::from(sin);
    let (half_w, half_h) = (i64::from(fly.w) * 2048, i64::from(fly.h) * 2048);
    if !(-half_w..half_w).contains(&u) || !(-half_h..half_h).contains(&v) {
        return None;
    }
    let column = (u + half_w) * MASK_SIDE as i64 / (2 * half_w);
    let row = (v + half_h) * MASK_SIDE as i64 / (2 * half_h);
    let texel = masks.layers()[usize::from(fly.mask)].texels()[row as usize * MASK_SIDE + column as usize];
    let rounded = |channel: u16| (f64::from(channel) * 255.0 / 65535.0).round() as u64;
    let shade = |channel: u64| ((channel * u64::from(texel.shade) + 127) / 255) as u8;
    let color = [fly.r, fly.g, fly.b].map(|channel| shade(rounded(channel)));
    let least = if masks.blend() == Blend::Opaque { COVERAGE_THRESHOLD } else { 1 };
    (texel.coverage >= least).then_some(Layer { key, color, coverage: texel.coverage })
}
