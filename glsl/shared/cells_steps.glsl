// What the steps of a cell have in common, whatever its tiles are: the candidates, their making, and counters. Twin:
// src/cpu/cells/cell.rs. Needs cells_operators.glsl, cells_grid.glsl, cells_leash.glsl, cells_patches.glsl,
// cells_suit.glsl and `without_victim`: what the objective changes when a child's victim goes, as far as no pixel has
// to be looked at for it.

const uint PAINT_KEEP = 0u;
const uint PAINT_ANEW = 1u;
const uint PAINT_BIRTH = 2u;

struct Candidate {
    Fly fly;
    // Place among the members, and index.
    uint victim;
    uint index;
    uint paint;
    bool is_valid;
    // Whether it differs from its victim in colour at most, and the victim's colour.
    bool is_same;
    uint old_rg;
    uint old_ba;
    // What the child costs besides its pixels.
    int own;
};

// The best child so far; the same in all invocations.
struct Best {
    Candidate candidate;
    int change;
    // Whether `has_room` has to look closer.
    bool is_crowded;
};

const uint CANDIDATE_WORDS = 13u;
// Most candidates that are made at a time.
const uint BATCH_MAX = 64u;
const uint BATCH = LANES < BATCH_MAX ? LANES : BATCH_MAX;
shared uint shared_candidates[BATCH_MAX * CANDIDATE_WORDS];

// What loops cost besides their turns: a loop that software Vulkan passes costs the turn that ends it, even where no
// invocation enters it.
const uint STEP_TURNS = 40u;
const uint BATCH_TURNS = 40u;
// Of every candidate, also one that is invalid and is passed; then what is added for one that is evaluated.
const uint SLOT_TURNS = 12u;
const uint CANDIDATE_TURNS = 8u;

// The cell at work; the same in all invocations.
uint cell_number;
CellRecord cell;
Grid grid;
uint turns;
bool is_over;

// Whether so many turns of loops still fit the budget.
bool fits(uint count) {
    is_over = is_over || turns + count > push.budget;
    return !is_over;
}

// As `fits`; then they are spent.
bool afford(uint count) {
    bool is_fit = fits(count);
    turns += is_fit ? count : 0u;
    return is_fit;
}

uint member(uint place) {
    return deals[rule.first_deal + 2u * rule.fly_count + cell.first + place];
}

void store_candidate(uint slot, Candidate candidate) {
    uint first = slot * CANDIDATE_WORDS;
    shared_candidates[first] = uint(candidate.fly.x);
    shared_candidates[first + 1u] = uint(candidate.fly.y);
    shared_candidates[first + 2u] = candidate.fly.z;
    shared_candidates[first + 3u] = candidate.fly.rg;
    shared_candidates[first + 4u] = candidate.fly.ba;
    shared_candidates[first + 5u] = candidate.fly.w;
    shared_candidates[first + 6u] = candidate.fly.h;
    shared_candidates[first + 7u] = candidate.fly.form;
    shared_candidates[first + 8u] = candidate.victim;
    shared_candidates[first + 9u] =
        candidate.paint | (candidate.is_valid ? 4u : 0u) | (candidate.is_same ? 8u : 0u) | candidate.index << 4;
    shared_candidates[first + 10u] = candidate.old_rg;
    shared_candidates[first + 11u] = candidate.old_ba;
    shared_candidates[first + 12u] = uint(candidate.own);
}

Candidate load_candidate(uint slot) {
    uint first = slot * CANDIDATE_WORDS;
    Candidate candidate;
    candidate.fly = Fly(
        int(shared_candidates[first]), int(shared_candidates[first + 1u]), shared_candidates[first + 2u],
        shared_candidates[first + 3u], shared_candidates[first + 4u], shared_candidates[first + 5u],
        shared_candidates[first + 6u], shared_candidates[first + 7u]
    );
    candidate.victim = shared_candidates[first + 8u];
    uint flags = shared_candidates[first + 9u];
    candidate.paint = flags & 3u;
    candidate.is_valid = (flags & 4u) != 0u;
    candidate.is_same = (flags & 8u) != 0u;
    candidate.index = flags >> 4;
    candidate.old_rg = shared_candidates[first + 10u];
    candidate.old_ba = shared_candidates[first + 11u];
    candidate.own = int(shared_candidates[first + 12u]);
    return candidate;
}

