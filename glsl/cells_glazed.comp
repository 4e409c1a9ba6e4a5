// The steps of the cells of one round among translucent tiles. A workgroup is a cell, as in cells.comp, which explains how the work is
// cut. Twin: src/cpu/cells/cell.rs and src/cpu/cells/translucent.rs.
//
// Every pixel shows all tiles on it, so a child's change is computed anew over its pixels and its victim's.
#version 460
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_arithmetic : require

layout(local_size_x_id = 0) in;
// 1: the workgroup has several subgroups.
layout(constant_id = 1) const uint WIDE = 1u;
// 0 median, 1 mean, 2 pick, 3 evolved; of translucent tiles the first two are the colour of least squares.
layout(constant_id = 2) const uint COLOR_SOURCE = 0u;
// 1: births are mutated copies.
layout(constant_id = 3) const uint MUTANTS = 0u;
// 1: births lie anywhere in depth.
layout(constant_id = 4) const uint RANDOM_DEPTH = 0u;
layout(constant_id = 5) const uint TURN_PENALTY = 1u;
layout(constant_id = 6) const uint LOCAL_SIZE = 1u;
layout(constant_id = 7) const uint DRESSED = 1u;

const uint LANES = gl_WorkGroupSize.x;

#define MASK_BINDING 12
#include "shared/tile.glsl"
#include "shared/mask.glsl"
#include "shared/translucency.glsl"
#include "shared/cells_random.glsl"
#include "shared/cells_state.glsl"
#include "shared/cells_footprint.glsl"
#include "shared/cells_grid.glsl"
#include "shared/cells_pixel.glsl"
#include "shared/cells_suit.glsl"
#include "shared/cells_glaze.glsl"
#include "shared/cells_patches.glsl"

layout(std430, binding = 7) coherent buffer StepsBuffer { uint steps[]; };
// Marginal fitness: exact when a round begins; within it, only that of a fly that changes follows.
layout(std430, binding = 8) coherent buffer FitnessBuffer { int fitness[]; };
layout(std430, binding = 9) readonly buffer GuideBuffer { uvec2 guide[]; };
// Per pixel GLAZED_DEPTH flies, nearest first, and what they show there: colour under its shade, and coverage in the highest byte.
layout(std430, binding = 10) coherent buffer StacksBuffer { uvec2 stacks[]; };
// Per cell the pixels where a child shows its colour, a column for each invocation: the sums of all else with the child's shade
// and two bytes of its weight in their highest bytes, then the target with the pixel's weight less 1 and the rest of the child's.
layout(std430, binding = 11) coherent buffer ScratchBuffer { uint scratch[]; };

#include "shared/cells_operators.glsl"
#include "shared/cells_leash.glsl"

// What goes with a victim besides its pixels.
int without_victim(uint index, Fly victim) {
    if (TURN_PENALTY == 0u || !is_alive(victim)) {
        return 0;
    }
    return -turn_penalty(victim, guide_at(ivec2(victim.x, victim.y) >> 6));
}

#include "shared/cells_steps.glsl"

// A tile in the place of another one's; one of them may be absent. The same in all invocations.
struct Swap {
    uint fly;
    uint z;
    uint color;
    Footprint old;
    Footprint new;
    Tile suit;
    ivec4 boxes[2];
};

Swap swap_of(uint index, Fly old, Fly child) {
    Swap change;
    change.fly = index;
    change.z = child.z;
    change.color = fly_color(child);
    change.old = footprint_of(old, grid.size);
    change.new = footprint_of(child, grid.size);
    change.suit = suit_of(child);
    union_boxes(change.old.box, change.new.box, change.boxes);
    return change;
}

// Most turns of a pass over the pixels of both tiles and their stacks.
uint swap_turns(Swap change, uint inner) {
    return patch_turns(change.boxes[0], inner) + patch_turns(change.boxes[1], inner);
}

