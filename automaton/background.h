// SPDX-License-Identifier: Apache-2.0
#pragma once

// The background of the probability field (field.h) where it is not the same everywhere: by height and time, and in
// grids from files. Values at a cell are those at its centre, computed in double and rounded to float32 once; every
// kernel reads them from the same tables, so that events have exactly these probabilities.

#include <array>
#include <cstddef>
#include <vector>

#include "automaton/options.h"

namespace nephos {

inline constexpr int kBlockEdge = 8;  // cells of a block on each axis

// The background in the 512 cells of a block, for hum, act and ext.
struct BlockBackground {
    std::array<float, 3> low{}, high{};       // its bounds; equal where it is the same in all cells
    std::array<const float*, 3> values{};     // 512 each, cell x + 8 y + 64 z; null where low = high
};

class Background {
  public:
    // `options` must have passed check(), and its grids must have been read.
    explicit Background(const AutomatonOptions& options);

    // Returns false when it is FieldOptions::background everywhere and always.
    bool varies() const { return varies_; }
    // Takes the profile of a time; to be called before each step.
    void set_time(const AutomatonOptions& options, double time_s);
    // Returns the background of a block; valid until the next set_time().
    BlockBackground of_block(int bx, int by, int bz) const;
    // Returns the largest values in the lattice, or more.
    const std::array<float, 3>& high() const { return high_; }

    static std::size_t memory_bytes(const AutomatonOptions& options);

  private:
    static constexpr std::size_t kCells = 512;
    // Values of a number of blocks, and their bounds.
    struct Table {
        std::vector<float> values, low, high;
        void set_bounds();
        void add_to(BlockBackground& block, std::size_t draw, std::size_t number) const;
    };

    void fill_grid(const AutomatonOptions& options, const ProbabilityGrid& grid);

    bool varies_ = false, by_height_ = false;
    int blocks_x_ = 0, blocks_y_ = 0, blocks_z_ = 0;
    std::array<Table, 3> slabs_;  // by height: a block for each slab of 8 layers
    std::array<Table, 3> grids_;  // of grids: all blocks, x fastest; empty without one
    std::array<float, 3> uniform_{}, high_{};
};

// Returns the background of a profile at a height and time: linear between levels and between key frames, constant
// beyond them. `profile` is not empty. Pure.
Probabilities background_at(const std::vector<BackgroundKeyframe>& profile, double height_m, double time_s);

}  // namespace nephos
