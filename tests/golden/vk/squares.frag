#version 450
// The texel of the square's layer as red and green, and the square's number.
#extension GL_EXT_samplerless_texture_functions : require
layout(set = 0, binding = 1) uniform utexture2DArray layers;
layout(location = 0) flat in uint number;
layout(location = 1) flat in uint layer;
layout(location = 0) out vec4 color;
layout(location = 1) out uint id;

void main() {
    uvec2 texel = texelFetch(layers, ivec3(1, 0, layer), 0).rg;
    color = vec4(vec2(texel) / 255.0, 0.0, 1.0);
    id = number;
}
