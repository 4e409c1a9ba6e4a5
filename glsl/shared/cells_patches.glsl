// How the invocations of a workgroup share the pixels of a box: patches of 8 columns, or as many as there are
// invocations, and how they add up what they find. Needs LANES and WIDE.

const int PATCH_WIDTH = LANES < 8u ? int(LANES) : 8;
const int PATCH_HEIGHT = int(LANES) / PATCH_WIDTH;

shared ivec4 shared_sums;
shared uint shared_max;

// Makes what the workgroup wrote so far visible to all of it. A single subgroup needs no more than its own barrier.
void sync() {
    if (WIDE == 1u) {
        memoryBarrier();
        barrier();
    } else {
        subgroupBarrier();
    }
}

// The sums over the workgroup.
ivec4 sum_all(ivec4 value) {
    value = subgroupAdd(value);
    if (WIDE == 1u) {
        if (gl_LocalInvocationID.x == 0u) {
            shared_sums = ivec4(0);
        }
        sync();
        if (subgroupElect()) {
            atomicAdd(shared_sums.x, value.x);
            atomicAdd(shared_sums.y, value.y);
            atomicAdd(shared_sums.z, value.z);
            atomicAdd(shared_sums.w, value.w);
        }
        sync();
        value = shared_sums;
        sync();
    }
    return value;
}

// The largest over the workgroup.
uint max_all(uint value) {
    value = subgroupMax(value);
    if (WIDE == 1u) {
        if (gl_LocalInvocationID.x == 0u) {
            shared_max = 0u;
        }
        sync();
        if (subgroupElect()) {
            atomicMax(shared_max, value);
        }
        sync();
        value = shared_max;
        sync();
    }
    return value;
}

// Left column of the patches that a box needs.
int first_column(ivec4 box) {
    return box.x & -PATCH_WIDTH;
}

// Rows and columns of patches.
uvec2 patches(ivec4 box) {
    bool is_empty = box.x > box.z;
    ivec2 size = ivec2(box.z - first_column(box) + PATCH_WIDTH, box.w - box.y + PATCH_HEIGHT);
    return is_empty ? uvec2(0u) : uvec2(size) / uvec2(PATCH_WIDTH, PATCH_HEIGHT);
}

// Turns of the loops over a box whose body has a loop of so many turns. The passes that end a loop count, and run the
// loops inside once more.
uint patch_turns(ivec4 box, uint inner) {
    uvec2 count = patches(box);
    return 3u + 3u * count.y + count.x * count.y * (1u + inner);
}

ivec2 lane_offset() {
    return ivec2(int(gl_LocalInvocationID.x) % PATCH_WIDTH, int(gl_LocalInvocationID.x) / PATCH_WIDTH);
}
