// Writes the members of each cell to its slice, in any order; one invocation is one fly.
#version 460
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
    if (index >= fly_count || header[rule.lane].is_fresh == 0u) {
        return;
    }
    uint cell = deals[rule.first_deal + index];
    if (cell != NO_CELL) {
        uint place = cells[rule.first_cell + cell].first + atomicAdd(cells[rule.first_cell + cell].filled, 1u);
        deals[rule.first_deal + fly_count + place] = index;
    }
}
