// Marginal fitness of translucent tiles when a round is over: first what flies cost, then by how much each pixel's
// error rises without each of its tiles. Twin: `refresh` in src/cpu/cells/translucent.rs.
#version 460
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 64) in;
layout(constant_id = 5) const uint TURN_PENALTY = 1u;
layout(constant_id = 6) const uint LOCAL_SIZE = 1u;
layout(constant_id = 7) const uint DRESSED = 1u;
// 0: an invocation is a fly; 1: it is a pixel.
layout(constant_id = 9) const uint OF_PIXELS = 0u;
const uint RANDOM_DEPTH = 0u;

#define MASK_BINDING 12
#include "shared/tile.glsl"
#include "shared/mask.glsl"
#include "shared/translucency.glsl"
#include "shared/cells_random.glsl"
#include "shared/cells_rules.glsl"
#include "shared/cells_state.glsl"
#include "shared/cells_footprint.glsl"
#include "shared/cells_pixel.glsl"
#include "shared/cells_suit.glsl"
#include "shared/cells_glaze.glsl"

layout(std430, binding = 8) buffer FitnessBuffer { int fitness[]; };
layout(std430, binding = 9) readonly buffer GuideBuffer { uvec2 guide[]; };
layout(std430, binding = 10) readonly buffer StacksBuffer { uvec2 stacks[]; };

#include "shared/cells_operators.glsl"

void begin_fly(uint index) {
    if (index < rule.fly_count) {
        Fly fly = flies[rule.first_fly + index];
        fitness[rule.first_fly + index] = is_alive(fly) ? -turn_penalty(fly, guide_at(ivec2(fly.x, fly.y) >> 6)) : 0;
    }
}

// The error of a pixel whose layers before `first` are in `pixel`.
int error_behind(Compositing pixel, uint stack, uint first, uint depth, uvec4 top) {
    for (uint entry = first; entry < depth; entry += LAYERS_AT_ONCE) {
        [[unroll]] for (uint part = 0u; part < LAYERS_AT_ONCE; ++part) {
            uint place = min(entry + part, GLAZED_DEPTH - 1u);
            add_layer(pixel, entry + part < depth ? stacks[stack + place * 64u].y : 0u);
        }
    }
    uvec3 sums = pixel.sums + pixel.transmittance * channels(rule.background);
    return glazed_error(sums, pixel.transmittance, top.x, want_of(top.z));
}

void main() {
    take_lane();
    if (header[rule.lane].is_fresh != ROUND_OVER) {
        return;
    }
    uint index = work_number() * 64u + gl_LocalInvocationID.x;
    if (OF_PIXELS == 0u) {
        begin_fly(index);
        return;
    }
    if (index >= pixel_count()) {
        return;
    }
    uint pixel = rule.first_pixel + index;
    uvec4 top = pixels[2u * pixel];
    uint depth = top.x >> 24;
    uint stack = stack_first(pixel);
    Compositing before = START;
    for (uint entry = 0u; entry < depth; ++entry) {
        // Exact: what is left out rounds no more.
        int rise = error_behind(before, stack, entry + 1u, depth, top) - int(top.w);
        uvec2 layer = stacks[stack + entry * 64u];
        if (rise != 0) {
            atomicAdd(fitness[rule.first_fly + layer.x], rise);
        }
        add_layer(before, layer.y);
    }
}
