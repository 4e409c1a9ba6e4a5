// The steps of the cells of one round: selection, mutation, evaluation, acceptance, removal. A workgroup is a cell. Twin:
// src/cpu/cells/cell.rs.
//
// Candidate k is made by invocation k; then all invocations work on its pixels together. Software Vulkan ends all loops of an
// invocation after 65,535 turns, so that turns are counted and a cell stops before a step that might not fit its budget; the next
// dispatch goes on there. Until a child is accepted nothing is written, so an abandoned step leaves no trace.
#version 460
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_arithmetic : require

layout(local_size_x_id = 0) in;
// 1: the workgroup has several subgroups.
layout(constant_id = 1) const uint WIDE = 1u;
// 0 median, 1 mean, 2 pick, 3 evolved.
layout(constant_id = 2) const uint COLOR_SOURCE = 0u;
// 1: births are mutated copies.
layout(constant_id = 3) const uint MUTANTS = 0u;
// 1: births lie anywhere in depth.
layout(constant_id = 4) const uint RANDOM_DEPTH = 0u;
layout(constant_id = 5) const uint TURN_PENALTY = 1u;
layout(constant_id = 6) const uint LOCAL_SIZE = 1u;
// 1: tiles wear masks or grout, or pixels do not all count the same.
layout(constant_id = 7) const uint DRESSED = 1u;

const uint LANES = gl_WorkGroupSize.x;

#define MASK_BINDING 12
#include "shared/tile.glsl"
#include "shared/mask.glsl"
#include "shared/cells_random.glsl"
#include "shared/cells_state.glsl"
#include "shared/cells_footprint.glsl"
#include "shared/cells_grid.glsl"
#include "shared/cells_pixel.glsl"
#include "shared/cells_suit.glsl"
#include "shared/cells_patches.glsl"

layout(std430, binding = 7) coherent buffer StepsBuffer { uint steps[]; };
// Marginal fitness. Of a cell's own flies it is written by the cell alone; to that of frozen flies all only add.
layout(std430, binding = 8) coherent buffer FitnessBuffer { int fitness[]; };
layout(std430, binding = 9) readonly buffer GuideBuffer { uvec2 guide[]; };
// Per pixel 16 flies, nearest first, and their errors; in each block of 8x8 first the nearest of all pixels.
layout(std430, binding = 10) coherent buffer StacksBuffer { uvec2 stacks[]; };
// Per cell the pixels where a child shows its colour, a column for each invocation: the target; of dressed tiles the colour that
// would show it and the weight less 1, then target and shade.
layout(std430, binding = 11) coherent buffer ScratchBuffer { uint scratch[]; };

// Where a pixel's nearest fly lies among the stacks; the next ones follow, one block of pixels apart.
uint stack_first(uint place) {
    return rule.first_stack + place / 64u * (STACK_DEPTH * 64u) + place % 64u;
}

#include "shared/cells_operators.glsl"
#include "shared/cells_leash.glsl"

// Marginal fitness tells what goes with a victim, its penalty included.
int without_victim(uint index, Fly victim) {
    return fitness[rule.first_fly + index];
}

#include "shared/cells_steps.glsl"

// What a child would do to the pixels of its box.
struct Seen {
    // What its pixels add to the change of the objective; where its colour is to be found, without the errors of its colour.
    int change;
    // Weight of the pixels in the scratch, and how many of them are this invocation's.
    uint weight;
    uint own_count;
    // Whether some pixel that it covers has a full stack.
    bool is_crowded;
    // Whether it would show anywhere.
    bool is_shown;
    // Weighted sums of the channels, for means.
    uvec3 sums;
};

const uint SCRATCH_WORDS = 1u + DRESSED;

uint scratch_place(uint place, uint word) {
    return rule.first_scratch + cell_number * rule.scratch_words + (place * SCRATCH_WORDS + word) * LANES
        + gl_LocalInvocationID.x;
}

uvec3 channels_of(uint color) {
    return uvec3(color, color >> 8, color >> 16) & 255u;
}

int scratch_weight(uint word) {
    return DRESSED == 0u ? 1 : int(word >> 24) + 1;
}

