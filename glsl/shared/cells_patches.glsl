// How the invocations of a workgroup share the pixels of a box: patches of 8 columns, or as many as there are
// invocations, and how they add up what they find. Needs subgroups.glsl, LANES and WIDE.

const int PATCH_WIDTH = LANES < 8u ? int(LANES) : 8;
const int PATCH_HEIGHT = int(LANES) / PATCH_WIDTH;

// Sums and largest numbers that several subgroups find together, in three slots by turns: while one is added to, the
// next one is cleared, and the one before may still be read. So a single barrier does.
const uint SUM_SLOTS = 3u;
shared ivec4 shared_sums[SUM_SLOTS];
shared uvec2 shared_most[SUM_SLOTS];
// The slot that is next; the same in all invocations.
uint sum_slot;

// Makes what the workgroup wrote so far visible to all of it. No other workgroup reads it before the dispatch is over,
// and a single subgroup needs no more than its own barrier.
void sync() {
    if (WIDE == 1u) {
        groupMemoryBarrier();
        barrier();
    } else {
        sync_subgroup();
    }
}

// As `sync`, for shared memory alone.
void sync_shared() {
    if (WIDE == 1u) {
        barrier();
    } else {
        sync_subgroup();
    }
}

// Done first, before a `sync`.
void begin_sums() {
    sum_slot = 0u;
    if (WIDE == 1u && gl_LocalInvocationID.x == 0u) {
        shared_sums[0] = ivec4(0);
        shared_most[0] = uvec2(0u);
    }
}

// Clears the next slot, to be followed by a barrier. Returns the one that was added to.
uint turn_slot() {
    uint slot = sum_slot;
    sum_slot = slot + 1u == SUM_SLOTS ? 0u : slot + 1u;
    if (gl_LocalInvocationID.x == 0u) {
        shared_sums[sum_slot] = ivec4(0);
        shared_most[sum_slot] = uvec2(0u);
    }
    return slot;
}

void add_to_slot(ivec4 value) {
    if (speaks_for_subgroup()) {
        atomicAdd(shared_sums[sum_slot].x, value.x);
        atomicAdd(shared_sums[sum_slot].y, value.y);
        atomicAdd(shared_sums[sum_slot].z, value.z);
        atomicAdd(shared_sums[sum_slot].w, value.w);
    }
}

// The sums over the workgroup.
ivec4 sum_all(ivec4 value) {
    value = over_subgroup(value);
    if (WIDE == 1u) {
        add_to_slot(value);
        uint slot = turn_slot();
        barrier();
        value = shared_sums[slot];
    }
    return value;
}

// The sums over the workgroup, and the largest of a further number.
ivec4 sum_all(ivec4 value, inout uint most) {
    value = over_subgroup(value);
    most = most_of_subgroup(most);
    if (WIDE == 1u) {
        add_to_slot(value);
        if (speaks_for_subgroup()) {
            atomicMax(shared_most[sum_slot].x, most);
        }
        uint slot = turn_slot();
        barrier();
        value = shared_sums[slot];
        most = shared_most[slot].x;
    }
    return value;
}

// The sums over the workgroup, and the largest of two further numbers.
ivec4 sum_all(ivec4 value, inout uvec2 most) {
    value = over_subgroup(value);
    most = uvec2(most_of_subgroup(most.x), most_of_subgroup(most.y));
    if (WIDE == 1u) {
        add_to_slot(value);
        if (speaks_for_subgroup()) {
            atomicMax(shared_most[sum_slot].x, most.x);
            atomicMax(shared_most[sum_slot].y, most.y);
        }
        uint slot = turn_slot();
        barrier();
        value = shared_sums[slot];
        most = shared_most[slot];
    }
    return value;
}

// The largest over the workgroup, and `sync`.
uint sync_and_most(uint value) {
    value = most_of_subgroup(value);
    if (WIDE == 1u) {
        if (speaks_for_subgroup()) {
            atomicMax(shared_most[sum_slot].x, value);
        }
        uint slot = turn_slot();
        sync();
        return shared_most[slot].x;
    }
    sync();
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
