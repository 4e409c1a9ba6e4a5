// The steps of one cell in one round, whatever its tiles are: selection, mutation, evaluation, acceptance, removal.
// Twin: `Cell::run` in src/cpu/cells/cell.rs.
//
// Candidate k is made by invocation k; then all invocations work on its pixels together. Software Vulkan ends all loops
// of an invocation after 65,535 turns. So turns are counted, and a cell stops before a step that might not fit its
// budget; the next dispatch goes on there. Until a child is accepted nothing is written, so an abandoned step leaves no
// trace.
//
// Needs cells_steps.glsl, and from the stage what the twin's trait `Ground` asks of a kind of pixels (below). Arguments
// and results are the same in all invocations. A function that finds the budget too small sets `is_over`, and its
// result does not count.
//
// Swap: a child's tile in the place of its victim's. One of them may be absent.
// bool evaluate(Candidate, inout Best): finds the child's colour and offers the child. False if it is invalid.
// bool has_room(Best): whether no pixel's stack would become too deep.
// bool is_useless(uint index, Fly, int fitness, out int change): whether a fly does not help; the change without it.
// Swap swap_of(uint index, Fly old, Fly child): old is the fly of this index, and child takes its place.
// uint exchange_turns(Swap): most turns of `exchange`.
// uint exchange(Swap): takes the old tile off its pixels and puts the new one on its own. The turns of this invocation.
// void settle_fitness(uint index, Fly old, Fly child, int change): ends the exchange; called by one invocation.
// void begin_stage(): done first.
// void end_round(): called by one invocation when the last cell of the round is done.

void main() {
    take_lane();
    cell_number = push.first_cell + work_number();
    // Written by the scan alone. `round` and `pending` must not be read here: the last cell of the round writes them,
    // perhaps before this workgroup begins.
    uint round = header[rule.lane].under_way;
    grid = grid_new(search_seed(), round, picture_size(), rule.side_shift);
    if (cell_number >= grid.columns * grid.rows) {
        return;
    }
    cell = cells[rule.first_cell + cell_number];
    // Of all records only the scan makes others than done ones, those of the cells that it counts as pending; and only
    // a cell's own workgroup ends it. So a cell with steps left belongs to the round under way, however late it is
    // looked at, and all others have nothing to do.
    if (cell.step == STEP_DONE) {
        return;
    }
    begin_sums();
    begin_tournaments();
    begin_stage();
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
        uint tournaments = tournament_turns(min(BATCH, candidates));
        uint making = STEP_TURNS
            + (is_removal ? 0u : batches * (BATCH_TURNS + tournaments) + candidates * SLOT_TURNS);
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
            uint slots = min(BATCH, candidates - first);
            hold_tournaments(place_fitness, draws, first, slots);
            if (lane < slots) {
                uint own_draws = chain_then(draws, first + lane + 1u);
                store_candidate(lane, make_candidate(place, index, fly, place_fitness, own_draws, slots));
            }
            sync_shared();
            for (uint slot = 0u; slot < slots; ++slot) {
                Candidate candidate = load_candidate(slot);
                if (candidate.is_valid && !is_over && evaluate(candidate, best)) {
                    ++step_evals;
                    was_changed = was_changed || candidate.paint != PAINT_BIRTH;
                }
            }
            // The sync at the end of the step is that of the last batch.
            if (first + BATCH < candidates) {
                sync_shared();
            }
        }
        bool is_accepted = false;
        // Acceptance is 0 if neutral changes are welcome, and 1 if not.
        if (best.candidate.is_valid && best.change <= -int(rule.acceptance) && !is_over) {
            is_accepted = has_room(best);
        }
        if (is_removal) {
            is_accepted = is_useless(index, fly, place_fitness, best.change);
            best.candidate.index = index;
            best.candidate.paint = PAINT_KEEP;
            best.candidate.fly = ABSENT;
        }
        uint changed = best.candidate.index;
        Fly old = fly;
        Swap swap;
        if (is_accepted && !is_over) {
            old = flies[rule.first_fly + changed];
            swap = swap_of(changed, old, best.candidate.fly);
            fits(exchange_turns(swap));
        }
        if (is_over) {
            break;
        }
        if (is_accepted) {
            // All have read fitness, pixels and flies before any is changed.
            sync();
            turns += sync_and_most(exchange(swap));
            add_wide(change_sum, best.change);
        }
        if (lane == 0u) {
            if (is_accepted) {
                Fly child = best.candidate.fly;
                bool is_birth = best.candidate.paint == PAINT_BIRTH;
                flies[rule.first_fly + changed] = child;
                steps[rule.first_fly + changed] =
                    is_birth || is_removal ? STEP_FIRST : grown(steps[rule.first_fly + changed]);
                if (LEASHED == 1u && is_birth) {
                    origins[rule.first_origin + changed].form = 0u;
                }
                if (is_removal) {
                    fitness[rule.first_fly + changed] = 0;
                } else {
                    settle_fitness(changed, old, child, best.change);
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
            end_round();
            atomicAdd(header[rule.lane].round, 1u);
        }
    }
}