// Who wins a tournament: the smallest value, and of equals the smallest number.
struct Winner {
    int value;
    uint number;
};

const Winner NO_WINNER = Winner(0x7FFFFFFF, 0xFFFFFFFFu);

Winner better(Winner one, int value, uint number) {
    return value < one.value || value == one.value && number < one.number ? Winner(value, number) : one;
}

uint victim_place(uint draws, uint number) {
    return chain_below(draws, SLOT_VICTIM + number, cell.count);
}

// The least helpful of some random flies of the cell, who leaves for a new tile: of every so many from the first one.
Winner least_helpful(uint draws, uint first, uint stride) {
    Winner winner = NO_WINNER;
    for (uint number = first; number < rule.births.victim_tournament; number += stride) {
        winner = better(winner, fitness[rule.first_fly + member(victim_place(draws, number))], number);
    }
    return winner;
}

// A random pixel of the cell.
uvec2 pixel_of(uint draws, uint number) {
    uvec4 bounds = grid_bounds(grid, cell_number);
    uint bits = chain_bits(draws, SLOT_PLACE + number);
    return bounds.xy + uvec2(below(bits << 16, bounds.z - bounds.x), below(bits & 0xFFFF0000u, bounds.w - bounds.y));
}

// The worst of some random pixels of the cell: of every so many from the first one.
Winner worst_shown(uint draws, uint first, uint stride) {
    Winner winner = NO_WINNER;
    for (uint number = first; number < rule.births.place_tournament; number += stride) {
        winner = better(winner, -int(pixels[2u * pixel_place(pixel_of(draws, number))].w), number);
    }
    return winner;
}

bool is_birth(int place_fitness, uint draws) {
    return place_fitness <= 0 || chain_bits(draws, SLOT_KIND) >> 16 < rule.mix.birth_q16;
}

// Winners of the tournaments of each candidate, found by several invocations; between batches nobody has won. First the
// value, then the number.
shared int shared_values[2u * BATCH_MAX];
shared uint shared_numbers[2u * BATCH_MAX];

void clear_winners(uint slot) {
    shared_values[slot] = NO_WINNER.value;
    shared_values[BATCH_MAX + slot] = NO_WINNER.value;
    shared_numbers[slot] = NO_WINNER.number;
    shared_numbers[BATCH_MAX + slot] = NO_WINNER.number;
}

// Done first, before a `sync`.
void begin_tournaments() {
    for (uint slot = gl_LocalInvocationID.x; slot < BATCH_MAX; slot += LANES) {
        clear_winners(slot);
    }
}

// How many invocations share the tournaments of a candidate.
uint helpers_of(uint slots) {
    return LANES / slots;
}

// Finds the winners for so many candidates that are made next, if several invocations share in each.
void hold_tournaments(int place_fitness, uint draws, uint first, uint slots) {
    uint helpers = helpers_of(slots);
    if (helpers == 1u) {
        return;
    }
    uint slot = gl_LocalInvocationID.x / helpers;
    uint own = gl_LocalInvocationID.x % helpers;
    uint own_draws = chain_then(draws, first + slot + 1u);
    bool takes_part = slot < slots && is_birth(place_fitness, own_draws);
    // The same in all invocations.
    if (slots == 1u && !takes_part) {
        return;
    }
    Winner victim = NO_WINNER;
    Winner place = NO_WINNER;
    if (takes_part) {
        if (place_fitness > 0) {
            victim = least_helpful(own_draws, own, helpers);
            atomicMin(shared_values[slot], victim.value);
        }
        if (MUTANTS == 0u) {
            place = worst_shown(own_draws, own, helpers);
            atomicMin(shared_values[BATCH_MAX + slot], place.value);
        }
    }
    sync_shared();
    if (takes_part) {
        if (victim.value == shared_values[slot]) {
            atomicMin(shared_numbers[slot], victim.number);
        }
        if (place.value == shared_values[BATCH_MAX + slot]) {
            atomicMin(shared_numbers[BATCH_MAX + slot], place.number);
        }
    }
    sync_shared();
}

