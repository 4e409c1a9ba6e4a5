//! A fly: nine genes as integers, and their bounds (paper section 4, Fig. 2).
//!
//! Integer genes make mutation and baking give the same bits everywhere. Floats exist only where people and files see
//! them: [`Genes`] holds them, and every value of a gene survives the way there and back.

/// Units of position and side per pixel: genes count 1/64 px.
pub const UNITS_PER_PX: u32 = 64;
/// Smallest side of a tile: 1/4 px.
pub const SIDE_MIN: u32 = UNITS_PER_PX / 4;
/// Largest side of a tile: 4,096 px; up to it, every pixel test fits 32 bits.
pub const SIDE_MAX: u32 = 4096 * UNITS_PER_PX;
/// Largest depth: z has 24 bits, smaller is nearer the eye.
pub const Z_MAX: u32 = (1 << 24) - 1;
/// Depth of z = 0 in the float range [-1, 1).
const Z_ZERO: f32 = (1_u32 << 23) as f32;

/// One individual of the population: the genes of a tile, and the mask that it wears.
///
/// An absent fly (`alive` is false) holds its place in the population but draws nothing; its marginal fitness is 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Fly {
    /// Horizontal centre in 1/64 px, from 0 to `(width - 1) * 64`.
    pub x: i32,
    /// Vertical centre in 1/64 px, from 0 to `(height - 1) * 64`.
    pub y: i32,
    /// Depth, 24 bits; smaller is nearer. At equal depth the lower index is nearer.
    pub z: u32,
    /// Red, 16 bits.
    pub r: u16,
    /// Green, 16 bits.
    pub g: u16,
    /// Blue, 16 bits.
    pub b: u16,
    /// Angle, 16 bits of a turn, from +x towards +y.
    pub angle: u16,
    /// Width in 1/64 px, [`SIDE_MIN`] to [`SIDE_MAX`].
    pub w: u32,
    /// Height in 1/64 px, [`SIDE_MIN`] to [`SIDE_MAX`].
    pub h: u32,
    /// Layer of the mask set that shapes the tile; 0 is the full square.
    pub mask: u16,
    /// Whether the fly draws a tile at all.
    pub alive: bool,
}

/// The genes as people and files see them: pixels, degrees, [-1, 1] for depth, [0, 1] for colour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Genes {
    /// Horizontal centre in px.
    pub x: f32,
    /// Vertical centre in px.
    pub y: f32,
    /// Depth in [-1, 1).
    pub z: f32,
    /// Red in [0, 1].
    pub r: f32,
    /// Green in [0, 1].
    pub g: f32,
    /// Blue in [0, 1].
    pub b: f32,
    /// Width in px.
    pub w: f32,
    /// Height in px.
    pub h: f32,
    /// Angle in degrees, [0, 360).
    pub angle_deg: f32,
}

impl Fly {
    /// A fly that draws nothing.
    pub const ABSENT: Self =
        Self { x: 0, y: 0, z: Z_MAX, r: 0, g: 0, b: 0, angle: 0, w: SIDE_MIN, h: SIDE_MIN, mask: 0, alive: false };

    /// Depth key of this fly at `index` in its population: smaller is nearer, and no two flies share one.
    #[must_use]
    pub fn depth_key(&self, index: u32) -> u64 {
        (u64::from(self.z) << 32) | u64::from(index)
    }

    /// The fly with every gene clamped to its bounds in a picture of `width_px` x `height_px`.
    #[must_use]
    pub fn clamped(mut self, width_px: u32, height_px: u32) -> Self {
        self.x = self.x.clamp(0, position_max(width_px));
        self.y = self.y.clamp(0, position_max(height_px));
        self.z = self.z.min(Z_MAX);
        self.w = self.w.clamp(SIDE_MIN, SIDE_MAX);
        self.h = self.h.clamp(SIDE_MIN, SIDE_MAX);
        self
    }

    /// The genes as floats. Exact: [`Fly::from_genes`] gives the same fly back.
    #[must_use]
    pub fn genes(&self) -> Genes {
        let px = UNITS_PER_PX as f32;
        Genes {
            x: self.x as f32 / px,
            y: self.y as f32 / px,
            z: self.z as f32 / Z_ZERO - 1.0,
            r: f32::from(self.r) / 65535.0,
            g: f32::from(self.g) / 65535.0,
            b: f32::from(self.b) / 65535.0,
            w: self.w as f32 / px,
            h: self.h as f32 / px,
            angle_deg: f32::from(self.angle) * (360.0 / 65536.0),
        }
    }

    /// The fly with these genes, each rounded to the nearest integer gene and saturated at what its type can hold.
    ///
    /// Bounds that depend on the picture are not applied: see [`Fly::clamped`].
    #[must_use]
    pub fn from_genes(genes: &Genes, mask: u16) -> Self {
        // In f64, since adding a half to a large f32 would round it away.
        let rounded = |value: f32, scale: f64| libm::floor(f64::from(value) * scale + 0.5);
        let px = f64::from(UNITS_PER_PX);
        Self {
            x: rounded(genes.x, px) as i32,
            y: rounded(genes.y, px) as i32,
            z: (rounded(genes.z + 1.0, f64::from(Z_ZERO)) as u32).min(Z_MAX),
            r: rounded(genes.r, 65535.0) as u16,
            g: rounded(genes.g, 65535.0) as u16,
            b: rounded(genes.b, 65535.0) as u16,
            angle: (rounded(genes.angle_deg, 65536.0 / 360.0) as i64 & 0xFFFF) as u16,
            w: rounded(genes.w, px) as u32,
            h: rounded(genes.h, px) as u32,
            mask,
            alive: true,
        }
    }
}

/// Largest position gene along a side of `side_px` pixels: the centre of the last pixel.
#[must_use]
pub fn position_max(side_px: u32) -> i32 {
    ((side_px - 1) * UNITS_PER_PX) as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_round_trip(fly: Fly) {
        assert_eq!(Fly::from_genes(&fly.genes(), fly.mask), fly);
    }

    #[test]
    fn every_angle_and_channel_survives_the_way_through_floats() {
        for value in 0..=u16::MAX {
            assert_round_trip(Fly { angle: value, r: value, g: value, b: value, alive: true, ..Fly::ABSENT });
        }
    }

    #[test]
    fn depths_positions_and_sides_survive_the_way_through_floats() {
        for step in 0..(1 << 18) {
            let (z, w) = (step * 64 + step % 64, SIDE_MIN + step % (SIDE_MAX - SIDE_MIN + 1));
            assert_round_trip(Fly {
                x: (step * 13 % (1 << 22)) as i32,
                y: step as i32,
                z,
                w,
                h: w,
                alive: true,
                ..Fly::ABSENT
            });
        }
        for z in [0, 1, (1 << 23) - 1, 1 << 23, (1 << 23) + 1, Z_MAX - 1, Z_MAX] {
            assert_round_trip(Fly { z, w: SIDE_MAX, h: SIDE_MAX, alive: true, ..Fly::ABSENT });
        }
    }
}
