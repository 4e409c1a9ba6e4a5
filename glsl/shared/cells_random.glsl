// Random numbers of the cells search: a hash chain. Twin: src/model/cells/random.rs.

const uint DRAW_GRID = 1u;
const uint DRAW_DEAL = 2u;
const uint DRAW_STEP = 3u;

uint hash(uint x) {
    x ^= x >> 16;
    x *= 0x7FEB352Du;
    x ^= x >> 15;
    x *= 0x846CA68Bu;
    return x ^ x >> 16;
}

// The next link of a chain, by its number.
uint chain_then(uint chain, uint number) {
    return hash(chain ^ (number * 0x9E3779B9u + 0x7F4A7C15u));
}

// 32 uniform bits, by slot.
uint chain_bits(uint chain, uint slot) {
    return hash(chain + (slot + 1u) * 0x9E3779B9u);
}

// A number below `bound` from 32 uniform bits.
uint below(uint bits, uint bound) {
    uint high;
    uint low;
    umulExtended(bits, bound, high, low);
    return high;
}

uint chain_below(uint chain, uint slot, uint bound) {
    return below(chain_bits(chain, slot), bound);
}

uint chain_new(uvec2 seed, uint round, uint draw) {
    return chain_then(chain_then(chain_then(hash(seed.x), seed.y), round), draw);
}