// Looks at the pixels of a child. Its colour may be still to be found: then the pixels that show it are put in the scratch.
Seen look(Fly child, uint index, Footprint footprint, bool has_color) {
    uint color = fly_color(child);
    Tile suit = suit_of(child);
    int change = 0;
    uint weight = 0u;
    uint count = 0u;
    uint crowded = 0u;
    uint shows = 0u;
    uvec3 sums = uvec3(0u);
    ivec4 box = footprint.box;
    ivec2 offset = lane_offset();
    for (int y = box.y; y <= box.w; y += PATCH_HEIGHT) {
        for (int x = first_column(box); x <= box.z; x += PATCH_WIDTH) {
            ivec2 pixel = ivec2(x, y) + offset;
            uint look = look_of(footprint, suit, pixel);
            if (look != LOOK_HOLE) {
                uint place = 2u * pixel_place(uvec2(pixel));
                uvec4 top = pixels[place];
                uint target = top.x & 0xFFFFFFu;
                uvec3 shown = uvec3(top.y, top_z(top.z), top.w);
                if (shown.x == index) {
                    shown = pixels[place + 1u].xyz;
                }
                crowded |= top.x >> 24 == STACK_DEPTH ? 1u : 0u;
                change += int(rule.overlap);
                if (child.z < shown.y || child.z == shown.y && index < shown.x) {
                    Want want = want_of(top.z);
                    shows = 1u;
                    change -= int(shown.z);
                    if (has_color || DRESSED == 1u && (look == LOOK_GROUT || want.is_unwanted)) {
                        change += look_error(look, color, target, want);
                    } else {
                        uint bright = DRESSED == 0u ? target : unshaded(target, look);
                        if (COLOR_SOURCE == COLOR_MEAN) {
                            sums += channels_of(bright) * uint(want.weight);
                        }
                        if (DRESSED == 0u) {
                            scratch[scratch_place(count, 0u)] = target;
                        } else {
                            scratch[scratch_place(count, 0u)] = bright | uint(want.weight) - 1u << 24;
                            scratch[scratch_place(count, 1u)] = target | look << 24;
                        }
                        weight += uint(want.weight);
                        ++count;
                    }
                }
            }
        }
    }
    ivec4 all = sum_all(ivec4(change, weight, crowded, shows));
    if (COLOR_SOURCE == COLOR_MEAN) {
        sums = uvec3(sum_all(ivec4(sums, 0)).xyz);
    }
    return Seen(all.x, uint(all.y), count, all.z != 0, all.w != 0, sums);
}

// The weighted medians of the channels in the scratch, bit by bit. Twin: src/model/cells/color.rs.
uint median_color(uint weight, uint own_count) {
    int rank = int(weight - 1u) / 2;
    uvec3 median = uvec3(0u);
    for (uint bit = 128u; bit > 0u; bit >>= 1) {
        uvec3 trial = median | bit;
        ivec3 below_trial = ivec3(0);
        for (uint place = 0u; place < own_count; ++place) {
            uint word = scratch[scratch_place(place, 0u)];
            below_trial += ivec3(lessThan(channels_of(word), trial)) * scratch_weight(word);
        }
        below_trial = sum_all(ivec4(below_trial, 0)).xyz;
        median = uvec3(
            below_trial.x <= rank ? trial.x : median.x, below_trial.y <= rank ? trial.y : median.y,
            below_trial.z <= rank ? trial.z : median.z
        );
    }
    return median.x | median.y << 8 | median.z << 16;
}

// Sum of the errors of a colour over the pixels in the scratch.
int scratch_error(uint color, uint own_count) {
    int error = 0;
    for (uint place = 0u; place < own_count; ++place) {
        uint word = scratch[scratch_place(place, 0u)];
        if (DRESSED == 0u) {
            error += difference(word, color);
        } else {
            uint target = scratch[scratch_place(place, 1u)];
            error += difference(target, shaded(color, target >> 24)) * scratch_weight(word);
        }
    }
    return sum_all(ivec4(error, 0, 0, 0)).x;
}

uint found_color(Fly child, Seen seen) {
    uint color = fly_color(child);
    if (COLOR_SOURCE == COLOR_MEDIAN) {
        uint median = median_color(seen.weight, seen.own_count);
        color = seen.weight > 0u ? median : color;
    } else if (COLOR_SOURCE == COLOR_MEAN) {
        uvec3 mean = (2u * seen.sums + seen.weight) / max(2u * seen.weight, 1u);
        color = seen.weight > 0u ? mean.x | mean.y << 8 | mean.z << 16 : color;
    } else if (COLOR_SOURCE == COLOR_PICK) {
        uint target = pixels[2u * pixel_place(uvec2(child.x + 32 >> 6, child.y + 32 >> 6))].x & 0xFFFFFFu;
        color = seen.weight > 0u ? target : color;
    }
    return color;
}

