// Gives each cell its slice of the members, and begins the round; one workgroup does it all.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "shared/cells_random.glsl"
#include "shared/cells_rules.glsl"
#include "shared/cells_state.glsl"
#include "shared/cells_footprint.glsl"
#include "shared/cells_grid.glsl"

const uint THREADS = 256u;

layout(local_size_x = 256) in;

shared uint counts[THREADS];
shared uint busy[THREADS];

void main() {
    take_lane();
    uint thread = gl_LocalInvocationID.x;
    uint round = header[rule.lane].round;
    bool begins = header[rule.lane].pending == 0u && round < header[rule.lane].wanted;
    Grid grid = grid_new(search_seed(), round, picture_size(), rule.side_shift);
    uint cell_count = begins ? grid.columns * grid.rows : 0u;
    // Each invocation takes a run of cells.
    uint run = (cell_count + THREADS - 1u) / THREADS;
    uint first_cell = min(thread * run, cell_count);
    uint end_cell = min(first_cell + run, cell_count);
    uint count = 0u;
    uint busy_count = 0u;
    for (uint cell = first_cell; cell < end_cell; ++cell) {
        count += cells[rule.first_cell + cell].dealt;
        busy_count += cells[rule.first_cell + cell].dealt > 0u ? 1u : 0u;
    }
    counts[thread] = count;
    busy[thread] = busy_count;
    memoryBarrierShared();
    barrier();
    uint first = 0u;
    uint total_busy = 0u;
    for (uint other = 0u; other < THREADS; ++other) {
        first += other < thread ? counts[other] : 0u;
        total_busy += busy[other];
    }
    for (uint cell = first_cell; cell < end_cell; ++cell) {
        uint dealt = cells[rule.first_cell + cell].dealt;
        cells[rule.first_cell + cell] = CellRecord(first, dealt, dealt > 0u ? 0u : STEP_DONE, 0u, 0u);
        first += dealt;
    }
    if (thread == 0u) {
        header[rule.lane].iterations += begins || header[rule.lane].pending != 0u ? 1u : 0u;
        header[rule.lane].is_fresh = begins ? 1u : 0u;
        if (begins) {
            header[rule.lane].pending = total_busy;
            header[rule.lane].under_way = round;
            // A round in which no cell has a fly is over at once.
            header[rule.lane].round = total_busy == 0u ? round + 1u : round;
        }
    }
}