// Turns of the loops of the tournaments of a batch.
uint tournament_turns(uint slots) {
    uint helpers = helpers_of(slots);
    return (rule.births.place_tournament + helpers - 1u) / helpers
        + (rule.births.victim_tournament + helpers - 1u) / helpers;
}

GuideSample local_at(Fly fly) {
    return guide_at(ivec2(fly.x, fly.y) >> 6);
}

// Whoever makes a candidate alone also holds its tournaments.
void make_birth(inout Candidate candidate, uint place, int place_fitness, uint draws, uint slots) {
    uint slot = gl_LocalInvocationID.x;
    uint victim_number = shared_numbers[slot];
    uint place_number = shared_numbers[BATCH_MAX + slot];
    if (helpers_of(slots) == 1u) {
        victim_number = least_helpful(draws, 0u, 1u).number;
        place_number = MUTANTS == 1u ? 0u : worst_shown(draws, 0u, 1u).number;
    } else {
        clear_winners(slot);
    }
    candidate.paint = PAINT_BIRTH;
    candidate.victim = place_fitness <= 0 ? place : victim_place(draws, victim_number);
    uint index = member(candidate.victim);
    if (MUTANTS == 1u) {
        uint parent = member(chain_below(draws, SLOT_PLACE, cell.count));
        candidate.is_valid = fitness[rule.first_fly + parent] > 0;
        Fly fly = flies[rule.first_fly + parent];
        candidate.fly = mutant(fly, own_side(index, local_at(fly)), draws);
    } else {
        uvec2 worst = pixel_of(draws, place_number);
        uint z = pixels[2u * pixel_place(worst)].z & TOP_Z_MASK;
        GuideSample local = guide_at(ivec2(worst));
        candidate.fly = newborn(own_side(index, local), worst, z, local, draws);
    }
}

void make_change(inout Candidate candidate, Fly fly, uint index, uint step, uint draws) {
    uint kind = chain_bits(draws, SLOT_KIND) & 0xFFFFu;
    uint side = own_side(index, local_at(fly));
    uint edge = rule.mix.edge;
    uint turn = edge + rule.mix.turn;
    uint shift = turn + rule.mix.shift;
    uint depth = shift + rule.mix.depth;
    uint which = kind * (depth + rule.mix.recolor) >> 16;
    candidate.paint = chain_bits(draws, SLOT_RECOLOR) >> 16 < rule.mix.recolor_q16 ? PAINT_ANEW : PAINT_KEEP;
    candidate.fly = fly;
    if (which < edge) {
        candidate.fly = edge_moved(fly, side, step, draws);
    } else if (which < turn) {
        candidate.fly = turned(fly, step, draws);
    } else if (which < shift) {
        candidate.fly = shifted(fly, side, step, draws);
    } else if (which < depth) {
        candidate.fly = raised(fly, step, draws);
    } else {
        candidate.paint = PAINT_ANEW;
    }
    if (COLOR_SOURCE == COLOR_EVOLVED && candidate.paint == PAINT_ANEW) {
        candidate.fly = repainted(candidate.fly, step, draws);
    }
}