// The best child so far; the same in all invocations.
struct Best {
    Candidate candidate;
    int change;
    bool is_crowded;
};

// Evaluates a candidate; it takes the best one's place if it is better. False if it is invalid after all.
bool evaluate(Candidate candidate, inout Best best) {
    Footprint footprint = footprint_of(candidate.fly, grid.size);
    if (!afford(CANDIDATE_TURNS + patch_turns(footprint.box, 0u))) {
        return false;
    }
    bool has_color = COLOR_SOURCE == COLOR_EVOLVED || candidate.paint == PAINT_KEEP;
    Seen seen = look(candidate.fly, candidate.index, footprint, has_color);
    int change = seen.change;
    if (!has_color) {
        uint most = max_all(seen.own_count);
        if (!afford(20u + 9u * most)) {
            return false;
        }
        uint color = found_color(candidate.fly, seen);
        change += scratch_error(color, seen.own_count);
        // A colour of 16 bits stays as it is where it is the same in 8.
        if (color != fly_color(candidate.fly)) {
            set_color(candidate.fly, color);
        }
        if (!seen.is_shown && candidate.paint == PAINT_BIRTH) {
            return false;
        }
    }
    if (candidate.is_same && candidate.fly.rg == candidate.old_rg && candidate.fly.ba == candidate.old_ba) {
        return false;
    }
    change += candidate.own;
    if (!best.candidate.is_valid || change < best.change) {
        best = Best(candidate, change, seen.is_crowded);
    }
    return true;
}

// Whether no pixel's stack would become too deep.
bool has_room(Best best) {
    if (!best.is_crowded) {
        return true;
    }
    Footprint footprint = footprint_of(best.candidate.fly, grid.size);
    if (!afford(patch_turns(footprint.box, 0u))) {
        return false;
    }
    Tile suit = suit_of(best.candidate.fly);
    ivec4 box = footprint.box;
    ivec2 offset = lane_offset();
    int refused = 0;
    for (int y = box.y; y <= box.w; y += PATCH_HEIGHT) {
        for (int x = first_column(box); x <= box.z; x += PATCH_WIDTH) {
            ivec2 pixel = ivec2(x, y) + offset;
            if (look_of(footprint, suit, pixel) != LOOK_HOLE) {
                uint place = pixel_place(uvec2(pixel));
                if (pixels[2u * place].x >> 24 == STACK_DEPTH) {
                    uint first = stack_first(place);
                    bool is_there = false;
                    [[unroll]] for (uint entry = 0u; entry < STACK_DEPTH; ++entry) {
                        is_there = is_there || stacks[first + entry * 64u].x == best.candidate.index;
                    }
                    refused += is_there ? 0 : 1;
                }
            }
        }
    }
    return sum_all(ivec4(refused, 0, 0, 0)).x == 0;
}

// A fly's change of place, depth or colour; the same in all invocations.
struct Exchange {
    uint fly;
    uint z;
    uint color;
    Footprint old;
    Footprint new;
    Tile old_suit;
    Tile new_suit;
    // Neither depth nor colour changes; of a dressed tile both may, from pixel to pixel.
    bool is_kept;
};

void add_fitness(uint fly, int amount) {
    if (fly != NO_FLY && amount != 0) {
        atomicAdd(fitness[rule.first_fly + fly], amount);
    }
}

uint depth_of(uint fly, Exchange change) {
    if (fly == NO_FLY) {
        return BACKGROUND_Z;
    }
    return fly == change.fly ? change.z : flies[rule.first_fly + fly].z;
}

