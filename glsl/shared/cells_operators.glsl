// How a child comes from its parent, or from nothing. Twin: src/model/cells/operators.rs; step sizes and own sides:
// rules.rs. Needs cells_rules.glsl, cells_footprint.glsl.

const uint SLOT_KIND = 0u;
const uint SLOT_RECOLOR = 1u;
const uint SLOT_OPERATOR = 2u;
const uint SLOT_PLACE = 16u;
const uint SLOT_VICTIM = 48u;

const uint MOVE_SIDE_MAX = 138u * 64u;
const uint SIDE_MIN = 16u;
const int Z_MAX = 16777215;

const Fly ABSENT = Fly(0, 0, uint(Z_MAX), 0u, 0u, 16u, 16u, 0u);

struct GuideSample {
    uint direction;
    uint coherence;
    uint size_q12;
};

GuideSample guide_at(ivec2 pixel) {
    uvec2 place = min(uvec2(max(pixel, ivec2(0))) >> 2, uvec2(rule.guide_columns, rule.guide_rows) - 1u);
    uvec2 words = guide[rule.first_guide + place.y * rule.guide_columns + place.x];
    return GuideSample(words.x & 0xFFFFu, words.x >> 16, words.y);
}

uint own_side(uint fly, GuideSample local) {
    uint count = rule.class_count;
    uint scale = rule.classes[3].scale_q12;
    scale = count <= 3u || fly < rule.classes[2].end ? rule.classes[2].scale_q12 : scale;
    scale = count <= 2u || fly < rule.classes[1].end ? rule.classes[1].scale_q12 : scale;
    scale = count <= 1u || fly < rule.classes[0].end ? rule.classes[0].scale_q12 : scale;
    uint side = min(rule.side * scale >> 12, SEARCH_SIDE_MAX);
    if (LOCAL_SIZE == 1u) {
        side = min(side * min(local.size_q12, 16384u) >> 12, SEARCH_SIDE_MAX);
    }
    return side;
}

int bell_q8(uint draws, uint slot) {
    return normal_at(chain_bits(draws, slot) >> 22);
}

// An amplitude times a bell-shaped number, rounded at random so that its mean is exact.
int bell_step(int amplitude_q8, uint draws, uint slot) {
    uint bits = chain_bits(draws, slot);
    return amplitude_q8 * normal_at(bits >> 22) + int(bits & 0xFFFFu) >> 16;
}

int move_q8(uint side, uint step) {
    return int(min(side, MOVE_SIDE_MAX) * step >> 8);
}

void move_to(inout Fly fly, ivec2 place) {
    place = clamp(place, ivec2(0), ivec2(picture_size() - 1u) * 64);
    fly.x = place.x;
    fly.y = place.y;
}

uint fly_angle(Fly fly) {
    return fly.ba >> 16;
}

void set_angle(inout Fly fly, uint angle) {
    fly.ba = fly.ba & 0xFFFFu | angle << 16;
}

uint longest(uint other, uint low, uint high) {
    return rule.bounds.aspect_max_q8 >= ASPECT_FREE_Q8 ? high : max(other * rule.bounds.aspect_max_q8 >> 8, low);
}

// `fly` with its sides within the bounds of a fly of this own side.
void bound_sides(inout Fly fly, uint side) {
    uint low = clamp(side * rule.bounds.side_min_q8 >> 8, SIDE_MIN, SEARCH_SIDE_MAX);
    uint high = clamp(side * rule.bounds.side_max_q8 >> 8, low, SEARCH_SIDE_MAX);
    uint w = clamp(fly.w, low, high);
    uint h = clamp(fly.h, low, high);
    fly.w = min(w, longest(h, low, high));
    fly.h = min(h, longest(w, low, high));
}

// One edge is moved along its normal; the opposite edge stays.
Fly edge_moved(Fly fly, uint side, uint step, uint draws) {
    uint which = chain_bits(draws, SLOT_OPERATOR) >> 30;
    int by = bell_step(move_q8(side, step), draws, SLOT_OPERATOR + 1u);
    ivec2 trig = cos_sin(fly_angle(fly));
    bool is_width = (which & 1u) == 0u;
    int old = int(is_width ? fly.w : fly.h);
    uint moved = uint(max(old + by, 0));
    Fly child = fly;
    child.w = is_width ? moved : fly.w;
    child.h = is_width ? fly.h : moved;
    bound_sides(child, side);
    by = int(is_width ? child.w : child.h) - old;
    by = (which & 2u) == 0u ? by : -by;
    ivec2 along = is_width ? trig : ivec2(-trig.y, trig.x);
    move_to(child, ivec2(fly.x, fly.y) + (by * along + 4096 >> 13));
    return child;
}

Fly turned(Fly fly, uint step, uint draws) {
    int by = int(step) * bell_q8(draws, SLOT_OPERATOR) + 512 >> 10;
    set_angle(fly, fly_angle(fly) + uint(by));
    return fly;
}

// `side` times e^(steps / 256), rounded.
uint scaled(uint side, int steps) {
    uint high;
    uint low;
    umulExtended(side, size_factor_at(steps), high, low);
    uint carry;
    low = uaddCarry(low, 1u << 15, carry);
    return high + carry << 16 | low >> 16;
}

uint resized(uint side, uint step, uint draws, uint slot) {
    int spread = int(step >> 4) * bell_q8(draws, slot);
    // Integer division, towards zero.
    int quotient = int(uint(abs(spread)) >> 8);
    return scaled(side, (spread < 0 ? -quotient : quotient) * 85 + 2048 >> 12);
}

