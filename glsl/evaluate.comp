// Per pixel the two nearest flies, per fly the marginal fitness, per lane the SAE: one workgroup is one block of
// pixels, one invocation a column of PIXELS_PER_THREAD pixels in it. Twin: src/cpu/evaluate.rs.
//
// The tile list of a block comes nearest first, so the first tile that covers a pixel is its top and the second its
// under. Sums are kept by taking off what the block added last time and adding what it adds now.
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

// 1: some lists are looked at in pieces, so that layers are taken over from an earlier dispatch. Software Vulkan would
// load them for nothing.
layout(constant_id = 6) const uint PIECES = 1u;

// The block has no old sums to take off.
const uint FLAG_FRESH = 1u;
// The first tiles of the list were looked at by an earlier dispatch.
const uint FLAG_CONTINUED = 2u;
// A later dispatch looks at the rest of the list.
const uint FLAG_UNFINISHED = 4u;

layout(std430, binding = 5) buffer TopLayer { uint top_layer[]; };
layout(std430, binding = 6) buffer UnderLayer { uint under_layer[]; };
// Per pixel what it added to the sums: marginal fitness of its top fly << 10 | error.
layout(std430, binding = 7) buffer Parts { int parts[]; };
// 64-bit sums as pairs of words, low word first, since 64-bit atomics are not everywhere.
layout(std430, binding = 8) buffer Marginal { uint marginal[]; };

layout(push_constant) uniform Push {
    uint item_count;
} push;

void add_marginal(uint fly, int part) {
    if (part == 0) {
        return;
    }
    uint low = atomicAdd(marginal[2u * fly], uint(part));
    int carry = (part >> 31) + (low + uint(part) < low ? 1 : 0);
    if (WIDE_SUMS == 1u && carry != 0) {
        atomicAdd(marginal[2u * fly + 1u], uint(carry));
    }
}

// What is kept of the top and under of a pixel: the fly, and with masks in the lowest byte the shade of its texel.
// NO_FLY stays what it is.
const uint SHADE_BITS = MASKED * 8u;

uint fly_of(uint shown) {
    return shown == NO_FLY ? NO_FLY : shown >> SHADE_BITS;
}

uint shown_color(Lane lane, uint shown) {
    if (shown == NO_FLY) {
        return lane.background;
    }
    uint color = tiles[lane.first_fly + (shown >> SHADE_BITS)].color;
    return MASKED == 0u ? color : shaded(color, shown & 255u);
}

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
    int i = item.x + int(column);
    int j = item.y + int(row);

    uint top[PIXELS_PER_THREAD];
    uint under[PIXELS_PER_THREAD];
    // Colours of both, unless shades come into them: to look them up afterwards is dear.
    uint top_color[PIXELS_PER_THREAD];
    uint under_color[PIXELS_PER_THREAD];
    bool continued = PIECES == 1u && (item.flags & FLAG_CONTINUED) != 0u;
    [[unroll]] for (uint p = 0u; p < PIXELS_PER_THREAD; ++p) {
        top[p] = NO_FLY;
        under[p] = NO_FLY;
        top_color[p] = lane.background;
        under_color[p] = lane.background;
        if (PIECES == 1u && continued) {
            top[p] = top_layer[first_pixel + p * BLOCK_SIDE];
            under[p] = under_layer[first_pixel + p * BLOCK_SIDE];
            top_color[p] = shown_color(lane, top[p]);
            under_color[p] = shown_color(lane, under[p]);
        }
    }

    for (uint entry = item.first_entry; entry < item.first_entry + item.entry_count; ++entry) {
        uint fly = entries[entry];
        Tile tile = tiles[lane.first_fly + fly];
        uvec2 end = uvec2(tile.w << 12, tile.h << 12);
        uvec2 uv = tile_coordinates(tile, i, j);
        bool open = false;
        [[unroll]] for (uint p = 0u; p < PIXELS_PER_THREAD; ++p) {
            bool covered = uv.x < end.x && uv.y < end.y;
            uint shown = fly;
            if (MASKED == 1u) {
                uvec2 texel = tile.mask == 0u ? uvec2(255u) : mask_texel(lane.first_mask + tile.mask, tile, uv);
                covered = covered && texel.x >= COVERAGE_THRESHOLD;
                shown = fly << SHADE_BITS | texel.y;
            }
            bool is_top = covered && top[p] == NO_FLY;
            bool is_under = covered && !is_top && under[p] == NO_FLY;
            under[p] = is_under ? shown : under[p];
            under_color[p] = is_under ? tile.color : under_color[p];
            open = open || under[p] == NO_FLY;
            top[p] = is_top ? shown : top[p];
            top_color[p] = is_top ? tile.color : top_color[p];
            uv += uvec2(uint(tile.sin_step), uint(tile.cos_step));
        }
        if (!open) {
            break;
        }
    }

    bool fresh = (item.flags & FLAG_FRESH) != 0u;
    bool unfinished = PIECES == 1u && (item.flags & FLAG_UNFINISHED) != 0u;
    int error_change = 0;
    [[unroll]] for (uint p = 0u; p < PIXELS_PER_THREAD; ++p) {
        uint pixel = first_pixel + p * BLOCK_SIDE;
        uint target = targets[pixel];
        bool inside = (target & INSIDE) != 0u;
        if (MASKED == 1u) {
            top_color[p] = shown_color(lane, top[p]);
            under_color[p] = shown_color(lane, under[p]);
        }
        uint old_top = NO_FLY;
        int old_part = 0;
        if (!continued && !fresh) {
            int old = parts[pixel];
            old_top = top_layer[pixel];
            old_part = old >> 10;
            error_change -= old & 1023;
        }
        // The next dispatch needs the shades, too.
        top_layer[pixel] = unfinished ? top[p] : fly_of(top[p]);
        under_layer[pixel] = unfinished ? under[p] : fly_of(under[p]);
        int top_error = color_error(target, top_color[p]);
        int under_error = color_error(target, under_color[p]);
        bool counts = inside && !unfinished;
        int part = counts ? under_error - top_error : 0;
        top_error = counts ? top_error : 0;
        uint new_top = unfinished ? NO_FLY : fly_of(top[p]);
        // Most pixels of a block show what they showed, and atomics are dear.
        bool same = old_top == new_top;
        if (old_top != NO_FLY) {
            add_marginal(lane.first_fly + old_top, same ? part - old_part : -old_part);
        }
        if (new_top != NO_FLY && !same) {
            add_marginal(lane.first_fly + new_top, part);
        }
        error_change += top_error;
        parts[pixel] = part << 10 | top_error;
    }
    int subgroup_change = over_subgroup(error_change);
    if (speaks_for_subgroup()) {
        add_sum(lane.sum, subgroup_change);
    }
}
