// What a translucent tile shows, for kernels whose work may take several dispatches. Needs tile.glsl and mask.glsl.

// The first tiles of the list were looked at by an earlier dispatch.
const uint FLAG_CONTINUED = 2u;
// A later dispatch goes on with this block.
const uint FLAG_UNFINISHED = 4u;

// What a tile shows at tile coordinates: its colour under its shade, and its coverage in the highest byte; 0 where it
// is not.
uint layer_at(uint first_mask, Tile tile, uvec2 uv) {
    uint layer = 0u;
    if (is_inside(tile, uv)) {
        layer = tile.color | 255u << 24;
        if (tile.mask != 0u) {
            uvec2 texel = mask_texel(first_mask + tile.mask, tile, uv);
            layer = texel.x == 0u ? 0u : shaded(tile.color, texel.y) | texel.x << 24;
        }
    }
    return layer;
}
