// How far a tile may go from where it was when its population was loaded. Twin: src/model/cells/leash.rs. Needs
// cells_operators.glsl.

// 1: there is a leash.
layout(constant_id = 8) const uint LEASHED = 0u;

// The flies as they were loaded; absent ones hold nothing back. Without a leash there are none.
layout(std430, binding = 13) coherent buffer OriginsBuffer { Fly origins[]; };

// Whether a corner that moved so far, with 13 fractional bits, is near enough.
bool is_near(ivec2 moved) {
    uvec2 by = uvec2(abs(moved)) + 8191u >> 13;
    return max(by.x, by.y) <= rule.leash && by.x * by.x + by.y * by.y <= rule.leash * rule.leash;
}

// Whether no corner lies farther than the leash from where it was.
bool is_on_leash(Fly fly, Fly origin) {
    ivec2 trig = cos_sin(fly_angle(fly));
    ivec2 old_trig = cos_sin(fly_angle(origin));
    ivec2 centre = ivec2(fly.x, fly.y) - ivec2(origin.x, origin.y);
    if (!is_alive(origin)) {
        return true;
    }
    // So that what follows fits 32 bits: the middle of the corners moves no farther than they do.
    if (max(abs(centre.x), abs(centre.y)) > int(rule.leash)) {
        return false;
    }
    centre *= 8192;
    ivec2 width = int(fly.w) * trig - int(origin.w) * old_trig;
    ivec2 height = int(fly.h) * ivec2(-trig.y, trig.x) - int(origin.h) * ivec2(-old_trig.y, old_trig.x);
    return is_near(centre + width + height) && is_near(centre + width - height) && is_near(centre - width + height)
        && is_near(centre - width - height);
}
