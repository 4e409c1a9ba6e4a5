// What all lanes share, for every kernel that evaluates. Layout: src/gpu/layout.rs.

struct Lane {
    uint first_fly;
    uint first_mask;
    uint background;
    uint sum;
};

// Highest byte of a target pixel inside the picture; 0 in the overhang of blocks at the edges.
const uint INSIDE = 0xFF000000u;
