// The error metric: sum of absolute differences of 8-bit sRGB channels. Twin: `error` in src/cpu/error.rs.

int color_error(uint a, uint b) {
    ivec3 difference = (ivec3(a, a >> 8, a >> 16) & 255) - (ivec3(b, b >> 8, b >> 16) & 255);
    difference = abs(difference);
    return difference.x + difference.y + difference.z;
}
