// Colours of a patch of translucent tiles, at any size: the rule of the fitness, which fixed-function blending, with
// its own rounding, would not keep. One workgroup is one block of samples, one invocation a column of
// SAMPLES_PER_THREAD in it. Twin: src/cpu/mosaic.rs.
#version 460
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require

#define MASK_BINDING 5
#include "shared/tile.glsl"
#include "shared/translucency.glsl"
#include "shared/mask.glsl"
#include "shared/layer.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint BLOCK_SIDE = 8u;
layout(constant_id = 2) const uint SAMPLES_PER_THREAD = 8u;
// 1: nothing lies behind the tiles, and the highest byte of a colour is its opacity.
layout(constant_id = 3) const uint TRANSPARENT = 0u;

struct ComposeItem {
    int x;
    int y;
    uint first_entry;
    uint entry_count;
    uint first_sample;
    uint flags;
};

layout(std430, binding = 0) readonly buffer Work { ComposeItem items[]; };
layout(std430, binding = 1) readonly buffer Entries { uint entries[]; };
layout(std430, binding = 2) readonly buffer Tiles { Tile tiles[]; };
// Transmittance and sums of the samples of the one block that several dispatches work on.
layout(std430, binding = 3) buffer States { uvec4 states[]; };
layout(std430, binding = 4) writeonly buffer Colors { uint colors[]; };

layout(push_constant) uniform Push {
    uint item_count;
    uint background;
} push;

void main() {
    uint number = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    if (number >= push.item_count) {
        return;
    }
    ComposeItem item = items[number];
    uint column = gl_LocalInvocationID.x % BLOCK_SIDE;
    uint row = gl_LocalInvocationID.x / BLOCK_SIDE * SAMPLES_PER_THREAD;
    uint first = row * BLOCK_SIDE + column;

    Compositing samples[SAMPLES_PER_THREAD];
    [[unroll]] for (uint s = 0u; s < SAMPLES_PER_THREAD; ++s) {
        samples[s] = START;
        if ((item.flags & FLAG_CONTINUED) != 0u) {
            uvec4 state = states[first + s * BLOCK_SIDE];
            samples[s] = Compositing(state.x, state.yzw);
        }
    }
    for (uint entry = item.first_entry; entry < item.first_entry + item.entry_count; ++entry) {
        Tile tile = tiles[entries[entry]];
        uvec2 uv = tile_coordinates(tile, item.x + int(column), item.y + int(row));
        uint open = 0u;
        [[unroll]] for (uint s = 0u; s < SAMPLES_PER_THREAD; ++s) {
            add_layer(samples[s], layer_at(0u, tile, uv));
            open |= samples[s].transmittance;
            uv += uvec2(uint(tile.sin_step), uint(tile.cos_step));
        }
        if (open == 0u) {
            break;
        }
    }
    [[unroll]] for (uint s = 0u; s < SAMPLES_PER_THREAD; ++s) {
        uint sample_in_block = first + s * BLOCK_SIDE;
        if ((item.flags & FLAG_UNFINISHED) != 0u) {
            states[sample_in_block] = uvec4(samples[s].transmittance, samples[s].sums);
        } else {
            colors[item.first_sample + sample_in_block] =
                TRANSPARENT == 1u ? shown_alone(samples[s]) : shown_over(samples[s], push.background);
        }
    }
}