// A pixel with a child where its victim has gone, but for the child's colour.
struct Folded {
    Compositing rest;
    // The child's weight.
    uint weight;
    // Whether the victim is there.
    bool holds;
};

Folded fold(Swap change, uint stack, uint depth, uint child_opacity) {
    Folded folded = Folded(START, 0u, false);
    uint waiting = child_opacity;
    for (uint entry = 0u; entry < depth; entry += LAYERS_AT_ONCE) {
        [[unroll]] for (uint part = 0u; part < LAYERS_AT_ONCE; ++part) {
            uvec2 layer = stacks[stack + (entry + part) * 64u];
            bool is_there = entry + part < depth;
            bool is_own = is_there && layer.x == change.fly;
            uint z = is_there ? flies[rule.first_fly + layer.x].z : BACKGROUND_Z;
            bool is_front = change.z < z || change.z == z && change.fly < layer.x;
            uint left = kept(folded.rest.transmittance, is_front ? waiting : 0u);
            waiting = is_front ? 0u : waiting;
            folded.weight += folded.rest.transmittance - left;
            folded.rest.transmittance = left;
            folded.holds = folded.holds || is_own;
            add_layer(folded.rest, is_there && !is_own ? layer.y : 0u);
        }
    }
    uint left = kept(folded.rest.transmittance, waiting);
    folded.weight += folded.rest.transmittance - left;
    folded.rest.transmittance = left;
    folded.rest.sums += left * channels(rule.background);
    return folded;
}

// What a child changes over its pixels and its victim's.
struct Laid {
    // The change of the error; where the child's colour is to be found, without what shows there with it.
    int change;
    // Pixels in the scratch that are this invocation's.
    uint own_count;
    // Whether it would stack too deep on some pixel.
    bool is_refused;
    // Whether its colour would matter anywhere.
    bool is_shown;
    // Share times lack by channel, and share times share, over the pixels in the scratch: this invocation's part.
    uvec2 lacks[3];
    uvec2 squares;
};

uint scratch_place(uint place, uint word) {
    return rule.first_scratch + cell_number * rule.scratch_words + (place * 4u + word) * LANES + gl_LocalInvocationID.x;
}

void lay_pixel(inout Laid laid, Folded folded, uint shade, uvec4 top) {
    Want want = want_of(top.z);
    int share = share_q8(folded.weight, shade);
    int weighed = share * want.weight;
    ivec3 lacks = weighed * lacks_q6(top.x, folded.rest.sums);
    add_wide(laid.lacks[0], lacks.x);
    add_wide(laid.lacks[1], lacks.y);
    add_wide(laid.lacks[2], lacks.z);
    add_wide(laid.squares, share * weighed);
    uvec3 words = folded.rest.sums | uvec3(shade, folded.weight & 255u, folded.weight >> 8 & 255u) << 24;
    scratch[scratch_place(laid.own_count, 0u)] = words.x;
    scratch[scratch_place(laid.own_count, 1u)] = words.y;
    scratch[scratch_place(laid.own_count, 2u)] = words.z;
    scratch[scratch_place(laid.own_count, 3u)] =
        top.x & 0xFFFFFFu | uint(want.weight - 1) << 24 | folded.weight >> 16 << 28;
    ++laid.own_count;
}

