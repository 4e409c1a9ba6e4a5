// Writes the members of each cell to its slice, in any order; one invocation is one fly.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "shared/cells_random.glsl"
#include "shared/cells_state.glsl"
#include "shared/cells_footprint.glsl"
#include "shared/cells_grid.glsl"

layout(local_size_x = 64) in;

void main() {
    rule = rules[0];
    uint index = (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * 64u + gl_LocalInvocationID.x;
    uint fly_count = rule.fly_count;
    if (index >= fly_count || header[0].is_fresh == 0u) {
        return;
    }
    uint cell = deals[index];
    if (cell != NO_CELL) {
        uint place = cells[cell].first + atomicAdd(cells[cell].filled, 1u);
        deals[fly_count + place] = index;
    }
}
