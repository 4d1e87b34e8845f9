// SPDX-License-Identifier: Apache-2.0
#pragma once

// A sparse grid of density values: the result of smoothing, the content of VDB files, the input of rendering.
//
// Voxels have the index space of the lattice: (0, 0, 0) is the lowest corner, x east, y north, z up, and a
// voxel's centre lies at origin + (i+0.5, j+0.5, k+0.5) * voxel size. Only voxels with a value above 0 take
// memory; all others read as 0. Underneath is an OpenVDB float tree, which stays out of this header.
//
// A DensityGrid is an immutable value: copies share the voxels, and every function here may be called from
// several threads at once.

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "automaton/lattice.h"

namespace nephos {

// Box of voxels, both corners included; empty when min > max on any axis.
struct VoxelBox {
    std::array<int, 3> min{0, 0, 0};
    std::array<int, 3> max{-1, -1, -1};

    bool empty() const { return min[0] > max[0] || min[1] > max[1] || min[2] > max[2]; }
    bool operator==(const VoxelBox&) const = default;
};

// The voxels of a part of a grid, x fastest; `low` as VoxelBox.
struct VoxelBlock {
    std::array<int, 3> low{}, size{};
    std::span<const float> values;
};

class DensityGrid {
  public:
    // Creates an empty grid of extent 0 x 0 x 0.
    DensityGrid();

    // Creates a grid from extent.cells() values, x fastest, without rounding; zeros take no memory. Throws
    // Error(usage) when the number of values is not extent.cells(), when a value is negative or not finite,
    // or when cell_size_m is not above 0.
    static DensityGrid from_dense(std::span<const float> values, Extent extent, const Placement& placement);

    // Returns the number of voxels on each axis, the same for every grid of a sequence.
    Extent extent() const;
    // Returns the placement in the world; cell_size_m is the edge of a voxel (smaller than a cell of the
    // lattice in a refined grid).
    const Placement& placement() const;

    // Returns the value of one voxel; 0 outside the extent. For many values to_dense() is far faster.
    float value(int i, int j, int k) const;
    // Returns the number of voxels with a value above 0.
    std::uint64_t active_voxels() const;
    // Returns the smallest box around the voxels above 0.
    VoxelBox bounding_box() const;
    // Returns the largest value; 0 for an empty grid.
    float max_value() const;
    // Returns the sum of all values, added in a fixed order.
    double sum() const;
    // Returns all extent().cells() values, x fastest; index with linear_index(extent(), i, j, k).
    std::vector<float> to_dense() const;
    // Calls `visit` for each block of 8 x 8 x 8 voxels that has a value above 0, smaller at the far sides of the extent, one
    // after the other: without room for the whole box.
    void visit_blocks(const std::function<void(const VoxelBlock&)>& visit) const;
    // Calls `visit` for each such block in which this grid or another of the same extent has a value above 0, with the values
    // of both.
    void visit_blocks(const DensityGrid& other,
                      const std::function<void(std::span<const float>, std::span<const float>)>& visit) const;
    // Returns the bytes that the voxels and the tree above them take.
    std::size_t memory_bytes() const;

  private:
    struct Impl;
    friend struct OpenvdbAccess;
    explicit DensityGrid(std::shared_ptr<const Impl> impl);

    std::shared_ptr<const Impl> impl_;  // never null
};

}  // namespace nephos
