// One quad per tile, a pixel larger than the tile on each side: the fragment stage decides coverage exactly.
// Twin (with mosaic.frag): src/cpu/mosaic.rs.
#version 460

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

layout(location = 0) flat out uint fly;
layout(location = 1) flat out uint rank;

void main() {
    Instance instance = instances[gl_InstanceIndex];
    vec2 corner = vec2(gl_VertexIndex & 1, gl_VertexIndex >> 1) * 2.0 - 1.0;
    vec2 position = instance.centre + corner.x * instance.axis_u + corner.y * instance.axis_v;
    // Pixel (i, j) of the canvas has its centre at (i, j); the framebuffer has it at (i + 1/2, j + 1/2).
    vec2 clip = (position - vec2(push.origin) + 0.5) * push.pixel_size - 1.0;
    gl_Position = vec4(clip, 0.0, 1.0);
    fly = instance.fly;
    rank = instance.rank;
}