// Goes through the pixels of a child and its victim, and spends turns: at most `swap_turns` with STACK_TURNS. The child's colour may
// be still to be found: then the pixels that show it are put in the scratch.
Laid lay(Swap change, bool has_color) {
    Laid laid = Laid(0, 0u, false, false, uvec2[3](uvec2(0u), uvec2(0u), uvec2(0u)), uvec2(0u));
    ivec2 offset = lane_offset();
    uint refused = 0u;
    uint shown = 0u;
    uint inner_turns = 0u;
    for (uint which = 0u; which < 2u; ++which) {
        ivec4 box = which == 0u ? change.boxes[0] : change.boxes[1];
        for (int y = box.y; y <= box.w; y += PATCH_HEIGHT) {
            for (int x = first_column(box); x <= box.z; x += PATCH_WIDTH) {
                ivec2 pixel = ivec2(x, y) + offset;
                // Boxes that are apart may share a patch.
                bool is_in_box = all(greaterThanEqual(pixel, box.xy)) && all(lessThanEqual(pixel, box.zw));
                bool was = is_in_box && footprint_covers(change.old, pixel);
                uvec2 texel = texel_of(change.new, change.suit, pixel);
                uint child_opacity = is_in_box ? opacity(texel.x) : 0u;
                uint depth = 0u;
                if (was || child_opacity > 0u) {
                    uint place = pixel_place(uvec2(pixel));
                    uvec4 top = pixels[2u * place];
                    depth = top.x >> 24;
                    Folded folded = fold(change, stack_first(place), depth, child_opacity);
                    refused |= child_opacity > 0u && depth == GLAZED_DEPTH && !folded.holds ? 1u : 0u;
                    Want want = want_of(top.z);
                    bool is_wanted = folded.weight > 0u && !want.is_unwanted;
                    shown |= is_wanted && share_q8(folded.weight, texel.y) > 0 ? 1u : 0u;
                    laid.change -= int(top.w);
                    if (is_wanted && !has_color) {
                        lay_pixel(laid, folded, texel.y, top);
                    } else {
                        uvec3 sums = folded.rest.sums + folded.weight * channels(shaded(change.color, texel.y));
                        laid.change += glazed_error(sums, folded.rest.transmittance, top.x, want);
                    }
                }
                inner_turns += stack_turns(subgroupMax(depth));
            }
        }
    }
    turns += max_all(inner_turns) + swap_turns(change, 0u);
    ivec4 all = sum_all(ivec4(laid.change, refused, shown, 0));
    laid.change = all.x;
    laid.is_refused = all.y != 0;
    laid.is_shown = all.z != 0;
    return laid;
}

// A sum over the workgroup in two words, from its two parts of 21 and more bits.
uvec2 joined(int low, int high) {
    uint carry;
    uint first = uaddCarry(uint(high) << 21, uint(low), carry);
    return uvec2(first, uint(high >> 11) + carry);
}

// The colour of least squares.
uint fitted_color(Laid laid) {
    // Sums of at most 1,024 invocations of parts of 21 bits fit 31 bits, and the rest of sums below 2^47 fits as well.
    ivec4 low = ivec4(laid.lacks[0].x, laid.lacks[1].x, laid.lacks[2].x, laid.squares.x) & 0x1FFFFF;
    uvec4 words = uvec4(laid.lacks[0].x, laid.lacks[1].x, laid.lacks[2].x, laid.squares.x) >> 21;
    uvec4 upper = uvec4(laid.lacks[0].y, laid.lacks[1].y, laid.lacks[2].y, laid.squares.y) << 11;
    low = sum_all(low);
    ivec4 high = sum_all(ivec4(upper | words));
    uvec2 squares = joined(low.w, high.w);
    uint red = fitted(joined(low.x, high.x), squares);
    uint green = fitted(joined(low.y, high.y), squares);
    uint blue = fitted(joined(low.z, high.z), squares);
    return red | green << 8 | blue << 16;
}

// Sum of the errors over the pixels in the scratch with a child of this colour.
int scratch_error(uint color, uint own_count) {
    int error = 0;
    for (uint place = 0u; place < own_count; ++place) {
        uvec3 words = uvec3(
            scratch[scratch_place(place, 0u)], scratch[scratch_place(place, 1u)], scratch[scratch_place(place, 2u)]
        );
        uint last = scratch[scratch_place(place, 3u)];
        uint weight = words.y >> 24 | words.z >> 24 << 8 | last >> 28 << 16;
        uvec3 sums = (words & 0xFFFFFFu) + weight * channels(shaded(color, words.x >> 24));
        error += glazed_error(sums, 0u, last, Want(int(last >> 24 & 15u) + 1, false));
    }
    return sum_all(ivec4(error, 0, 0, 0)).x;
}