// Place, sides and angle change a little.
Fly shifted(Fly fly, uint side, uint step, uint draws) {
    int amplitude_q8 = move_q8(side, step) >> 1;
    ivec2 place = ivec2(fly.x, fly.y)
        + ivec2(bell_step(amplitude_q8, draws, SLOT_OPERATOR), bell_step(amplitude_q8, draws, SLOT_OPERATOR + 1u));
    int angle = int(step) * bell_q8(draws, SLOT_OPERATOR + 2u) + 2048 >> 12;
    set_angle(fly, fly_angle(fly) + uint(angle));
    fly.w = resized(fly.w, step, draws, SLOT_OPERATOR + 3u);
    fly.h = resized(fly.h, step, draws, SLOT_OPERATOR + 4u);
    move_to(fly, place);
    return fly;
}

Fly raised(Fly fly, uint step, uint draws) {
    int by = int(step >> 3) * bell_q8(draws, SLOT_OPERATOR);
    fly.z = uint(clamp(int(fly.z) + by, 0, Z_MAX));
    return fly;
}

uint repainted_channel(uint channel, uint step, uint draws, uint slot) {
    int by = int(step >> 4) * bell_q8(draws, slot) >> 8;
    return uint(clamp(int(channel) + by, 0, 65535));
}

Fly repainted(Fly fly, uint step, uint draws) {
    uint r = repainted_channel(fly.rg & 0xFFFFu, step, draws, SLOT_OPERATOR + 5u);
    uint g = repainted_channel(fly.rg >> 16, step, draws, SLOT_OPERATOR + 6u);
    uint b = repainted_channel(fly.ba & 0xFFFFu, step, draws, SLOT_OPERATOR + 7u);
    fly.rg = r | g << 16;
    fly.ba = fly.ba & 0xFFFF0000u | b;
    return fly;
}

// A new tile centred on a pixel.
Fly newborn(uint side, uvec2 pixel, uint shown_z, GuideSample local, uint draws) {
    uint range = uint(rule.births.side_high - rule.births.side_low + 1);
    int log_w = rule.births.side_low + int(chain_below(draws, SLOT_OPERATOR, range));
    int log_h = rule.births.side_low + int(chain_below(draws, SLOT_OPERATOR + 1u, range));
    log_h = clamp(log_h, log_w - rule.births.aspect_high, log_w + rule.births.aspect_high);
    if (rule.births.is_stroke != 0u) {
        int longer = max(log_w, log_h);
        log_h = min(log_w, log_h);
        log_w = longer;
    }
    uint bits = chain_bits(draws, SLOT_OPERATOR + 2u);
    bool follows = local.coherence >= below(bits << 16, rule.births.coherence_range + 1u);
    int around = int(rule.births.angle_spread) * bell_q8(draws, SLOT_OPERATOR + 3u) + 128 >> 8;
    uint angle = follows ? local.direction + uint(around) : bits >> 16;
    bits = chain_bits(draws, SLOT_OPERATOR + 4u);
    uint gap = 1u + below(bits, rule.depth_gap);
    uint z = RANDOM_DEPTH == 1u ? bits >> 8 : shown_z - min(shown_z, gap);
    uint r = chain_bits(draws, SLOT_OPERATOR + 5u) >> 16;
    uint g = chain_bits(draws, SLOT_OPERATOR + 6u) >> 16;
    uint b = chain_bits(draws, SLOT_OPERATOR + 7u) >> 16;
    uint mask = rule.mask_first + chain_below(draws, SLOT_OPERATOR + 8u, rule.mask_count);
    return Fly(
        int(pixel.x * 64u), int(pixel.y * 64u), min(z, uint(Z_MAX)), r | g << 16, b | angle << 16, scaled(side, log_w),
        scaled(side, log_h), mask & 0xFFFFu | 1u << 16
    );
}

// A copy of a parent with a step in every gene.
Fly mutant(Fly parent, uint side, uint draws) {
    Fly child = shifted(parent, side, 2u * STEP_FIRST, draws);
    return repainted(raised(child, STEP_FIRST, chain_then(draws, 1u)), STEP_FIRST, draws);
}

int turn_penalty(Fly fly, GuideSample local) {
    if (TURN_PENALTY == 0u) {
        return 0;
    }
    uint deviation = (fly_angle(fly) - local.direction + 8192u & 16383u) - 8192u;
    uint squared = deviation * deviation >> 18;
    uint area = min((fly.w >> 4) * (fly.h >> 4), (1u << 24) - 1u);
    return int((area * squared >> 12) * rule.penalties.turn);
}

uint grown(uint step) {
    return min(step * STEP_GROWTH_Q8 >> 8, STEP_MAX);
}

uint shrunk(uint step) {
    return max(step * STEP_SHRINK_Q8 >> 8, STEP_MIN);
}

uint fly_color(Fly fly) {
    uvec3 channels = (uvec3(fly.rg & 0xFFFFu, fly.rg >> 16, fly.ba & 0xFFFFu) * 255u + 32767u) / 65535u;
    return channels.x | channels.y << 8 | channels.z << 16;
}

// A colour of 16 bits stays as it is where it is the same in 8.
void set_color(inout Fly fly, uint color) {
    if (color == fly_color(fly)) {
        return;
    }
    uvec3 channels = (uvec3(color, color >> 8, color >> 16) & 255u) * 257u;
    fly.rg = channels.x | channels.y << 16;
    fly.ba = fly.ba & 0xFFFF0000u | channels.z;
}
