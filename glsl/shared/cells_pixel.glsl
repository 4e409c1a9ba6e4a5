// How wrong a colour is at a pixel. Twin: src/model/cells/pixel.rs.

const uint STACK_DEPTH = 16u;
const uint BACKGROUND_Z = 1u << 24;

// Sum of the absolute differences of three 8-bit channels.
int difference(uint one, uint other) {
    ivec3 d = abs((ivec3(one, one >> 8, one >> 16) & 255) - (ivec3(other, other >> 8, other >> 16) & 255));
    return d.x + d.y + d.z;
}
