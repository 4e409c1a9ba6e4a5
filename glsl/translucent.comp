// Translucent tiles: per fly the marginal fitness, per block the error. One workgroup is one block of pixels, one
// invocation a column of PIXELS_PER_THREAD pixels in it. Twin: src/cpu/translucent.rs.
//
// First each pixel collects its layers from the block's list, nearest first, until no deeper one shows. Then each layer
// is left out: the state before it is kept, and those behind it are composited again, as each of them rounds. A long
// list is collected by several dispatches, and the layers of a deep stack are left out by several: what is collected
// lies in the scratch buffer.
#version 460
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require
#include "shared/subgroups.glsl"

#define MASK_BINDING 9
#include "shared/tile.glsl"
#include "shared/error.glsl"
#include "shared/lane.glsl"
#include "shared/translucency.glsl"
#include "shared/mask.glsl"
#include "shared/layer.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint BLOCK_SIDE = 8u;
layout(constant_id = 2) const uint PIXELS_PER_THREAD = 1u;

// Layers that are left out side by side, so that each layer behind them is read once for all.
const uint CHUNK = 4u;

struct StackItem {
    uint lane;
    uint first_pixel;
    int x;
    int y;
    uint first_entry;
    uint entry_count;
    uint first_slot;
    uint flags;
    uint first_rank;
    uint end_rank;
    uint scratch;
    uint first_part;
    uint error;
};

layout(std430, binding = 0) readonly buffer Lanes { Lane lanes[]; };
layout(std430, binding = 1) readonly buffer Work { StackItem items[]; };
layout(std430, binding = 2) readonly buffer Entries { uint entries[]; };
layout(std430, binding = 3) readonly buffer Tiles { Tile tiles[]; };
layout(std430, binding = 4) readonly buffer Targets { uint targets[]; };
layout(std430, binding = 5) buffer TopLayer { uint top_layer[]; };
layout(std430, binding = 6) buffer UnderLayer { uint under_layer[]; };
// Per item and pixel of its block: number of layers, transmittance, widest transmittance; then rank by rank each
// pixel's layer, and its slot in the list.
layout(std430, binding = 7) buffer Scratch { uint scratch[]; };
// Per block the parts of its list's flies, and its error.
layout(std430, binding = 8) buffer Parts { int parts[]; };

layout(push_constant) uniform Push {
    uint first_item;
    uint item_count;
} push;

const uint BLOCK_PIXELS = BLOCK_SIDE * BLOCK_SIDE;

