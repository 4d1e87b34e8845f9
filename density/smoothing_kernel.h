// SPDX-License-Identifier: Apache-2.0
#pragma once

// The inner part of smoothing (not installed): from bit rows to sums to floats, in the widest instructions
// that the machine has. The window is separable, so a sum over it is three passes of one axis each. A tile is
// a column of the box: 64 * words cells wide, `rows` cells deep, and all of its height:
//
//     bits of a row  --expand, sum over t'-->  integers of a row  --sum over i'-->  X row
//     X rows         --sum over j'-->  Y plane, kept in a ring of 8 + 2 k0 planes
//     Y planes       --sum over k'-->  S rows  --* r-->  floats: dense rows, or blocks in OpenVDB's order
//
// Integers are as narrow as the window's total weight allows: 8 bit (a box of up to 255 cells), 16, 32 bit,
// else double, which is exact up to 2^53, more than any window can reach. Planes without a bit in reach of a
// tile cost one look.

#include <cstdint>
#include <vector>

#include "automaton/lattice.h"

namespace nephos {

// Largest tile.
inline constexpr int kMaxWords = 8;
inline constexpr int kMaxRows = 64;

enum class SumType { u8, u16, u32, f64 };

// A call of smooth() with everything checked and worked out.
struct SmoothingPlan {
    Extent extent;
    Boundaries boundaries;
    std::vector<BitPlaneView> planes;          // one per step given
    std::vector<std::uint32_t> plane_weights;  // w(t') of each
    std::vector<std::uint32_t> wx, wy, wz;     // w(-radius) .. w(radius)
    double total = 1;                          // W, a whole number below 2^53
    float reciprocal = 1;                      // r
    SumType type = SumType::u8;
};

// Cells 64 * first_word .. in x, first_row .. in y. first_row is a multiple of 8.
struct SmoothingTile {
    int first_word = 0, words = 0;
    int first_row = 0, rows = 0;  // rows is a multiple of 8; rows beyond the extent give nothing
};

// Receives the blocks of a tile, in the order z, y, x of their positions.
class BlockSink {
  public:
    virtual ~BlockSink() = default;
    // Memory for the 512 values of the block at cell (x, y, z), in OpenVDB's order:
    // (x & 7) << 6 | (y & 7) << 3 | z & 7.
    virtual float* begin_block(int x, int y, int z) = 0;
    // Ends the block begun last: bit n of the 512 is set where value n is above 0.
    virtual void end_block(const std::uint64_t (&mask)[8]) = 0;
    // A block whose 512 values are all 1.
    virtual void saturated_block(int x, int y, int z) = 0;
};

// Blocks with a value above 0 go to the sink; others are left out.
void smooth_tile(const SmoothingPlan& plan, const SmoothingTile& tile, BlockSink& sink);

// The floats of the tile go to their places in the dense array `out` (x fastest). `stream`: past the caches,
// for results larger than they are.
void smooth_tile(const SmoothingPlan& plan, const SmoothingTile& tile, float* out, bool stream);

}  // namespace nephos
