// Spreads the depths of the living flies evenly, in their order; one invocation is one fly. Twin:
// src/model/cells/depths.rs. First each fly finds its new depth, which waits among the deals: between two rounds they hold
// nothing. Then all take theirs.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "shared/cells_rules.glsl"
#include "shared/cells_state.glsl"

const uint THREADS = 256u;

layout(local_size_x = 256) in;
// 1: the depths are taken.
layout(constant_id = 9) const uint TAKES = 0u;

// Depths have 24 bits.
const uint DEPTH_BITS = 24u;
const uint NO_DEPTH = 0xFFFFFFFFu;

// Depths of as many flies as there are invocations; NO_DEPTH of those that do not live.
shared uint shared_depths[THREADS];

// (2 rank + 1) 2^24 / (2 count), bit by bit.
uint even_depth(uint rank, uint count) {
    uint rest = 2u * rank + 1u;
    uint depth = rest / count;
    rest %= count;
    for (uint bit = 1u; bit < DEPTH_BITS; ++bit) {
        rest <<= 1;
        depth = depth << 1 | (rest >= count ? 1u : 0u);
        rest -= rest >= count ? count : 0u;
    }
    return depth;
}

void main() {
    take_lane();
    uint index = work_number() * THREADS + gl_LocalInvocationID.x;
    bool is_fly = index < rule.fly_count;
    uint place = rule.first_fly + min(index, rule.fly_count - 1u);
    bool is_living = is_fly && is_alive(flies[place]);
    if (TAKES == 1u) {
        if (is_living) {
            flies[place].z = deals[rule.first_deal + index];
        }
        return;
    }
    uint own = flies[place].z;
    uint rank = 0u;
    uint count = 0u;
    for (uint first = 0u; first < rule.fly_count; first += THREADS) {
        uint other = first + gl_LocalInvocationID.x;
        uint other_place = rule.first_fly + min(other, rule.fly_count - 1u);
        bool lives = other < rule.fly_count && is_alive(flies[other_place]);
        shared_depths[gl_LocalInvocationID.x] = lives ? flies[other_place].z : NO_DEPTH;
        memoryBarrierShared();
        barrier();
        for (uint thread = 0u; thread < THREADS; ++thread) {
            uint z = shared_depths[thread];
            count += z != NO_DEPTH ? 1u : 0u;
            rank += z < own || z == own && first + thread < index ? 1u : 0u;
        }
        barrier();
    }
    if (is_living) {
        deals[rule.first_deal + index] = even_depth(rank, count);
    }
}
