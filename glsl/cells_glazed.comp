// The steps of the cells of one round among translucent tiles: what shared/cells_loop.glsl needs of their pixels. A
// workgroup is a cell. Twin: src/cpu/cells/translucent.rs.
//
// Every pixel shows all tiles on it, so a child's change is computed anew over its pixels and its victim's. Marginal
// fitness is exact when a round begins; within the round only that of a fly that changes follows.
//
// The word beside a fly in a stack is what it shows there: its colour under its shade, and its coverage in the highest
// byte. In the scratch lie the sums of all else, with the child's shade and two bytes of its weight in their highest
// bytes, then the target with the pixel's weight less 1 and the rest of the child's.
#version 460
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require
#include "shared/subgroups.glsl"

#include "shared/cells_stage.glsl"
#include "shared/tile.glsl"
#include "shared/mask.glsl"
#include "shared/translucency.glsl"
#include "shared/cells_random.glsl"
#include "shared/cells_rules.glsl"
#include "shared/cells_state.glsl"
#include "shared/cells_footprint.glsl"
#include "shared/cells_grid.glsl"
#include "shared/cells_pixel.glsl"
#include "shared/cells_suit.glsl"
#include "shared/cells_glaze.glsl"
#include "shared/cells_patches.glsl"
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
    // To go through.
    ivec4 boxes[2];
};

Swap swap_of(uint index, Fly old, Fly child) {
    Swap swap;
    swap.fly = index;
    swap.z = child.z;
    swap.color = fly_color(child);
    swap.old = footprint_of(old, grid.size);
    swap.new = footprint_of(child, grid.size);
    swap.suit = suit_of(child);
    union_boxes(swap.old.box, swap.new.box, swap.boxes);
    return swap;
}

uint exchange_turns(Swap swap) {
    return boxes_turns(swap.boxes, STACK_TURNS);
}

// A pixel with a child where its victim has gone, but for the child's colour.
struct Folded {
    Compositing rest;
    // The child's weight.
    uint weight;
    // Whether the victim is there.
    bool holds;
};

