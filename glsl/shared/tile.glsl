// The tile and its coverage rule. Twin: src/model/tile.rs, which explains the units; layout: src/gpu/layout.rs.

struct Tile {
    int x0;
    int y0;
    int x1;
    int y1;
    int u0;
    int v0;
    int cos_step;
    int sin_step;
    uint w;
    uint h;
    uint color;
    uint mask;
};

const uint NO_FLY = 0xFFFFFFFFu;
const uint COVERAGE_THRESHOLD = 128u;
// 4096 steps of u per unit of width, 256 texels per width.
const uint STEPS_PER_TEXEL = 16u;

// Tile coordinates of pixel (i, j), counted from the tile's corner.
uvec2 tile_coordinates(Tile tile, int i, int j) {
    int di = i - tile.x0;
    int dj = j - tile.y0;
    return uvec2(uint(tile.u0 + di * tile.cos_step + dj * tile.sin_step),
                 uint(tile.v0 - di * tile.sin_step + dj * tile.cos_step));
}

// Half-open in the tile's own frame.
bool is_inside(Tile tile, uvec2 uv) {
    return uv.x < tile.w << 12 && uv.y < tile.h << 12;
}

// floor(u * 256 / (w * 4096)), exactly, in 32 bits.
ivec2 tile_texel(Tile tile, uvec2 uv) {
    return ivec2(uv / STEPS_PER_TEXEL / uvec2(tile.w, tile.h));
}

// A packed colour under a shade: each channel (c * shade + 127) / 255.
uint shaded(uint color, uint shade) {
    uvec3 channels = (uvec3(color, color >> 8, color >> 16) & 255u) * shade + 127u;
    channels /= 255u;
    return channels.x | channels.y << 8 | channels.z << 16;
}
