// SPDX-License-Identifier: Apache-2.0
#pragma once

// The cells of a grid that a CoverageField is made of: densities with thermals, and growth, in blocks of 8 x 8 x 8
// (not installed).

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "density/detail.h"
#include "density/openvdb_access.h"

namespace nephos {

// Bumps of DetailOptions::size_m on an edge of a tile of the large noise.
inline constexpr double kBumpsOfTile = 8;

// Rows that turn places so that the period of the noise shows along no axis.
inline constexpr double kNoiseTurn[3][3] = {{.8, .6, 0}, {-.48, .64, .6}, {.36, -.48, .8}};

// Returns a matrix near the given one, rows from metres to periods of a noise, that takes the edges of a grid along its
// periodic axes to whole numbers of periods: the noise then repeats with the grid. Bumps are skewed a little by that:
// for n periods along an edge by up to 1 / (2 n), for n >= 1; on smaller grids they are stretched and turned.
std::array<Vec3, 3> repeating(const std::array<Vec3, 3>& rows, const Boundaries& boundaries, const Extent& extent,
                              double cell_m);

// An immutable value; const functions are thread-safe.
class CoverageCells {
  public:
    // `moisture` may be null: then nothing grows. Cells beyond periodic sides repeat; beyond open ones there are none.
    CoverageCells(const DensityGrid& grid, const DetailSetting& setting, const DensityGrid* moisture);

    // Returns a box around the cells with cloud of each block that has such.
    const std::vector<VoxelBox>& boxes() const { return boxes_; }
    bool grows() const { return !growth_.empty(); }

    // Returns the sums of the grid's own values in each layer of cells.
    std::vector<double> masses() const;

    // Returns the mean over the mass of the grid's own density in cubes of four cells, within which a droplet lies; 0
    // without cloud. Single cells would not do: a mean of two steps varies less from cell to cell than either, so frames
    // between steps would differ. Sums are in a fixed order.
    double mean_density() const;

    // Copies a cube of cells with its lowest corner at (i, j, k) into rows of `pitch` numbers: densities, and, unless it
    // is null, growth times density. Returns false if all are 0; then what was copied is not complete.
    bool copy(const int (&corner)[3], int side, int pitch, float* density, float* growth) const;

  private:
    bool crosses_periodic_side(const int (&corner)[3], int side) const;
    // Index of a cell in density_; -1 where there is none.
    std::ptrdiff_t index_in_blocks(int x, int y, int z) const;
    std::size_t index_of(int x, int y, int z) const;  // of a block in table_
    bool copy_images(const int (&corner)[3], int side, int pitch, float* density, float* growth) const;

    std::vector<Block> blocks_;
    std::vector<VoxelBox> boxes_;
    Boundaries boundaries_;
    Extent extent_;
    std::array<int, 3> size_{};  // in blocks
    std::vector<std::int32_t> table_;
    std::vector<float> density_, growth_;
    std::vector<std::array<double, kBlock>> masses_;
    std::vector<double> squares_;  // of a block: mass times mean density, summed over its cubes of four cells
};

}  // namespace nephos
