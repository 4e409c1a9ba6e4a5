// Translucent tiles in the search: what lies on a pixel, and the colour that serves a child best. Twin:
// src/model/cells/glaze.rs. Needs tile.glsl, mask.glsl, translucency.glsl, cells_suit.glsl.

// Most tiles on a pixel; a multiple of LAYERS_AT_ONCE.
const uint GLAZED_DEPTH = 24u;
// Layers in each turn of a loop over a stack, as software Vulkan grants an invocation few turns.
const uint LAYERS_AT_ONCE = 4u;
// Most turns of a loop over a stack, with the one that ends it.
const uint STACK_TURNS = GLAZED_DEPTH / LAYERS_AT_ONCE + 1u;

// `is_fresh` of the header in the iteration that ends a round.
const uint ROUND_OVER = 2u;

// Where a pixel's nearest tile lies among the stacks; the next ones follow, one block of pixels apart.
uint stack_first(uint place) {
    return rule.first_stack + place / 64u * (GLAZED_DEPTH * 64u) + place % 64u;
}

uint stack_turns(uint depth) {
    return (depth + LAYERS_AT_ONCE - 1u) / LAYERS_AT_ONCE + 1u;
}

// Coverage and shade of a tile at a pixel; no coverage where it is not.
uvec2 texel_of(Footprint footprint, Tile suit, ivec2 pixel) {
    uvec2 texel = uvec2(255u);
    if (suit.mask > 0u) {
        texel = mask_texel(rule.first_mask + suit.mask, suit, uvec2(footprint_coordinates(footprint, pixel)));
    }
    return footprint_covers(footprint, pixel) ? texel : uvec2(0u);
}

// Weighted error of a pixel from its sums with the background, and the background's weight.
int glazed_error(uvec3 sums, uint left, uint target, Want want) {
    ivec3 lack = abs(ivec3(sums + CLEAR / 2u >> 16) - ivec3(channels(target)));
    int unwanted = left < CLEAR ? UNWANTED_ERROR : 0;
    return (want.is_unwanted ? unwanted : lack.x + lack.y + lack.z) * want.weight;
}

// A tile's share of a pixel in 1/256.
int share_q8(uint weight, uint shade) {
    // Over 256 and, exact below 2^16, over 255.
    return int((weight * shade + 32640u >> 8) * 32897u >> 23);
}

// What the channels of a target lack when the tile shows black, with 6 fractional bits.
ivec3 lacks_q6(uint target, uvec3 sums) {
    return ivec3(channels(target) << 16) - ivec3(sums) + 512 >> 10;
}

// A channel of the colour of least squares, from two sums of 64 bits in two words.
uint fitted(uvec2 lacks, uvec2 squares) {
    uvec2 most = uvec2(lacks.x << 3, lacks.y << 3 | lacks.x >> 29);
    uint value = 0u;
    for (uint bit = 128u; bit > 0u; bit >>= 1) {
        uint factor = 2u * (value | bit) - 1u;
        uint high;
        uint low;
        umulExtended(squares.x, factor, high, low);
        high += squares.y * factor;
        value |= high < most.y || high == most.y && low <= most.x ? bit : 0u;
    }
    return int(lacks.y) < 0 ? 0u : value;
}
