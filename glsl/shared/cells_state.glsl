// The state of a cells search on the device. Layout: src/gpu/cells/layout.rs. Needs cells_rules.glsl.

// Step of a cell that has nothing to do.
const uint STEP_DONE = 0xFFFFFFFFu;

struct Fly {
    int x;
    int y;
    uint z;
    // Red and green, 16 bits each, red lowest.
    uint rg;
    // Blue and angle.
    uint ba;
    uint w;
    uint h;
    // Mask; bit 16 is set if the fly is not absent.
    uint form;
};

struct Header {
    // Rounds made, and rounds to make.
    uint round;
    uint wanted;
    // Cells that have steps left in this round.
    uint pending;
    // 1: the scan of this iteration began a round.
    uint is_fresh;
    // Not 0: a step of this cell, less 1, alone exceeds the budget.
    uint overrun;
    uint evals_low;
    uint evals_high;
    uint births_low;
    uint births_high;
    uint accepted_low;
    uint accepted_high;
    // Change of the objective since the population was loaded.
    uint change_low;
    uint change_high;
    // Dispatches of cells that had something to do.
    uint iterations;
    // The round that the scan began last.
    uint under_way;
};

struct CellRecord {
    // Its slice of the members.
    uint first;
    uint count;
    // Steps made, then members looked at for removal; STEP_DONE when there is nothing left.
    uint step;
    // Members that the next round deals to the cell.
    uint dealt;
    // Members written to the slice.
    uint filled;
};

layout(push_constant) uniform Push {
    // Of the lanes that work, the one that workgroups with z = 0 serve.
    uint first_lane;
    // Most turns of loops in one invocation.
    uint budget;
    // The cell that workgroup 0 of a lane works on.
    uint first_cell;
} push;

// Of the lanes that work, those of a kind side by side.
layout(std430, binding = 0) readonly buffer RulesBuffer { SearchRules rules[]; };
// 0: a dispatch serves one lane. Then its rules are the same everywhere as software Vulkan sees it, which is worth 3 %
// of its time.
layout(constant_id = 10) const uint MANY_LANES = 1u;

// Which rules are those of this lane.
uint rule_number() {
    return push.first_lane + (MANY_LANES == 1u ? gl_WorkGroupID.z : 0u);
}

#ifdef HARDWARE
// Read where they lie, for they would not fit into registers.
#define rule rules[rule_number()]

void take_lane() {}
#else
// The rules of this lane, read once: software Vulkan reads a buffer for each invocation anew.
SearchRules rule;

// Begins the work for a lane: `main` does it first.
void take_lane() {
    rule = rules[rule_number()];
}
#endif

// The number of this workgroup among those of its lane.
uint work_number() {
    return gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
}


layout(std430, binding = 1) coherent buffer HeaderBuffer { Header header[]; };
layout(std430, binding = 2) coherent buffer FliesBuffer { Fly flies[]; };
layout(std430, binding = 3) coherent buffer CellsBuffer { CellRecord cells[]; };
// Per fly its cell; then members by cell as they came; then members by cell and index.
layout(std430, binding = 4) coherent buffer DealsBuffer { uint deals[]; };
// Two words of four for each pixel, in blocks of 8x8: (target and in its highest byte the depth of the stack; the top
// fly, its z and what cells_suit.glsl says, its error), (the under fly, its z and its error; the error of the
// background).
layout(std430, binding = 5) coherent buffer PixelsBuffer { uvec4 pixels[]; };
// Sine of 4,096 steps, 1,024 bell-shaped numbers, 2,049 factors of size.
layout(std430, binding = 6) readonly buffer TablesBuffer { int tables[]; };

int sine_at(uint place) {
    return tables[place];
}

int normal_at(uint place) {
    return tables[4096u + place];
}

uint size_factor_at(int step) {
    return uint(tables[6144 + clamp(step, -1024, 1024)]);
}

bool is_alive(Fly fly) {
    return fly.form >> 16 != 0u;
}

uint pixel_place(uvec2 pixel) {
    return rule.first_pixel + ((pixel.y >> 3) * rule.columns + (pixel.x >> 3)) * 64u + (pixel.y & 7u) * 8u + (pixel.x & 7u);
}

// Pixels of all blocks of the lane.
uint pixel_count() {
    return rule.columns * (rule.height + 7u >> 3) * 64u;
}

uvec2 picture_size() {
    return uvec2(rule.width, rule.height);
}

uvec2 search_seed() {
    return uvec2(rule.seed[0], rule.seed[1]);
}
