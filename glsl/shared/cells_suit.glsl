// What a tile wears, and what that makes of its error at a pixel. Twin: src/model/cells/suit.rs. Needs
// cells_state.glsl, tile.glsl, mask.glsl, cells_footprint.glsl, cells_pixel.glsl.

// What a tile shows at a pixel of its rectangle: its colour under a shade of 0 to 255, or one of these.
const uint LOOK_GROUT = 256u;
const uint LOOK_HOLE = 257u;
const int UNWANTED_ERROR = 765;

// What a pixel is like, besides its target.
struct Want {
    int weight;
    // No tile is wanted there.
    bool is_unwanted;
};

// The third word of a pixel holds the depth of its top fly, then its weight less 1 and whether it wants no tile.
const uint TOP_Z_MASK = 0x1FFFFFFu;

Want want_of(uint word) {
    return DRESSED == 0u ? Want(1, false) : Want(int(word >> 25 & 15u) + 1, word >> 29 != 0u);
}

uint top_z(uint word) {
    return DRESSED == 0u ? word : word & TOP_Z_MASK;
}

// See `inverse` in src/model/tile.rs; for sides up to 2^16.
uint inverse_of(uint side) {
    uint shift = uint(max(findMSB(side) - 7, 0));
    return shift << 24 | (0xFFFFFFFFu >> 9u - shift) / max(side, 1u);
}

Tile suit_of(Fly fly) {
    Tile suit;
    if (DRESSED == 1u) {
        suit.w = fly.w;
        suit.h = fly.h;
        suit.mask = fly.form & 0xFFFFu;
        suit.w_inverse = inverse_of(fly.w);
        suit.h_inverse = inverse_of(fly.h);
        suit.ring = min(rule.grout, min(fly.w, fly.h)) << 12;
    }
    return suit;
}

// What the tile shows at tile coordinates inside its rectangle.
uint look_at(Tile suit, ivec2 end, uvec2 uv) {
    uvec2 texel = uvec2(255u);
    if (suit.mask > 0u) {
        texel = mask_texel(rule.first_mask + suit.mask, suit, uv);
    }
    uvec2 inner = uvec2(end) - min(uvec2(end), uvec2(2u * suit.ring));
    uint look = all(lessThan(uv - suit.ring, inner)) ? texel.y : LOOK_GROUT;
    return texel.x < COVERAGE_THRESHOLD ? LOOK_HOLE : look;
}

// What the tile shows at a pixel; LOOK_HOLE where it does not cover it.
uint look_of(Footprint footprint, Tile suit, ivec2 pixel) {
    bool covers = footprint_covers(footprint, pixel);
    uint look = 255u;
    if (DRESSED == 1u) {
        look = look_at(suit, footprint.end, uvec2(footprint_coordinates(footprint, pixel)));
    }
    return covers ? look : LOOK_HOLE;
}

// The error of a tile of this colour, times the pixel's weight.
int look_error(uint look, uint color, uint target, Want want) {
    if (DRESSED == 0u) {
        return difference(target, color);
    }
    uint shown = look == LOOK_GROUT ? rule.grout_color : shaded(color, look);
    return (want.is_unwanted ? UNWANTED_ERROR : difference(target, shown)) * want.weight;
}

// The colour that would show `target` under `shade`, as near as it can.
uint unshaded(uint target, uint shade) {
    uvec3 channels = uvec3(target, target >> 8, target >> 16) & 255u;
    uvec3 bright = min((channels * 255u + shade / 2u) / max(shade, 1u), uvec3(255u));
    channels = shade == 255u || shade == 0u ? channels : bright;
    return channels.x | channels.y << 8 | channels.z << 16;
}