// Takes the fly off a pixel's stack if it was there, and puts it there if it is seen there now. Returns the turns of its loop.
uint exchange_pixel(Exchange change, uint place, uint look) {
    uvec4 top = pixels[2u * place];
    uvec4 under = pixels[2u * place + 1u];
    uint depth = top.x >> 24;
    uint first = stack_first(place);
    uvec2 own = uvec2(change.fly, uint(look_error(look, change.color, top.x, want_of(top.z))));
    uvec2 ground = uvec2(NO_FLY, under.w);
    uvec2 nearest = ground;
    uvec2 second = ground;
    uint count = 0u;
    uint changed = STACK_DEPTH;
    bool is_pending = look != LOOK_HOLE;
    uvec2 next = stacks[first];
    for (uint entry = 0u; entry < depth; ++entry) {
        uvec2 current = next;
        next = stacks[first + min(entry + 1u, STACK_DEPTH - 1u) * 64u];
        if (current.x == change.fly) {
            changed = min(changed, entry);
            continue;
        }
        uint z = flies[rule.first_fly + current.x].z;
        if (is_pending && (change.z < z || change.z == z && change.fly < current.x)) {
            stacks[first + count * 64u] = own;
            changed = min(changed, count);
            nearest = count == 0u ? own : nearest;
            second = count == 1u ? own : second;
            is_pending = false;
            ++count;
        }
        if (count != entry) {
            stacks[first + count * 64u] = current;
        }
        nearest = count == 0u ? current : nearest;
        second = count == 1u ? current : second;
        ++count;
    }
    if (is_pending) {
        stacks[first + count * 64u] = own;
        changed = min(changed, count);
        nearest = count == 0u ? own : nearest;
        second = count == 1u ? own : second;
        ++count;
    }
    uint target = top.x & 0xFFFFFFu | count << 24;
    if (changed < 2u) {
        add_fitness(top.y, int(top.w) - int(under.z));
        add_fitness(nearest.x, int(second.y) - int(nearest.y));
        pixels[2u * place] = uvec4(target, nearest.x, depth_of(nearest.x, change) | top.z - top_z(top.z), nearest.y);
        pixels[2u * place + 1u] = uvec4(second.x, depth_of(second.x, change), second.y, under.w);
    } else {
        pixels[2u * place].x = target;
    }
    return depth;
}

// Takes the fly off the pixels of its old footprint and puts it on those of its new one.
void exchange(Exchange change, ivec4 boxes[2]) {
    ivec2 offset = lane_offset();
    int covered = 0;
    uint inner_turns = 0u;
    for (uint which = 0u; which < 2u; ++which) {
        ivec4 box = which == 0u ? boxes[0] : boxes[1];
        for (int y = box.y; y <= box.w; y += PATCH_HEIGHT) {
            for (int x = first_column(box); x <= box.z; x += PATCH_WIDTH) {
                ivec2 pixel = ivec2(x, y) + offset;
                // Boxes that are apart may share a patch.
                bool is_in_box = all(greaterThanEqual(pixel, box.xy)) && all(lessThanEqual(pixel, box.zw));
                bool was = is_in_box && look_of(change.old, change.old_suit, pixel) != LOOK_HOLE;
                uint look = look_of(change.new, change.new_suit, pixel);
                bool is = is_in_box && look != LOOK_HOLE;
                uint depth = 0u;
                if ((was || is) && !(was && is && change.is_kept)) {
                    covered += (is ? 1 : 0) - (was ? 1 : 0);
                    depth = exchange_pixel(change, pixel_place(uvec2(pixel)), look);
                }
                inner_turns += subgroupMax(depth) + 1u;
            }
        }
    }
    turns += max_all(inner_turns) + patch_turns(boxes[0], 0u) + patch_turns(boxes[1], 0u);
    covered = subgroupAdd(covered);
    if (subgroupElect()) {
        add_fitness(change.fly, -covered * int(rule.overlap));
    }
}

