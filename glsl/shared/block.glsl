// What stages that work on opaque tiles block by block have in common. Layout: src/gpu/layout.rs. Needs tile.glsl,
// lane.glsl.

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint BLOCK_SIDE = 8u;
layout(constant_id = 2) const uint PIXELS_PER_THREAD = 8u;
// 1: some tiles wear a mask other than the square. Software Vulkan runs both sides of a branch, so the look-ups must
// not even be there when no tile needs them.
layout(constant_id = 4) const uint MASKED = 1u;
// 1: sums may not fit 32 bits, so carries go to the high word.
layout(constant_id = 5) const uint WIDE_SUMS = 1u;

struct WorkItem {
    uint lane;
    uint first_pixel;
    int x;
    int y;
    uint first_entry;
    uint entry_count;
    uint flags;
    uint padding;
};

layout(std430, binding = 0) readonly buffer Lanes { Lane lanes[]; };
layout(std430, binding = 1) readonly buffer Work { WorkItem items[]; };
layout(std430, binding = 2) readonly buffer Entries { uint entries[]; };
layout(std430, binding = 3) readonly buffer Tiles { Tile tiles[]; };
layout(std430, binding = 4) readonly buffer Targets { uint targets[]; };
// 64-bit sums as pairs of words, low word first, since 64-bit atomics are not everywhere.
layout(std430, binding = 9) buffer Sums { uint sums[]; };

void add_sum(uint sum, int part) {
    if (part == 0) {
        return;
    }
    uint low = atomicAdd(sums[2u * sum], uint(part));
    int carry = (part >> 31) + (low + uint(part) < low ? 1 : 0);
    if (WIDE_SUMS == 1u && carry != 0) {
        atomicAdd(sums[2u * sum + 1u], uint(carry));
    }
}
