// Gives every fly its cell in the grid of the round that begins; one invocation is one fly. Twin: `deal` in
// src/cpu/cells/mod.rs.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "shared/cells_random.glsl"
#include "shared/cells_rules.glsl"
#include "shared/cells_state.glsl"
#include "shared/cells_footprint.glsl"
#include "shared/cells_grid.glsl"

layout(local_size_x = 64) in;

uint first_round(uint fly) {
    uint count = rule.class_count;
    uint round = rule.classes[3].first_round;
    round = count <= 3u || fly < rule.classes[2].end ? rule.classes[2].first_round : round;
    round = count <= 2u || fly < rule.classes[1].end ? rule.classes[1].first_round : round;
    return count <= 1u || fly < rule.classes[0].end ? rule.classes[0].first_round : round;
}

// The cell of the worst of some random pixels.
uint deal_absent(Grid grid, uint draws) {
    int worst = -1;
    uint cell = 0u;
    for (uint number = 0u; number < rule.deal_tournament; ++number) {
        uvec2 pixel = uvec2(
            chain_below(draws, 2u * number, grid.size.x), chain_below(draws, 2u * number + 1u, grid.size.y)
        );
        int error = int(pixels[2u * pixel_place(pixel)].w);
        cell = error > worst ? grid_cell_at(grid, pixel) : cell;
        worst = max(error, worst);
    }
    return cell;
}

void main() {
    take_lane();
    uint index = work_number() * 64u + gl_LocalInvocationID.x;
    uint round = header[rule.lane].round;
    if (index >= rule.fly_count || header[rule.lane].pending != 0u || round >= header[rule.lane].wanted) {
        return;
    }
    Grid grid = grid_new(search_seed(), round, picture_size(), rule.side_shift);
    Fly fly = flies[rule.first_fly + index];
    uint cell = NO_CELL;
    if (is_alive(fly)) {
        cell = grid_cell_of(grid, footprint_of(fly, grid.size).box);
    } else if (first_round(index) <= round) {
        cell = deal_absent(grid, chain_then(chain_new(search_seed(), round, DRAW_DEAL), index));
    }
    deals[rule.first_deal + index] = cell;
    if (cell != NO_CELL) {
        atomicAdd(cells[rule.first_cell + cell].dealt, 1u);
    }
}
