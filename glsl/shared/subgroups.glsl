// What the invocations of a subgroup add up. Compiled with NO_SUBGROUPS for drivers without such operations: then every
// invocation is a subgroup of its own, and all results are the same. Stands before everything else, as extensions must.
#ifdef NO_SUBGROUPS
int over_subgroup(int value) {
    return value;
}

ivec4 over_subgroup(ivec4 value) {
    return value;
}

uint most_of_subgroup(uint value) {
    return value;
}

// An invocation cannot know what others make it wait for.
uint waited_for(uint turns, uint most) {
    return most;
}

bool speaks_for_subgroup() {
    return true;
}

void sync_subgroup() {}
#else
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_arithmetic : require

int over_subgroup(int value) {
    return subgroupAdd(value);
}

ivec4 over_subgroup(ivec4 value) {
    return subgroupAdd(value);
}

uint most_of_subgroup(uint value) {
    return subgroupMax(value);
}

// Turns of a loop that every invocation of the subgroup waits for: each has its own number, at most `most`.
uint waited_for(uint turns, uint most) {
    return most_of_subgroup(turns);
}

// One invocation of the subgroup.
bool speaks_for_subgroup() {
    return subgroupElect();
}

// Makes what the subgroup wrote so far visible to all of it.
void sync_subgroup() {
    subgroupBarrier();
}
#endif
