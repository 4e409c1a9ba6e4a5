#version 450
// One square per instance, its corners in pixels; number, depth and texture layer go on to the fragments.
struct Square { uint left; uint top; uint side; float depth; uint number; uint layer; };
layout(std430, set = 0, binding = 0) readonly buffer Squares { Square squares[]; } list;
layout(push_constant) uniform Push { vec2 size_px; } push;
layout(location = 0) flat out uint number;
layout(location = 1) flat out uint layer;

void main() {
    Square square = list.squares[gl_InstanceIndex];
    uvec2 corner = uvec2(gl_VertexIndex & 1, gl_VertexIndex >> 1);
    vec2 position_px = vec2(uvec2(square.left, square.top) + corner * square.side);
    gl_Position = vec4(2.0 * position_px / push.size_px - 1.0, square.depth, 1.0);
    number = square.number;
    layer = square.layer;
}
