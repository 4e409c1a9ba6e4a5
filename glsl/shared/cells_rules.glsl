// The numbers that decide the steps of a search. compile-shaders writes this file from src/model/cells/rules.rs and
// src/gpu/cells/layout.rs. Add a number there, where its unit and range stand, too.

const uint COLOR_MEDIAN = 0u;
const uint COLOR_MEAN = 1u;
const uint COLOR_PICK = 2u;
const uint COLOR_EVOLVED = 3u;
const uint SEARCH_SIDE_MAX = 65536u;
const uint ASPECT_FREE_Q8 = 16384u;
const uint STEP_FIRST = 19661u;
const uint STEP_MAX = 65536u;
const uint STEP_MIN = 655u;
const uint STEP_GROWTH_Q8 = 358u;
const uint STEP_SHRINK_Q8 = 235u;

struct Mix {
    uint birth_q16;
    uint recolor_q16;
    uint edge;
    uint turn;
    uint shift;
    uint depth;
    uint recolor;
};

struct Births {
    uint kind;
    uint depth;
    uint place_tournament;
    uint victim_tournament;
    int side_low;
    int side_high;
    int aspect_high;
    uint is_stroke;
    uint angle_spread;
    uint coherence_range;
};

struct Bounds {
    uint side_min_q8;
    uint side_max_q8;
    uint aspect_max_q8;
    uint local_size;
};

struct Penalties {
    uint overlap;
    uint hole;
    uint turn;
};

struct Class {
    uint end;
    uint scale_q12;
    uint first_round;
};

struct SearchRules {
    uint seed[2];
    uint side;
    uint candidates;
    uint steps_per_fly;
    uint deal_tournament;
    uint color;
    uint acceptance;
    Mix mix;
    Births births;
    Bounds bounds;
    Penalties penalties;
    Class classes[4];
    uint class_count;
    uint mask_first;
    uint mask_count;
    uint depth_gap;
    uint leash;
    uint background;
    uint grout;
    uint grout_color;
    uint width;
    uint height;
    uint columns;
    uint side_shift;
    uint fly_count;
    uint scratch_words;
    uint guide_columns;
    uint guide_rows;
    uint lane;
    uint first_fly;
    uint first_deal;
    uint first_cell;
    uint first_pixel;
    uint first_stack;
    uint first_scratch;
    uint first_guide;
    uint first_mask;
    uint first_origin;
};