Folded fold(Swap swap, uint stack, uint depth, uint child_opacity) {
    Folded folded = Folded(START, 0u, false);
    uint waiting = child_opacity;
    for (uint entry = 0u; entry < depth; entry += LAYERS_AT_ONCE) {
        [[unroll]] for (uint part = 0u; part < LAYERS_AT_ONCE; ++part) {
            uvec2 layer = stacks[stack + (entry + part) * 64u];
            bool is_there = entry + part < depth;
            bool is_own = is_there && layer.x == swap.fly;
            uint z = is_there ? flies[rule.first_fly + layer.x].z : BACKGROUND_Z;
            bool is_front = swap.z < z || swap.z == z && swap.fly < layer.x;
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
    // Pixels in the scratch that are this invocation's, and the most that an invocation has there.
    uint own_count;
    uint most;
    // Whether it would stack too deep on some pixel.
    bool is_crowded;
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

// Goes through the pixels of a child and its victim, and spends turns: at most `exchange_turns`. The child's colour may
// be still to be found: then the pixels that show it are put in the scratch.
Laid lay(Swap swap, bool has_color) {
    Laid laid = Laid(0, 0u, 0u, false, false, uvec2[3](uvec2(0u), uvec2(0u), uvec2(0u)), uvec2(0u));
    ivec2 offset = lane_offset();
    uint refused = 0u;
    uint shown = 0u;
    uint inner_turns = 0u;
    for (uint which = 0u; which < 2u; ++which) {
        ivec4 box = which == 0u ? swap.boxes[0] : swap.boxes[1];
        for (int y = box.y; y <= box.w; y += PATCH_HEIGHT) {
            for (int x = first_column(box); x <= box.z; x += PATCH_WIDTH) {
                ivec2 pixel = ivec2(x, y) + offset;
                // Boxes that are apart may share a patch.
                bool is_in_box = all(greaterThanEqual(pixel, box.xy)) && all(lessThanEqual(pixel, box.zw));
                bool was = is_in_box && footprint_covers(swap.old, pixel);
                uvec2 texel = texel_of(swap.new, swap.suit, pixel);
                uint child_opacity = is_in_box ? opacity(texel.x) : 0u;
                uint depth = 0u;
                if (was || child_opacity > 0u) {
                    uint place = pixel_place(uvec2(pixel));
                    uvec4 top = pixels[2u * place];
                    depth = top.x >> 24;
                    Folded folded = fold(swap, stack_first(place), depth, child_opacity);
                    refused |= child_opacity > 0u && depth == GLAZED_DEPTH && !folded.holds ? 1u : 0u;
                    Want want = want_of(top.z);
                    bool is_wanted = folded.weight > 0u && !want.is_unwanted;
                    shown |= is_wanted && share_q8(folded.weight, texel.y) > 0 ? 1u : 0u;
                    laid.change -= int(top.w);
                    if (is_wanted && !has_color) {
                        lay_pixel(laid, folded, texel.y, top);
                    } else {
                        uvec3 sums = folded.rest.sums + folded.weight * channels(shaded(swap.color, texel.y));
                        laid.change += glazed_error(sums, folded.rest.transmittance, top.x, want);
                    }
                }
                inner_turns += stack_turns(waited_for(depth, GLAZED_DEPTH));
            }
        }
    }
    uvec2 most = uvec2(inner_turns, laid.own_count);
    ivec4 all = sum_all(ivec4(laid.change, refused, shown, 0), most);
    turns += most.x + boxes_turns(swap.boxes, 0u);
    laid.most = most.y;
    laid.change = all.x;
    laid.is_crowded = all.y != 0;
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

bool evaluate(Candidate candidate, inout Best best) {
    Swap swap = swap_of(candidate.index, flies[rule.first_fly + candidate.index], candidate.fly);
    if (!afford(CANDIDATE_TURNS) || !fits(exchange_turns(swap))) {
        return false;
    }
    bool is_anew = candidate.paint != PAINT_KEEP;
    bool is_fitted = is_anew && (COLOR_SOURCE == COLOR_MEDIAN || COLOR_SOURCE == COLOR_MEAN);
    if (is_anew && COLOR_SOURCE == COLOR_PICK) {
        Fly fly = candidate.fly;
        swap.color = pixels[2u * pixel_place(uvec2(fly.x + 32 >> 6, fly.y + 32 >> 6))].x & 0xFFFFFFu;
    }
    Laid laid = lay(swap, !is_fitted);
    if (!laid.is_shown && candidate.paint == PAINT_BIRTH) {
        return false;
    }
    int change = laid.change;
    if (is_fitted) {
        if (!afford(COLOR_TURNS + laid.most)) {
            return false;
        }
        if (laid.is_shown) {
            swap.color = fitted_color(laid);
        }
        change += scratch_error(swap.color, laid.own_count);
    }
    set_color(candidate.fly, swap.color);
    return offer(candidate, change, laid.is_crowded, best);
}

bool has_room(Best best) {
    return !best.is_crowded;
}

bool is_useless(uint index, Fly fly, int fly_fitness, out int change) {
    change = 0;
    if (!is_alive(fly) || fly_fitness > 0) {
        return false;
    }
    Swap swap = swap_of(index, fly, ABSENT);
    if (!fits(exchange_turns(swap))) {
        return false;
    }
    change = lay(swap, true).change + without_victim(index, fly);
    return change <= 0;
}

// Takes the fly off a pixel's stack if it was there, and puts it there if it covers it now.
void exchange_pixel(Swap swap, uint place, uvec4 top, uvec2 texel) {
    uint depth = top.x >> 24;
    uint stack = stack_first(place);
    uvec2 own = uvec2(swap.fly, shaded(swap.color, texel.y) | texel.x << 24);
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
            if (entry + part < depth && current.x != swap.fly) {
                uint z = flies[rule.first_fly + current.x].z;
                if (is_waiting && (swap.z < z || swap.z == z && swap.fly < current.x)) {
                    stacks[stack + count * 64u] = own;
                    nearest = count == 0u ? uvec2(swap.fly, swap.z) : nearest;
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
        nearest = count == 0u ? uvec2(swap.fly, swap.z) : nearest;
        add_layer(pixel, own.y);
        ++count;
    }
    uvec3 sums = pixel.sums + pixel.transmittance * channels(rule.background);
    int error = glazed_error(sums, pixel.transmittance, top.x, want_of(top.z));
    pixels[2u * place] =
        uvec4(top.x & 0xFFFFFFu | count << 24, nearest.x, nearest.y | top.z & ~TOP_Z_MASK, uint(error));
}

uint exchange(Swap swap) {
    ivec2 offset = lane_offset();
    uint inner_turns = 0u;
    for (uint which = 0u; which < 2u; ++which) {
        ivec4 box = which == 0u ? swap.boxes[0] : swap.boxes[1];
        for (int y = box.y; y <= box.w; y += PATCH_HEIGHT) {
            for (int x = first_column(box); x <= box.z; x += PATCH_WIDTH) {
                ivec2 pixel = ivec2(x, y) + offset;
                bool is_in_box = all(greaterThanEqual(pixel, box.xy)) && all(lessThanEqual(pixel, box.zw));
                bool was = is_in_box && footprint_covers(swap.old, pixel);
                uvec2 texel = is_in_box ? texel_of(swap.new, swap.suit, pixel) : uvec2(0u);
                uint depth = 0u;
                if (was || texel.x > 0u) {
                    uint place = pixel_place(uvec2(pixel));
                    uvec4 top = pixels[2u * place];
                    depth = top.x >> 24;
                    exchange_pixel(swap, place, top, texel);
                }
                inner_turns += stack_turns(waited_for(depth, GLAZED_DEPTH));
            }
        }
    }
    return inner_turns + boxes_turns(swap.boxes, 0u);
}

void settle_fitness(uint index, Fly old, Fly child, int change) {
    fitness[rule.first_fly + index] -= change;
}

void begin_stage() {}

void end_round() {
    header[rule.lane].is_fresh = ROUND_OVER;
}

#include "shared/cells_loop.glsl"
