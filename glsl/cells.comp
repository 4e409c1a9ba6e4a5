// The steps of the cells of one round among opaque tiles: what shared/cells_loop.glsl needs of their pixels. A
// workgroup is a cell. Twin: src/cpu/cells/opaque.rs.
//
// The word beside a fly in a stack is its error there. In the scratch lies the target; of dressed tiles first the
// colour that would show it and the weight less 1, then target and shade.
#version 460
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require
#include "shared/subgroups.glsl"

#include "shared/cells_stage.glsl"
#include "shared/tile.glsl"
#include "shared/mask.glsl"
#include "shared/cells_random.glsl"
#include "shared/cells_rules.glsl"
#include "shared/cells_state.glsl"
#include "shared/cells_footprint.glsl"
#include "shared/cells_grid.glsl"
#include "shared/cells_pixel.glsl"
#include "shared/cells_suit.glsl"
#include "shared/cells_patches.glsl"

// Where a pixel's nearest fly lies among the stacks.
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
    // What its pixels add to the change of the objective; where its colour is to be found, without the errors of its
    // colour.
    int change;
    // Weight of the pixels in the scratch, and how many of them are this invocation's.
    uint weight;
    uint own_count;
    // The most that an invocation has there.
    uint most;
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

// Looks at the pixels of a child. Its colour may be still to be found: then the pixels that show it are put in the
// scratch.
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
                change += int(rule.penalties.overlap);
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
    uint most = count;
    ivec4 all = sum_all(ivec4(change, weight, crowded, shows), most);
    if (COLOR_SOURCE == COLOR_MEAN) {
        sums = uvec3(sum_all(ivec4(sums, 0)).xyz);
    }
    return Seen(all.x, uint(all.y), count, most, all.z != 0, all.w != 0, sums);
}

#include "shared/cells_median.glsl"

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

bool evaluate(Candidate candidate, inout Best best) {
    Footprint footprint = footprint_of(candidate.fly, grid.size);
    if (!afford(CANDIDATE_TURNS + patch_turns(footprint.box, 0u))) {
        return false;
    }
    bool has_color = COLOR_SOURCE == COLOR_EVOLVED || candidate.paint == PAINT_KEEP;
    Seen seen = look(candidate.fly, candidate.index, footprint, has_color);
    int change = seen.change;
    if (!has_color) {
        if (!afford(20u + 9u * seen.most)) {
            return false;
        }
        uint color = found_color(candidate.fly, seen);
        change += scratch_error(color, seen.own_count);
        set_color(candidate.fly, color);
        if (!seen.is_shown && candidate.paint == PAINT_BIRTH) {
            return false;
        }
    }
    return offer(candidate, change, seen.is_crowded, best);
}

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

bool is_useless(uint index, Fly fly, int fly_fitness, out int change) {
    change = fly_fitness;
    return is_alive(fly) && fly_fitness <= 0;
}

// A tile in the place of another one's; one of them may be absent. The same in all invocations.
struct Swap {
    uint fly;
    uint z;
    uint color;
    Footprint old;
    Footprint new;
    Tile old_suit;
    Tile new_suit;
    // To go through.
    ivec4 boxes[2];
    // Neither depth nor colour changes; of a dressed tile both may, from pixel to pixel.
    bool is_kept;
};

Swap swap_of(uint index, Fly old, Fly child) {
    Swap swap;
    swap.fly = index;
    swap.z = child.z;
    swap.color = fly_color(child);
    swap.old = footprint_of(old, grid.size);
    swap.new = footprint_of(child, grid.size);
    swap.old_suit = suit_of(old);
    swap.new_suit = suit_of(child);
    union_boxes(swap.old.box, swap.new.box, swap.boxes);
    swap.is_kept = DRESSED == 0u && old.z == child.z && fly_color(old) == swap.color;
    return swap;
}

uint exchange_turns(Swap swap) {
    return boxes_turns(swap.boxes, STACK_DEPTH + 1u);
}

void add_fitness(uint fly, int amount) {
    if (fly != NO_FLY && amount != 0) {
        atomicAdd(fitness[rule.first_fly + fly], amount);
    }
}

uint depth_of(uint fly, Swap swap) {
    if (fly == NO_FLY) {
        return BACKGROUND_Z;
    }
    return fly == swap.fly ? swap.z : flies[rule.first_fly + fly].z;
}

// Takes the fly off a pixel's stack if it was there, and puts it there if it is seen there now. Returns the turns of
// its loop.
uint exchange_pixel(Swap swap, uint place, uint look) {
    uvec4 top = pixels[2u * place];
    uvec4 under = pixels[2u * place + 1u];
    uint depth = top.x >> 24;
    uint first = stack_first(place);
    uvec2 own = uvec2(swap.fly, uint(look_error(look, swap.color, top.x, want_of(top.z))));
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
        if (current.x == swap.fly) {
            changed = min(changed, entry);
            continue;
        }
        uint z = flies[rule.first_fly + current.x].z;
        if (is_pending && (swap.z < z || swap.z == z && swap.fly < current.x)) {
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
        pixels[2u * place] = uvec4(target, nearest.x, depth_of(nearest.x, swap) | top.z - top_z(top.z), nearest.y);
        pixels[2u * place + 1u] = uvec4(second.x, depth_of(second.x, swap), second.y, under.w);
    } else {
        pixels[2u * place].x = target;
    }
    return depth;
}

uint exchange(Swap swap) {
    ivec2 offset = lane_offset();
    int covered = 0;
    uint inner_turns = 0u;
    for (uint which = 0u; which < 2u; ++which) {
        ivec4 box = which == 0u ? swap.boxes[0] : swap.boxes[1];
        for (int y = box.y; y <= box.w; y += PATCH_HEIGHT) {
            for (int x = first_column(box); x <= box.z; x += PATCH_WIDTH) {
                ivec2 pixel = ivec2(x, y) + offset;
                // Boxes that are apart may share a patch.
                bool is_in_box = all(greaterThanEqual(pixel, box.xy)) && all(lessThanEqual(pixel, box.zw));
                bool was = is_in_box && look_of(swap.old, swap.old_suit, pixel) != LOOK_HOLE;
                uint look = look_of(swap.new, swap.new_suit, pixel);
                bool is = is_in_box && look != LOOK_HOLE;
                uint depth = 0u;
                if ((was || is) && !(was && is && swap.is_kept)) {
                    covered += (is ? 1 : 0) - (was ? 1 : 0);
                    depth = exchange_pixel(swap, pixel_place(uvec2(pixel)), look);
                }
                inner_turns += waited_for(depth, STACK_DEPTH) + 1u;
            }
        }
    }
    covered = over_subgroup(covered);
    if (speaks_for_subgroup()) {
        add_fitness(swap.fly, -covered * int(rule.penalties.overlap));
    }
    return inner_turns + boxes_turns(swap.boxes, 0u);
}

void settle_fitness(uint index, Fly old, Fly child, int change) {
    if (TURN_PENALTY == 1u) {
        int before = is_alive(old) ? turn_penalty(old, local_at(old)) : 0;
        add_fitness(index, before - turn_penalty(child, local_at(child)));
    }
}

// The table of the upper halves is clear between medians.
void begin_stage() {
#ifdef HARDWARE
    clear_weights(0u);
#endif
}

// Marginal fitness is up to date already.
void end_round() {}

#include "shared/cells_loop.glsl"
