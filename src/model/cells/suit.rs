//! What a tile wears (its mask, shades and ring of grout), and how that changes its error at a pixel.
//!
//! Twin: `glsl/shared/cells_suit.glsl`. The rules are those of [`crate::model::Tile`].

use super::footprint::Footprint;
use super::pixel::{TRANSPARENT, UNWANTED_ERROR, difference};
use super::rules::Rules;
use crate::model::Fly;
use crate::model::mask::{Blend, COVERAGE_THRESHOLD, MASK_SIDE, MaskSet, TEXELS, Texel, shaded};
use crate::model::tables::TRIG_ONE;
use crate::model::tile::{inverse, quotient};

/// What one fly wears.
#[derive(Clone, Copy, Debug)]
pub struct Suit<'a> {
    /// The texels of its mask; `None` is the full square.
    texels: Option<&'a [Texel; TEXELS]>,
    /// Coverage from which on a texel belongs to the tile.
    threshold: u8,
    /// Sides in 1/64 px and their inverses.
    w: u32,
    h: u32,
    w_inverse: u32,
    h_inverse: u32,
    /// Width of the ring in units of u and v.
    ring: u32,
    grout_color: u32,
}

/// What a tile shows at a pixel that it covers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Look {
    /// Its colour under this shade, 0 to 255.
    Shade(u32),
    /// The grout.
    Grout,
}

impl<'a> Suit<'a> {
    /// What `fly` wears.
    #[inline]
    #[must_use]
    pub fn of(fly: &Fly, masks: &'a MaskSet, rules: &Rules) -> Self {
        let is_masked = fly.mask > 0;
        let inverse_of = |side| if is_masked { inverse(side) } else { 0 };
        Self {
            texels: is_masked.then(|| masks.layers()[usize::from(fly.mask)].texels()),
            threshold: match masks.blend() {
                Blend::Opaque => COVERAGE_THRESHOLD,
                Blend::Translucent => 1,
            },
            w: fly.w,
            h: fly.h,
            w_inverse: inverse_of(fly.w),
            h_inverse: inverse_of(fly.h),
            ring: rules.grout.min(fly.w).min(fly.h) * TRIG_ONE as u32,
            grout_color: rules.grout_color,
        }
    }

    /// The texel at tile coordinates inside the tile's rectangle. Outside it the result means nothing.
    #[inline(always)]
    #[must_use]
    pub fn texel(&self, u: u32, v: u32) -> Texel {
        const STEPS_PER_TEXEL: u32 = TRIG_ONE as u32 / MASK_SIDE as u32;
        let Some(texels) = self.texels else { return Texel { coverage: 255, shade: 255 } };
        let column = quotient(u / STEPS_PER_TEXEL, self.w, self.w_inverse);
        let row = quotient(v / STEPS_PER_TEXEL, self.h, self.h_inverse);
        texels[row.wrapping_mul(MASK_SIDE as u32).wrapping_add(column) as usize % TEXELS]
    }

    /// The texel `right_px` pixels to the right of tile coordinates.
    #[inline(always)]
    #[must_use]
    pub fn texel_at(&self, footprint: &Footprint, (u, v): (i32, i32), right_px: i32) -> Texel {
        let by = |step: i32| step.wrapping_mul(right_px);
        self.texel(u.wrapping_add(by(footprint.cos)) as u32, v.wrapping_sub(by(footprint.sin)) as u32)
    }

    /// What the tile shows at tile coordinates inside its rectangle; `None` in a hole of its mask.
    #[inline(always)]
    #[must_use]
    pub fn look(&self, footprint: &Footprint, u: u32, v: u32) -> Option<Look> {
        let texel = self.texel(u, v);
        if texel.coverage < self.threshold {
            return None;
        }
        let shade = u32::from(texel.shade);
        let within = |place: u32, end: i32| place.wrapping_sub(self.ring) < (end as u32).saturating_sub(2 * self.ring);
        let is_inside = within(u, footprint.u_end) & within(v, footprint.v_end);
        Some(if is_inside { Look::Shade(shade) } else { Look::Grout })
    }

    /// The error of a tile of this colour at a pixel, times the pixel's weight.
    #[inline(always)]
    #[must_use]
    pub fn error(&self, look: Look, color: u32, target: u32, weight: i32) -> i32 {
        if target & TRANSPARENT != 0 {
            return UNWANTED_ERROR * weight;
        }
        let shown = match look {
            Look::Shade(shade) => shaded(color, shade),
            Look::Grout => self.grout_color,
        };
        difference(target, shown) * weight
    }
}

/// The colour that comes nearest to `target` under `shade`: each channel divided by the shade, at most 255.
#[inline]
#[must_use]
pub fn unshaded(target: u32, shade: u32) -> u32 {
    if shade == 255 || shade == 0 {
        return target & 0xFF_FFFF;
    }
    let channel = |shift: u32| (((target >> shift & 255) * 255 + shade / 2) / shade).min(255) << shift;
    channel(0) | channel(8) | channel(16)
}
