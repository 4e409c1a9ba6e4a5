// What the stages that make the steps of cells are compiled for, and the buffers that only they use.

layout(local_size_x_id = 0) in;
// 1: the workgroup has several subgroups.
layout(constant_id = 1) const uint WIDE = 1u;
// One of the COLOR_ constants. For translucent tiles, the median and the mean are both the colour of least squares.
layout(constant_id = 2) const uint COLOR_SOURCE = 0u;
// Only tests and the ablation bench set the next two. They cost nothing: with both 0, what is left after folding is the
// same module as without them.
// 1: births are mutated copies.
layout(constant_id = 3) const uint MUTANTS = 0u;
// 1: births lie anywhere in depth.
layout(constant_id = 4) const uint RANDOM_DEPTH = 0u;
layout(constant_id = 5) const uint TURN_PENALTY = 1u;
layout(constant_id = 6) const uint LOCAL_SIZE = 1u;
// 1: tiles wear masks or grout, or pixels do not all count the same.
layout(constant_id = 7) const uint DRESSED = 1u;

// Invocations of the workgroup: local_size_x again, as a constant of its own. Some compilers of other languages take no
// two constants of one number, which gl_WorkGroupSize would make.
layout(constant_id = 11) const uint LANES = 1u;

#define MASK_BINDING 12

layout(std430, binding = 7) coherent buffer StepsBuffer { uint steps[]; };
// Marginal fitness. Of a cell's own flies it is written by the cell alone; to that of frozen flies all only add.
layout(std430, binding = 8) coherent buffer FitnessBuffer { int fitness[]; };
layout(std430, binding = 9) readonly buffer GuideBuffer { uvec2 guide[]; };
// The flies of each pixel, nearest first, each with a word that the stage explains. The flies of a pixel lie one block
// of 8x8 pixels apart: first come the nearest flies of all pixels of a block, then the second ones, and so on.
layout(std430, binding = 10) coherent buffer StacksBuffer { uvec2 stacks[]; };
// Per cell the pixels where a child shows its colour, a column for each invocation, in words that the stage explains.
layout(std430, binding = 11) coherent buffer ScratchBuffer { uint scratch[]; };
