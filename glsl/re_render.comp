// The SAE of a picture with one fly left out, as in the paper: a plain re-render, which only tests and benches compare
// evaluate.comp with. The work is cut as there.
#version 460
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require
#include "shared/subgroups.glsl"

#define MASK_BINDING 10
#include "shared/tile.glsl"
#include "shared/error.glsl"
#include "shared/lane.glsl"
#include "shared/mask.glsl"
#include "shared/block.glsl"

layout(push_constant) uniform Push {
    uint item_count;
    // Its sum is the one of this number.
    uint left_out_fly;
} push;

void main() {
    uint number = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    if (number >= push.item_count) {
        return;
    }
    WorkItem item = items[number];
    Lane lane = lanes[item.lane];
    uint column = gl_LocalInvocationID.x % BLOCK_SIDE;
    uint row = gl_LocalInvocationID.x / BLOCK_SIDE * PIXELS_PER_THREAD;
    uint first_pixel = item.first_pixel + row * BLOCK_SIDE + column;

    bool is_bare[PIXELS_PER_THREAD];
    uint color[PIXELS_PER_THREAD];
    [[unroll]] for (uint p = 0u; p < PIXELS_PER_THREAD; ++p) {
        is_bare[p] = true;
        color[p] = lane.background;
    }
    for (uint entry = item.first_entry; entry < item.first_entry + item.entry_count; ++entry) {
        uint fly = entries[entry];
        if (fly == push.left_out_fly) {
            continue;
        }
        Tile tile = tiles[lane.first_fly + fly];
        uvec2 uv = tile_coordinates(tile, item.x + int(column), item.y + int(row));
        bool is_open = false;
        [[unroll]] for (uint p = 0u; p < PIXELS_PER_THREAD; ++p) {
            bool is_shown = is_bare[p] && is_inside(tile, uv);
            uint shown = tile.color;
            if (MASKED == 1u) {
                uvec2 texel = tile.mask == 0u ? uvec2(255u) : mask_texel(lane.first_mask + tile.mask, tile, uv);
                is_shown = is_shown && texel.x >= COVERAGE_THRESHOLD;
                shown = shaded(tile.color, texel.y);
            }
            color[p] = is_shown ? shown : color[p];
            is_bare[p] = is_bare[p] && !is_shown;
            is_open = is_open || is_bare[p];
            uv += uvec2(uint(tile.sin_step), uint(tile.cos_step));
        }
        if (!is_open) {
            break;
        }
    }

    int error = 0;
    [[unroll]] for (uint p = 0u; p < PIXELS_PER_THREAD; ++p) {
        uint target = targets[first_pixel + p * BLOCK_SIDE];
        error += (target & INSIDE) != 0u ? color_error(target, color[p]) : 0;
    }
    int subgroup_error = over_subgroup(error);
    if (speaks_for_subgroup()) {
        add_sum(lane.sum + push.left_out_fly, subgroup_error);
    }
}
