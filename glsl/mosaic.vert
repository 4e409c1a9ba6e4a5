// One quad per tile, a pixel larger than the tile on each side: the fragment stage decides coverage exactly. What that
// needs of the tile goes along, since software Vulkan loads it anew for each pixel otherwise, which costs more than all
// else of a mosaic. Twin (with mosaic.frag): src/cpu/mosaic.rs.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "shared/tile.glsl"

layout(std430, binding = 0) readonly buffer Tiles { Tile tiles[]; };

struct Instance {
    vec2 axis_u;
    vec2 axis_v;
    vec2 centre;
    uint fly;
    uint rank;
};

layout(std430, binding = 1) readonly buffer Instances { Instance instances[]; };

layout(push_constant) uniform Push {
    // Of the patch, in px of the canvas.
    ivec2 origin;
    // 2 / size of the patch in px.
    vec2 pixel_size;
    uint first_mask;
    uint grout;
} push;

layout(location = 0) flat out uvec4 place;
layout(location = 1) flat out uvec4 steps;
layout(location = 2) flat out uvec4 look;
layout(location = 3) flat out uvec4 names;

void main() {
    Instance instance = instances[gl_InstanceIndex];
    vec2 corner = vec2(gl_VertexIndex & 1, gl_VertexIndex >> 1) * 2.0 - 1.0;
    vec2 position = instance.centre + corner.x * instance.axis_u + corner.y * instance.axis_v;
    // Pixel (i, j) of the canvas has its centre at (i, j); the framebuffer has it at (i + 1/2, j + 1/2).
    vec2 clip = (position - vec2(push.origin) + 0.5) * push.pixel_size - 1.0;
    gl_Position = vec4(clip, 0.0, 1.0);
    Tile tile = tiles[instance.fly];
    place = uvec4(tile.x0, tile.y0, tile.u0, tile.v0);
    steps = uvec4(tile.cos_step, tile.sin_step, tile.w, tile.h);
    look = uvec4(tile.color, tile.w_inverse, tile.h_inverse, tile.ring);
    names = uvec4(instance.fly, instance.rank, tile.mask, 0);
}