// Makes a child of the fly at a place among the members, or a birth, one of so many, and says whether it is within its
// cell.
Candidate make_candidate(uint place, uint index, Fly fly, int place_fitness, uint draws, uint slots) {
    Candidate candidate;
    candidate.fly = fly;
    candidate.victim = place;
    candidate.is_valid = true;
    if (is_birth(place_fitness, draws)) {
        make_birth(candidate, place, place_fitness, draws, slots);
    } else {
        make_change(candidate, fly, index, steps[rule.first_fly + index], draws);
    }
    candidate.index = member(candidate.victim);
    Fly old = flies[rule.first_fly + candidate.index];
    GuideSample local = local_at(candidate.fly);
    bound_sides(candidate.fly, own_side(candidate.index, local));
    Fly child = candidate.fly;
    candidate.old_rg = old.rg;
    candidate.old_ba = old.ba;
    candidate.is_same = child.x == old.x && child.y == old.y && child.z == old.z && child.w == old.w && child.h == old.h
        && child.form == old.form && fly_angle(child) == fly_angle(old);
    bool is_kept = candidate.paint == PAINT_KEEP && candidate.is_same && child.rg == old.rg && child.ba == old.ba;
    candidate.is_valid = candidate.is_valid && !is_kept
        && grid_cell_of(grid, footprint_of(child, grid.size).box) == cell_number;
    if (LEASHED == 1u && candidate.paint != PAINT_BIRTH) {
        candidate.is_valid = candidate.is_valid && is_on_leash(child, origins[rule.first_origin + candidate.index]);
    }
    candidate.own = without_victim(candidate.index, old) + turn_penalty(child, local);
    return candidate;
}

// The boxes to go through when a tile takes another one's place: the union of both, or one after the other where they
// are apart.
void union_boxes(ivec4 old, ivec4 new, out ivec4 boxes[2]) {
    bool is_apart = old.x > old.z || new.x > new.z || old.z < new.x || new.z < old.x || old.w < new.y || new.w < old.y;
    boxes[0] = is_apart ? old : ivec4(min(old.xy, new.xy), max(old.zw, new.zw));
    boxes[1] = is_apart ? new : ivec4(1, 1, 0, 0);
}

// Turns of a pass over such boxes whose body has a loop of so many turns.
uint boxes_turns(ivec4 boxes[2], uint inner) {
    return patch_turns(boxes[0], inner) + patch_turns(boxes[1], inner);
}

// Gives an evaluated child, whose pixels change the objective so much, the best one's place if it is better. False if
// the child is its victim again.
bool offer(Candidate candidate, int change, bool is_crowded, inout Best best) {
    if (candidate.is_same && candidate.fly.rg == candidate.old_rg && candidate.fly.ba == candidate.old_ba) {
        return false;
    }
    change += candidate.own;
    if (!best.candidate.is_valid || change < best.change) {
        best = Best(candidate, change, is_crowded);
    }
    return true;
}

// Adds a number with a sign to one of 64 bits in two words.
void add_wide(inout uvec2 sum, int amount) {
    uint carry;
    sum.x = uaddCarry(sum.x, uint(amount), carry);
    sum.y += uint(amount >> 31) + carry;
}

void add_to_header(uvec2 evals, uvec2 births, uvec2 accepted, uvec2 change) {
    uint old = atomicAdd(header[rule.lane].evals_low, evals.x);
    atomicAdd(header[rule.lane].evals_high, evals.y + (old + evals.x < old ? 1u : 0u));
    old = atomicAdd(header[rule.lane].births_low, births.x);
    atomicAdd(header[rule.lane].births_high, births.y + (old + births.x < old ? 1u : 0u));
    old = atomicAdd(header[rule.lane].accepted_low, accepted.x);
    atomicAdd(header[rule.lane].accepted_high, accepted.y + (old + accepted.x < old ? 1u : 0u));
    old = atomicAdd(header[rule.lane].change_low, change.x);
    atomicAdd(header[rule.lane].change_high, change.y + (old + change.x < old ? 1u : 0u));
}
