// Puts the members of each cell in the order of their indices, which is the twin's; one invocation is one fly.
#version 460
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require

#include "shared/cells_random.glsl"
#include "shared/cells_rules.glsl"
#include "shared/cells_state.glsl"
#include "shared/cells_footprint.glsl"
#include "shared/cells_grid.glsl"

layout(local_size_x = 64) in;

void main() {
    take_lane();
    uint index = work_number() * 64u + gl_LocalInvocationID.x;
    uint fly_count = rule.fly_count;
    if (index >= fly_count || header[rule.lane].is_fresh == 0u || deals[rule.first_deal + index] == NO_CELL) {
        return;
    }
    CellRecord cell = cells[rule.first_cell + deals[rule.first_deal + index]];
    uint rank = 0u;
    // Eight in each turn of the loop, which software Vulkan ends after 65,535 turns.
    for (uint place = 0u; place < cell.count; place += 8u) {
        [[unroll]] for (uint part = 0u; part < 8u; ++part) {
            uint other = deals[rule.first_deal + fly_count + cell.first + min(place + part, cell.count - 1u)];
            rank += place + part < cell.count && other < index ? 1u : 0u;
        }
    }
    deals[rule.first_deal + 2u * fly_count + cell.first + rank] = index;
}
