// Colour and fly of a pixel, if the tile covers it by the integer rule. Twin: src/cpu/mosaic.rs.
#version 460
#extension GL_EXT_samplerless_texture_functions : require
#extension GL_GOOGLE_include_directive : require

#include "shared/tile.glsl"

layout(binding = 2) uniform utexture2DArray masks;

layout(push_constant) uniform Push {
    ivec2 origin;
    vec2 pixel_size;
    uint first_mask;
    // Packed colour.
    uint grout;
} push;

// 1: tiles have a ring of grout.
layout(constant_id = 0) const uint GROUTED = 0u;

layout(location = 0) flat in uvec4 place;
layout(location = 1) flat in uvec4 steps;
layout(location = 2) flat in uvec4 look;
layout(location = 3) flat in uvec4 names;
layout(location = 0) out vec4 color;
layout(location = 1) out uint shown_fly;

void main() {
    Tile tile;
    tile.x0 = int(place.x);
    tile.y0 = int(place.y);
    tile.u0 = int(place.z);
    tile.v0 = int(place.w);
    tile.cos_step = int(steps.x);
    tile.sin_step = int(steps.y);
    tile.w = steps.z;
    tile.h = steps.w;
    tile.color = look.x;
    tile.w_inverse = look.y;
    tile.h_inverse = look.z;
    tile.ring = look.w;
    tile.mask = names.z;
    ivec2 pixel = ivec2(gl_FragCoord.xy) + push.origin;
    uvec2 uv = tile_coordinates(tile, pixel.x, pixel.y);
    if (!is_inside(tile, uv)) {
        discard;
    }
    uint shown = tile.color;
    if (tile.mask != 0u) {
        uvec2 texel = texelFetch(masks, ivec3(tile_texel(tile, uv), push.first_mask + tile.mask), 0).xy;
        if (texel.x < COVERAGE_THRESHOLD) {
            discard;
        }
        shown = shaded(shown, texel.y);
    }
    if (GROUTED == 1u && !is_inside_ring(tile, uv)) {
        shown = push.grout;
    }
    color = vec4(uvec3(shown, shown >> 8, shown >> 16) & 255u, 255.0) / 255.0;
    shown_fly = names.x;
    // Ranks are below 2^24, so each is a different float.
    gl_FragDepth = float(names.y) / 16777216.0;
}
