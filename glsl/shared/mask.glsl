// Texels of masks from a storage buffer: software Vulkan would compute a texture's addressing for each. Needs
// tile.glsl.

// Two texels in a word: coverage, shade, coverage, shade; 256 rows of 256 texels for each layer.
layout(std430, binding = MASK_BINDING) readonly buffer Masks { uint masks[]; };

// Coverage and shade of a layer at tile coordinates that the square covers; any texel of it elsewhere.
uvec2 mask_texel(uint layer, Tile tile, uvec2 uv) {
    uvec2 texel = tile_texel(tile, uv) & 255u;
    uint word = masks[layer << 15 | texel.y << 7 | texel.x >> 1];
    return uvec2(word, word >> 8) >> ((texel.x & 1u) << 4) & 255u;
}
