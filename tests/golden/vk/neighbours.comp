#version 450
// Every number becomes itself plus its right neighbour times a factor, plus a constant.
layout(local_size_x_id = 0) in;
layout(constant_id = 3) const uint ADDED = 0;
layout(std430, set = 0, binding = 0) readonly buffer From { uint numbers[]; } source;
layout(std430, set = 0, binding = 1) writeonly buffer To { uint numbers[]; } target;
layout(push_constant) uniform Push { uint count; uint factor; } push;

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i < push.count) {
        target.numbers[i] = source.numbers[i] + push.factor * source.numbers[(i + 1) % push.count] + ADDED;
    }
}
