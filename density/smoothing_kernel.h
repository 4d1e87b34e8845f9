// SPDX-License-Identifier: Apache-2.0
#pragma once

// The SIMD kernel of smoothing (not installed): bit rows to sums to floats. The window is separable, so a sum
// over it is three passes of one axis each. A tile is a column of the box: 64 * words cells wide, `rows`
// cells deep, and the full height:
//
//     bits of a row  --expand, sum over t'-->  integers of a row  --sum over i'-->  X row
//     X rows         --sum over j'-->  Y plane, in a ring buffer of 8 + 2 k0 planes
//     Y planes       --sum over k'-->  S rows  --* r-->  blocks of floats in OpenVDB's order
//
// Integers are as narrow as the window's total weight allows: 8 bit (a box of up to 255 cells), 16, 32 bit,
// else double, which is exact up to 2^53, more than any window can reach. Planes without a bit in reach of a
// tile are skipped after one test.

#include <cstdint>
#include <vector>

#include "automaton/lattice.h"

namespace nephos {

// Largest tile.
inline constexpr int kMaxWords = 8;
inline constexpr int kMaxRows = 64;

enum class SumType { u8, u16, u32, f64 };

// The validated and precomputed parameters of a call of smooth().
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

// The cells from 64 * first_word in x and first_row in y; first_row is a multiple of 8.
struct SmoothingTile {
    int first_word = 0, words = 0;
    int first_row = 0, rows = 0;  // rows is a multiple of 8; rows beyond the extent are not output
};

// Receives the blocks of a tile, in the order z, y, x of their positions.
class BlockSink {
  public:
    virtual ~BlockSink() = default;
    // Returns memory for the 512 values of the block at cell (x, y, z), in OpenVDB's order:
    // (x & 7) << 6 | (y & 7) << 3 | z & 7.
    virtual float* begin_block(int x, int y, int z) = 0;
    // Ends the block of the last begin_block(): bit n of the 512 is set where value n is above 0.
    virtual void end_block(const std::uint64_t (&mask)[8]) = 0;
    // Receives a block whose 512 values are all 1.
    virtual void saturated_block(int x, int y, int z) = 0;
};

// Computes a tile and passes its blocks with a value above 0 to the sink.
void smooth_tile(const SmoothingPlan& plan, const SmoothingTile& tile, BlockSink& sink);

}  // namespace nephos
