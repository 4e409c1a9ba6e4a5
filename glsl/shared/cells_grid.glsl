// The cells of one round. Twin: src/model/cells/grid.rs. Needs cells_random.glsl, cells_footprint.glsl.

const uint NO_CELL = 0xFFFFFFFFu;
const uint BLOCK_SHIFT = 3u;

struct Grid {
    uvec2 size;
    uint shift;
    uvec2 offset;
    uint columns;
    uint rows;
};

Grid grid_new(uvec2 seed, uint round, uvec2 size, uint shift) {
    uint chain = chain_new(seed, round, DRAW_GRID);
    uint side = 1u << shift;
    bool is_one = side >= size.x && side >= size.y;
    uvec2 offset = uvec2(chain_below(chain, 0u, side >> BLOCK_SHIFT), chain_below(chain, 1u, side >> BLOCK_SHIFT))
        << BLOCK_SHIFT;
    offset = is_one ? uvec2(0u) : offset;
    uvec2 cells = (size - 1u + offset >> shift) + 1u;
    return Grid(size, shift, offset, cells.x, cells.y);
}

uint grid_cell_at(Grid grid, uvec2 pixel) {
    uvec2 place = pixel + grid.offset >> grid.shift;
    return place.y * grid.columns + place.x;
}

// The cell that holds the whole box of a tile, or NO_CELL.
uint grid_cell_of(Grid grid, ivec4 box) {
    if (box.x > box.z) {
        return NO_CELL;
    }
    uint first = grid_cell_at(grid, uvec2(box.xy));
    uint last = grid_cell_at(grid, uvec2(box.zw));
    return first == last ? first : NO_CELL;
}

// The pixels of a cell inside the picture: left, top, and the first column and row beyond.
uvec4 grid_bounds(Grid grid, uint cell) {
    uvec2 place = uvec2(cell % grid.columns, cell / grid.columns);
    uvec2 start = place << grid.shift;
    uvec2 first = start - min(start, grid.offset);
    uvec2 end = min((place + 1u << grid.shift) - grid.offset, grid.size);
    return uvec4(first, end);
}