void main() {
    take_lane();
    cell_number = work_number();
    uint round = header[rule.lane].round;
    grid = grid_new(search_seed(), round, picture_size(), rule.side_shift);
    if (header[rule.lane].pending == 0u || cell_number >= grid.columns * grid.rows) {
        return;
    }
    cell = cells[rule.first_cell + cell_number];
    if (cell.step == STEP_DONE) {
        return;
    }
    // All read the step before one writes it.
    sync();
    uint chain = chain_then(chain_new(search_seed(), round, DRAW_STEP), cell_number);
    uint lane = gl_LocalInvocationID.x;
    uint candidates = rule.candidates;
    uint batches = (candidates + BATCH - 1u) / BATCH;
    uint step_count = cell.count * rule.steps_per_fly;
    uint end = step_count + cell.count;
    uint step = cell.step;
    turns = STEP_TURNS;
    is_over = false;
    uvec2 evals = uvec2(0u);
    uvec2 births = uvec2(0u);
    uvec2 accepted = uvec2(0u);
    uvec2 change_sum = uvec2(0u);
    while (step < end) {
        bool is_removal = step >= step_count;
        uint tournaments = rule.place_tournament + rule.victim_tournament;
        uint making = STEP_TURNS + (is_removal ? 0u : batches * (BATCH_TURNS + tournaments));
        if (!afford(making)) {
            break;
        }
        uint draws = chain_then(chain, step);
        uint place = is_removal ? step - step_count : chain_below(draws, 0u, cell.count);
        uint index = member(place);
        Fly fly = flies[rule.first_fly + index];
        int place_fitness = fitness[rule.first_fly + index];
        Best best;
        best.candidate.is_valid = false;
        best.change = 0;
        best.is_crowded = false;
        uint step_evals = 0u;
        bool was_changed = false;
        for (uint first = 0u; first < (is_removal || is_over ? 0u : candidates); first += BATCH) {
            if (lane < BATCH) {
                Candidate made =
                    make_candidate(place, index, fly, place_fitness, chain_then(draws, first + lane + 1u));
                store_candidate(lane, made);
            }
            sync();
            for (uint slot = 0u; slot < min(BATCH, candidates - first); ++slot) {
                Candidate candidate = load_candidate(slot);
                if (candidate.is_valid && !is_over && evaluate(candidate, best)) {
                    ++step_evals;
                    was_changed = was_changed || candidate.paint != PAINT_BIRTH;
                }
            }
            sync();
        }
        bool is_accepted = false;
        if (best.candidate.is_valid && best.change <= rule.highest && !is_over) {
            is_accepted = has_room(best);
        }
        if (is_removal) {
            is_accepted = is_alive(fly) && place_fitness <= 0;
            best.candidate.index = index;
            best.candidate.paint = PAINT_KEEP;
            best.candidate.fly = Fly(0, 0, uint(Z_MAX), 0u, 0u, 16u, 16u, 0u);
            best.change = place_fitness;
        }
        uint changed = best.candidate.index;
        Fly old = fly;
        Exchange change;
        ivec4 boxes[2];
        if (is_accepted) {
            old = flies[rule.first_fly + changed];
            Fly child = best.candidate.fly;
            uint color = fly_color(child);
            bool is_kept = DRESSED == 0u && old.z == child.z && fly_color(old) == color;
            change = Exchange(
                changed, child.z, color, footprint_of(old, grid.size), footprint_of(child, grid.size), suit_of(old),
                suit_of(child), is_kept
            );
            union_boxes(change.old.box, change.new.box, boxes);
            uint most = patch_turns(boxes[0], STACK_DEPTH + 1u) + patch_turns(boxes[1], STACK_DEPTH + 1u);
            is_over = is_over || turns + most > push.budget;
        }
        if (is_over) {
            break;
        }
        // All have read fitness, pixels and flies before any is changed.
        sync();
        if (is_accepted) {
            exchange(change, boxes);
            add_wide(change_sum, best.change);
        }
        sync();
        if (lane == 0u) {
            if (is_accepted) {
                Fly child = best.candidate.fly;
                bool is_birth = best.candidate.paint == PAINT_BIRTH;
                flies[rule.first_fly + changed] = child;
                steps[rule.first_fly + changed] = is_birth || is_removal ? STEP_FIRST : grown(steps[rule.first_fly + changed]);
                if (LEASHED == 1u && is_birth) {
                    origins[rule.first_origin + changed].form = 0u;
                }
                if (is_removal) {
                    fitness[rule.first_fly + changed] = 0;
                } else if (TURN_PENALTY == 1u) {
                    int before = is_alive(old) ? turn_penalty(old, local_at(old)) : 0;
                    add_fitness(changed, before - turn_penalty(child, local_at(child)));
                }
            } else if (was_changed) {
                steps[rule.first_fly + index] = shrunk(steps[rule.first_fly + index]);
            }
        }
        if (is_accepted && !is_removal) {
            births.x += best.candidate.paint == PAINT_BIRTH ? 1u : 0u;
            ++accepted.x;
        }
        evals.x += step_evals;
        ++step;
        sync();
    }
    if (lane == 0u) {
        if (step == cell.step) {
            atomicMax(header[rule.lane].overrun, cell_number + 1u);
        }
        cells[rule.first_cell + cell_number].step = step == end ? STEP_DONE : step;
        add_to_header(evals, births, accepted, change_sum);
        if (step == end && atomicAdd(header[rule.lane].pending, 0xFFFFFFFFu) == 1u) {
            atomicAdd(header[rule.lane].round, 1u);
        }
    }
}
