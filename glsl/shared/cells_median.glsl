// The weighted medians of the channels in the scratch. Needs cells_patches.glsl, and of the stage `scratch_place`,
// `channels_of` and `scratch_weight`.

#ifdef HARDWARE
// Weights by half a byte of each channel; of the upper half, then of the lower half where the upper one is the
// median's.
const uint HALVES = 16u;
shared uint shared_weights[2u * 3u * HALVES];

void clear_weights(uint table) {
    for (uint place = gl_LocalInvocationID.x; place < 3u * HALVES; place += LANES) {
        shared_weights[table * 3u * HALVES + place] = 0u;
    }
}

// The largest halves of which no more than `rank` lies below, and adds what does.
uvec3 median_halves(uint table, uint rank, inout uvec3 below) {
    uint first = table * 3u * HALVES;
    uvec3 found = uvec3(0u);
    uvec3 sum = below;
    [[unroll]] for (uint half_byte = 0u; half_byte < HALVES; ++half_byte) {
        bvec3 is_below = lessThanEqual(sum, uvec3(rank));
        found = mix(found, uvec3(half_byte), is_below);
        below = mix(below, sum, is_below);
        sum += uvec3(
            shared_weights[first + half_byte], shared_weights[first + HALVES + half_byte],
            shared_weights[first + 2u * HALVES + half_byte]
        );
    }
    return found;
}

// As below, half a byte at a time: with fewer barriers, and with additions in shared memory, which software Vulkan makes
// one by one.
uint median_color(uint weight, uint own_count) {
    uint rank = (weight - 1u) / 2u;
    // The table of the upper halves was cleared before the last barrier.
    for (uint place = 0u; place < own_count; ++place) {
        uint word = scratch[scratch_place(place, 0u)];
        uvec3 half_bytes = channels_of(word) >> 4;
        [[unroll]] for (uint channel = 0u; channel < 3u; ++channel) {
            atomicAdd(shared_weights[channel * HALVES + half_bytes[channel]], uint(scratch_weight(word)));
        }
    }
    clear_weights(1u);
    sync_shared();
    uvec3 below = uvec3(0u);
    uvec3 upper = median_halves(0u, rank, below);
    for (uint place = 0u; place < own_count; ++place) {
        uint word = scratch[scratch_place(place, 0u)];
        uvec3 channels = channels_of(word);
        [[unroll]] for (uint channel = 0u; channel < 3u; ++channel) {
            if (channels[channel] >> 4 == upper[channel]) {
                uint half_byte = channels[channel] & 15u;
                atomicAdd(shared_weights[(3u + channel) * HALVES + half_byte], uint(scratch_weight(word)));
            }
        }
    }
    sync_shared();
    uvec3 median = upper << 4 | median_halves(1u, rank, below);
    // Read for the last time before that barrier.
    clear_weights(0u);
    return median.x | median.y << 8 | median.z << 16;
}

#else
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
#endif