// Turns of the search for a colour.
const uint COLOR_TURNS = 40u;

// The best child so far; the same in all invocations.
struct Best {
    Candidate candidate;
    int change;
    bool is_refused;
};

// Evaluates a candidate; it takes the best one's place if it is better. False if it is invalid after all.
bool evaluate(Candidate candidate, inout Best best) {
    Swap change = swap_of(candidate.index, flies[rule.first_fly + candidate.index], candidate.fly);
    if (!afford(CANDIDATE_TURNS) || !fits(swap_turns(change, STACK_TURNS))) {
        return false;
    }
    bool is_anew = candidate.paint != PAINT_KEEP;
    bool is_fitted = is_anew && (COLOR_SOURCE == COLOR_MEDIAN || COLOR_SOURCE == COLOR_MEAN);
    if (is_anew && COLOR_SOURCE == COLOR_PICK) {
        Fly fly = candidate.fly;
        change.color = pixels[2u * pixel_place(uvec2(fly.x + 32 >> 6, fly.y + 32 >> 6))].x & 0xFFFFFFu;
    }
    Laid laid = lay(change, !is_fitted);
    if (!laid.is_shown && candidate.paint == PAINT_BIRTH) {
        return false;
    }
    int found = laid.change;
    if (is_fitted) {
        uint most = max_all(laid.own_count);
        if (!afford(COLOR_TURNS + most)) {
            return false;
        }
        if (laid.is_shown) {
            change.color = fitted_color(laid);
        }
        found += scratch_error(change.color, laid.own_count);
    }
    // A colour of 16 bits stays as it is where it is the same in 8.
    if (change.color != fly_color(candidate.fly)) {
        set_color(candidate.fly, change.color);
    }
    if (candidate.is_same && candidate.fly.rg == candidate.old_rg && candidate.fly.ba == candidate.old_ba) {
        return false;
    }
    found += candidate.own;
    if (!best.candidate.is_valid || found < best.change) {
        best = Best(candidate, found, laid.is_refused);
    }
    return true;
}

// Whether a fly does not help; then `best` is its removal.
bool is_useless(uint index, Fly fly, int fly_fitness, inout Best best) {
    if (!is_alive(fly) || fly_fitness > 0) {
        return false;
    }
    Fly absent = Fly(0, 0, uint(Z_MAX), 0u, 0u, 16u, 16u, 0u);
    Swap change = swap_of(index, fly, absent);
    if (!fits(swap_turns(change, STACK_TURNS))) {
        return false;
    }
    best.candidate.index = index;
    best.candidate.paint = PAINT_KEEP;
    best.candidate.fly = absent;
    best.change = lay(change, true).change + without_victim(index, fly);
    return best.change <= 0;
}

