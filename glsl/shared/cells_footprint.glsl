// Which pixels a fly covers at evaluation size. Twin: src/model/cells/footprint.rs. Needs cells_state.glsl.

struct Footprint {
    // Left, top, right and bottom of the clipped box, inclusive; empty if it ends before it begins.
    ivec4 box;
    ivec2 uv0;
    int cos_step;
    int sin_step;
    ivec2 end;
};

const Footprint EMPTY_FOOTPRINT = Footprint(ivec4(1, 1, 0, 0), ivec2(0), 0, 0, ivec2(0));

ivec2 cos_sin(uint angle) {
    uint place = angle >> 4;
    return ivec2(sine_at(place + 1024u & 4095u), sine_at(place));
}

int half_extent(int along, int across, uint w, uint h) {
    uint sum = uint(abs(along)) * w + uint(abs(across)) * h;
    return int((sum >> 13) + (sum >> 23) + 2u);
}

Footprint footprint_of(Fly fly, uvec2 size) {
    ivec2 trig = cos_sin(fly.ba >> 16);
    ivec2 centre = ivec2(fly.x, fly.y);
    ivec2 extent = ivec2(half_extent(trig.x, trig.y, fly.w, fly.h), half_extent(trig.y, trig.x, fly.w, fly.h));
    ivec2 first = max(centre - extent + 63 >> 6, ivec2(0));
    ivec2 last = min(centre + extent >> 6, ivec2(size) - 1);
    ivec2 d = first * 64 - centre;
    Footprint footprint;
    footprint.box = ivec4(first, last);
    footprint.uv0 = ivec2(d.x * trig.x + d.y * trig.y + int(fly.w << 11), d.y * trig.x - d.x * trig.y + int(fly.h << 11));
    footprint.cos_step = trig.x * 64;
    footprint.sin_step = trig.y * 64;
    footprint.end = ivec2(fly.w << 12, fly.h << 12);
    bool is_empty = !is_alive(fly) || any(greaterThan(first, last));
    footprint.box = is_empty ? ivec4(1, 1, 0, 0) : footprint.box;
    return footprint;
}

// Tile coordinates of a pixel, counted from the tile's corner.
ivec2 footprint_coordinates(Footprint footprint, ivec2 pixel) {
    ivec2 d = pixel - footprint.box.xy;
    return footprint.uv0
        + ivec2(d.x * footprint.cos_step + d.y * footprint.sin_step, d.y * footprint.cos_step - d.x * footprint.sin_step);
}

bool footprint_covers(Footprint footprint, ivec2 pixel) {
    bool is_in_box = all(greaterThanEqual(pixel, footprint.box.xy)) && all(lessThanEqual(pixel, footprint.box.zw));
    uvec2 uv = uvec2(footprint_coordinates(footprint, pixel));
    return is_in_box && all(lessThan(uv, uvec2(footprint.end)));
}
