// SPDX-License-Identifier: Apache-2.0
#pragma once

// A sparse box of density values: what smoothing makes out of bits, what files hold and what is drawn.
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

class DensityGrid {
  public:
    // No voxels at all: extent 0 x 0 x 0.
    DensityGrid();

    // From extent.cells() values, x fastest. Values are kept as they are; 0 stays empty.
    // Throws Error(usage) when the number of values is not extent.cells(), when a value is negative or not
    // finite, or when cell_size_m is not above 0.
    static DensityGrid from_dense(std::span<const float> values, Extent extent, const Placement& placement);

    // Bounds of the voxels, the same for every grid of a sequence however much of it is cloud.
    Extent extent() const;
    // World position; cell_size_m is the edge of a voxel (a refined grid has smaller voxels than the lattice
    // cells).
    const Placement& placement() const;

    // Value of one voxel; 0 outside the extent. For many values to_dense() is far faster.
    float value(int i, int j, int k) const;
    // Number of voxels with a value above 0.
    std::uint64_t active_voxels() const;
    // Smallest box around the voxels above 0.
    VoxelBox bounding_box() const;
    // Largest value; 0 for an empty grid.
    float max_value() const;
    // Sum of all values, in a fixed order.
    double sum() const;
    // All extent().cells() values, x fastest; index with linear_index(extent(), i, j, k).
    std::vector<float> to_dense() const;
    // Bytes that the voxels and the tree above them take.
    std::size_t memory_bytes() const;

    // The same voxels at another place or size in the world. Shares the voxels.
    DensityGrid with_placement(const Placement& placement) const;

  private:
    struct Impl;
    friend struct OpenvdbAccess;
    explicit DensityGrid(std::shared_ptr<const Impl> impl);

    std::shared_ptr<const Impl> impl_;  // never null
};

}  // namespace nephos
