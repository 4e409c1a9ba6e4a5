// Gives the layers of each pixel the depths of their flies, which were spread anew; one invocation is one pixel. Twin:
// `renormalise` in src/cpu/cells/mod.rs.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "shared/cells_rules.glsl"
#include "shared/cells_state.glsl"

layout(local_size_x = 64) in;

const uint TOP_Z_MASK = 0x1FFFFFFu;
const uint NO_FLY = 0xFFFFFFFFu;

void main() {
    take_lane();
    uint index = work_number() * 64u + gl_LocalInvocationID.x;
    if (index >= pixel_count()) {
        return;
    }
    uint place = 2u * (rule.first_pixel + index);
    uvec4 top = pixels[place];
    if (top.y != NO_FLY) {
        pixels[place].z = top.z & ~TOP_Z_MASK | flies[rule.first_fly + top.y].z;
    }
    uvec4 under = pixels[place + 1u];
    if (under.x != NO_FLY) {
        pixels[place + 1u].y = flies[rule.first_fly + under.x].z;
    }
}
