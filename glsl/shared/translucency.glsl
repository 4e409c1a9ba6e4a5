// How translucent tiles add up. Twin: src/model/translucency.rs, which explains the rule.

const uint CLEAR = 65536u;
const uint SOLID = 256u;

struct Compositing {
    uint transmittance;
    uvec3 sums;
};

const Compositing START = Compositing(CLEAR, uvec3(0u));

uint opacity(uint coverage) {
    return coverage + (coverage >> 7);
}

uint kept(uint transmittance, uint opacity) {
    return transmittance * (SOLID - opacity) >> 8;
}

uint widest_after(uint widest, uint transmittance, uint opacity) {
    return max(kept(widest, opacity), transmittance);
}

uvec3 channels(uint color) {
    return uvec3(color, color >> 8, color >> 16) & 255u;
}

// A layer: its colour, and its coverage in the highest byte. 0 changes nothing.
void add_layer(inout Compositing pixel, uint layer) {
    uint left = kept(pixel.transmittance, opacity(layer >> 24));
    pixel.sums += (pixel.transmittance - left) * channels(layer);
    pixel.transmittance = left;
}

// The packed colour that shows over a background.
uint shown_over(Compositing pixel, uint background) {
    uvec3 shown = pixel.sums + pixel.transmittance * channels(background) + CLEAR / 2u >> 16;
    return shown.x | shown.y << 8 | shown.z << 16;
}

// The packed colour of the layers alone, not premultiplied, with their opacity in the highest byte; 0 if that is 0.
uint shown_alone(Compositing pixel) {
    uint alpha = (CLEAR - pixel.transmittance) * 255u + CLEAR / 2u >> 16;
    uvec3 over_black = pixel.sums + CLEAR / 2u >> 16;
    uvec3 shown = (over_black * 255u + alpha / 2u) / max(alpha, 1u);
    return alpha == 0u ? 0u : shown.x | shown.y << 8 | shown.z << 16 | alpha << 24;
}