// Takes the fly off a pixel's stack if it was there, and puts it there if it covers it now.
void exchange_pixel(Swap change, uint place, uvec4 top, uvec2 texel) {
    uint depth = top.x >> 24;
    uint stack = stack_first(place);
    uvec2 own = uvec2(change.fly, shaded(change.color, texel.y) | texel.x << 24);
    bool is_waiting = texel.x > 0u;
    uint count = 0u;
    uvec2 nearest = uvec2(NO_FLY, BACKGROUND_Z);
    Compositing pixel = START;
    uvec2 next = stacks[stack];
    for (uint entry = 0u; entry < depth; entry += LAYERS_AT_ONCE) {
        [[unroll]] for (uint part = 0u; part < LAYERS_AT_ONCE; ++part) {
            uvec2 current = next;
            // Read before its place may be written.
            next = stacks[stack + min(entry + part + 1u, GLAZED_DEPTH - 1u) * 64u];
            if (entry + part < depth && current.x != change.fly) {
                uint z = flies[rule.first_fly + current.x].z;
                if (is_waiting && (change.z < z || change.z == z && change.fly < current.x)) {
                    stacks[stack + count * 64u] = own;
                    nearest = count == 0u ? uvec2(change.fly, change.z) : nearest;
                    add_layer(pixel, own.y);
                    is_waiting = false;
                    ++count;
                }
                if (count != entry + part) {
                    stacks[stack + count * 64u] = current;
                }
                nearest = count == 0u ? uvec2(current.x, z) : nearest;
                add_layer(pixel, current.y);
                ++count;
            }
        }
    }
    if (is_waiting) {
        stacks[stack + count * 64u] = own;
        nearest = count == 0u ? uvec2(change.fly, change.z) : nearest;
        add_layer(pixel, own.y);
        ++count;
    }
    uvec3 sums = pixel.sums + pixel.transmittance * channels(rule.background);
    int error = glazed_error(sums, pixel.transmittance, top.x, want_of(top.z));
    pixels[2u * place] =
        uvec4(top.x & 0xFFFFFFu | count << 24, nearest.x, nearest.y | top.z & ~TOP_Z_MASK, uint(error));
}

// Takes the fly off the pixels of its old footprint and puts it on those of its new one.
void exchange(Swap change) {
    ivec2 offset = lane_offset();
    uint inner_turns = 0u;
    for (uint which = 0u; which < 2u; ++which) {
        ivec4 box = which == 0u ? change.boxes[0] : change.boxes[1];
        for (int y = box.y; y <= box.w; y += PATCH_HEIGHT) {
            for (int x = first_column(box); x <= box.z; x += PATCH_WIDTH) {
                ivec2 pixel = ivec2(x, y) + offset;
                bool is_in_box = all(greaterThanEqual(pixel, box.xy)) && all(lessThanEqual(pixel, box.zw));
                bool was = is_in_box && footprint_covers(change.old, pixel);
                uvec2 texel = is_in_box ? texel_of(change.new, change.suit, pixel) : uvec2(0u);
                uint depth = 0u;
                if (was || texel.x > 0u) {
                    uint place = pixel_place(uvec2(pixel));
                    uvec4 top = pixels[2u * place];
                    depth = top.x >> 24;
                    exchange_pixel(change, place, top, texel);
                }
                inner_turns += stack_turns(subgroupMax(depth));
            }
        }
    }
    turns += max_all(inner_turns) + swap_turns(change, 0u);
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
        best.is_refused = false;
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
        bool is_accepted = best.candidate.is_valid && best.change <= rule.highest && !best.is_refused;
        if (is_removal) {
            is_accepted = is_useless(index, fly, place_fitness, best);
        }
        Swap change;
        uint changed = best.candidate.index;
        if (is_accepted && !is_over) {
            change = swap_of(changed, flies[rule.first_fly + changed], best.candidate.fly);
            fits(swap_turns(change, STACK_TURNS));
        }
        if (is_over) {
            break;
        }
        // All have read fitness, pixels and flies before any is changed.
        sync();
        if (is_accepted) {
            exchange(change);
            add_wide(change_sum, best.change);
        }
        sync();
        if (lane == 0u) {
            if (is_accepted) {
                bool is_birth = best.candidate.paint == PAINT_BIRTH;
                flies[rule.first_fly + changed] = best.candidate.fly;
                steps[rule.first_fly + changed] = is_birth || is_removal ? STEP_FIRST : grown(steps[rule.first_fly + changed]);
                if (LEASHED == 1u && is_birth) {
                    origins[rule.first_origin + changed].form = 0u;
                }
                fitness[rule.first_fly + changed] = is_removal ? 0 : fitness[rule.first_fly + changed] - best.change;
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
            header[rule.lane].is_fresh = ROUND_OVER;
            atomicAdd(header[rule.lane].round, 1u);
        }
    }
}