void main() {
    uint number = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    if (number >= push.item_count) {
        return;
    }
    StackItem item = items[push.first_item + number];
    Lane lane = lanes[item.lane];
    uint column = gl_LocalInvocationID.x % BLOCK_SIDE;
    uint row = gl_LocalInvocationID.x / BLOCK_SIDE * PIXELS_PER_THREAD;
    uint own_pixel = row * BLOCK_SIDE + column;
    uint states = item.scratch + own_pixel;
    uint layers = states + 3u * BLOCK_PIXELS;

    uint counts[PIXELS_PER_THREAD];
    uint transmittances[PIXELS_PER_THREAD];
    uint widests[PIXELS_PER_THREAD];
    bool continued = (item.flags & FLAG_CONTINUED) != 0u;
    [[unroll]] for (uint p = 0u; p < PIXELS_PER_THREAD; ++p) {
        uint state = states + p * BLOCK_SIDE;
        bool inside = (targets[item.first_pixel + own_pixel + p * BLOCK_SIDE] & INSIDE) != 0u;
        counts[p] = continued ? scratch[state] : 0u;
        transmittances[p] = continued ? scratch[state + BLOCK_PIXELS] : inside ? CLEAR : 0u;
        widests[p] = continued ? scratch[state + 2u * BLOCK_PIXELS] : 0u;
    }

    for (uint entry = 0u; entry < item.entry_count; ++entry) {
        Tile tile = tiles[lane.first_fly + entries[item.first_entry + entry]];
        uvec2 uv = tile_coordinates(tile, item.x + int(column), item.y + int(row));
        uint open = 0u;
        [[unroll]] for (uint p = 0u; p < PIXELS_PER_THREAD; ++p) {
            uint layer = layer_at(lane.first_mask, tile, uv);
            if (layer != 0u && (transmittances[p] | widests[p]) != 0u) {
                uint place = layers + p * BLOCK_SIDE + counts[p] * 2u * BLOCK_PIXELS;
                scratch[place] = layer;
                scratch[place + BLOCK_PIXELS] = item.first_slot + entry;
                counts[p] += 1u;
                widests[p] = widest_after(widests[p], transmittances[p], opacity(layer >> 24));
                transmittances[p] = kept(transmittances[p], opacity(layer >> 24));
            }
            open |= transmittances[p] | widests[p];
            uv += uvec2(uint(tile.sin_step), uint(tile.cos_step));
        }
        if (open == 0u) {
            break;
        }
    }

    if ((item.flags & FLAG_UNFINISHED) != 0u) {
        [[unroll]] for (uint p = 0u; p < PIXELS_PER_THREAD; ++p) {
            uint state = states + p * BLOCK_SIDE;
            scratch[state] = counts[p];
            scratch[state + BLOCK_PIXELS] = transmittances[p];
            scratch[state + 2u * BLOCK_PIXELS] = widests[p];
        }
    }
    if (item.first_rank == item.end_rank) {
        return;
    }

    int error_sum = 0;
    for (uint p = 0u; p < PIXELS_PER_THREAD; ++p) {
        uint pixel = item.first_pixel + own_pixel + p * BLOCK_SIDE;
        uint first = layers + p * BLOCK_SIDE;
        uint count = counts[p];
        uint target = targets[pixel];
        bool inside = (target & INSIDE) != 0u;
        Compositing whole = START;
        Compositing before = START;
        for (uint rank = 0u; rank < count; ++rank) {
            uint layer = scratch[first + rank * 2u * BLOCK_PIXELS];
            add_layer(whole, layer);
            if (rank < item.first_rank) {
                before = whole;
            }
        }
        int error = color_error(target, shown_over(whole, lane.background));
        if (item.first_rank == 0u) {
            error_sum += inside ? error : 0;
            uint list = item.first_entry - item.first_slot;
            top_layer[pixel] = count > 0u ? entries[list + scratch[first + BLOCK_PIXELS]] : NO_FLY;
            under_layer[pixel] = count > 1u ? entries[list + scratch[first + 3u * BLOCK_PIXELS]] : NO_FLY;
        }
        for (uint rank = item.first_rank; rank < min(count, item.end_rank); rank += CHUNK) {
            Compositing without[CHUNK];
            [[unroll]] for (uint k = 0u; k < CHUNK; ++k) {
                without[k] = before;
            }
            [[unroll]] for (uint own = 0u; own < CHUNK; ++own) {
                uint layer = rank + own < count ? scratch[first + (rank + own) * 2u * BLOCK_PIXELS] : 0u;
                add_layer(before, layer);
                [[unroll]] for (uint k = 0u; k < CHUNK; ++k) {
                    if (k != own) {
                        add_layer(without[k], layer);
                    }
                }
            }
            for (uint behind = rank + CHUNK; behind < count; ++behind) {
                uint layer = scratch[first + behind * 2u * BLOCK_PIXELS];
                [[unroll]] for (uint k = 0u; k < CHUNK; ++k) {
                    add_layer(without[k], layer);
                }
            }
            [[unroll]] for (uint k = 0u; k < CHUNK; ++k) {
                int part = color_error(target, shown_over(without[k], lane.background)) - error;
                if (rank + k < count && part != 0) {
                    uint slot = scratch[first + ((rank + k) * 2u + 1u) * BLOCK_PIXELS];
                    atomicAdd(parts[item.first_part + slot], part);
                }
            }
        }
    }
    int subgroup_sum = over_subgroup(error_sum);
    if (speaks_for_subgroup() && subgroup_sum != 0) {
        atomicAdd(parts[item.error], subgroup_sum);
    }
}
