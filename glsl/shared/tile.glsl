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
    uint w_inverse;
    uint h_inverse;
    uint ring;
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

// Whether a covered pixel shows the tile's own colour and not its grout. Twin: `Tile::is_inside_ring`.
bool is_inside_ring(Tile tile, uvec2 uv) {
    uint ring = tile.ring << 12;
    uvec2 end = uvec2(tile.w << 12, tile.h << 12);
    return all(lessThan(uv - ring, end - min(end, uvec2(2u * ring))));
}

// value / divisor for values below divisor << 8. Twin: `quotient` in src/model/tile.rs, which explains why it is exact.
uvec2 quotients(uvec2 value, uvec2 divisor, uvec2 inverse) {
    uvec2 estimate = (value >> (inverse >> 24)) * (inverse & 0xFFFFFFu) >> 23;
    ivec2 is_enough = ivec2(value - estimate * divisor - divisor) >> 31;
    return estimate + 1u + uvec2(is_enough);
}

// floor(u * 256 / (w * 4096)), exactly, in 32 bits.
uvec2 tile_texel(Tile tile, uvec2 uv) {
    return quotients(uv / STEPS_PER_TEXEL, uvec2(tile.w, tile.h), uvec2(tile.w_inverse, tile.h_inverse));
}

// A packed colour under a shade: each channel (c * shade + 127) / 255.
uint shaded(uint color, uint shade) {
    uvec3 channels = (uvec3(color, color >> 8, color >> 16) & 255u) * shade + 127u;
    // Division by 255, exact below 2^16.
    channels = channels * 32897u >> 23;
    return channels.x | channels.y << 8 | channels.z << 16;
}
