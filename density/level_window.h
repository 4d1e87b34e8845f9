// SPDX-License-Identifier: Apache-2.0
#pragma once

// Levels of a grid around a block, read out of its tree (not installed): squares of voxels along x and y that reach beyond
// the block's sides, across those that are periodic; beyond open ones the outermost voxels are repeated.

#include <algorithm>
#include <array>
#include <cstddef>

#include "density/openvdb_access.h"

namespace nephos {

// Where the voxels of a window of so many lie in the leaves of a tree, along one axis.
template <int voxels_across>
struct WindowAxis {
    static constexpr int kMostLeaves = voxels_across / kBlock + 4;
    std::array<int, voxels_across> leaf, inside;  // index in `origins`, and voxel in the leaf
    std::array<int, kMostLeaves> origins;
    int leaves = 0;

    // From voxel `first` on, of `voxels` that the grid has.
    WindowAxis(int first, int voxels, Boundary boundary) {
        for (std::size_t n = 0; n < voxels_across; ++n) {
            const int at = boundary == Boundary::open ? std::clamp(first + int(n), 0, voxels - 1)
                                                      : repeated(first + int(n), voxels, boundary);
            const int origin = at & ~(kBlock - 1);
            if (leaves == 0 || origins[std::size_t(leaves - 1)] != origin)
                origins[std::size_t(leaves++)] = origin;
            leaf[n] = leaves - 1;
            inside[n] = at - origin;
        }
    }
};

template <int voxels_across>
using LevelWindow = std::array<std::array<float, voxels_across>, voxels_across>;  // [y][x]
// The same of the eight levels of a leaf: [y][x][z], as a leaf has them.
template <int voxels_across>
using BlockWindow = std::array<std::array<std::array<float, kBlock>, voxels_across>, voxels_across>;

// The leaves that a window lies in, of any level of theirs.
template <int voxels_across>
class WindowLeaves {
  public:
    using Axis = WindowAxis<voxels_across>;

    // `z`: lowest level of the leaves, a multiple of 8.
    WindowLeaves(const FloatTree& tree, const Axis& x, const Axis& y, int z) : x_(x), y_(y) {
        for (int j = 0; j < y.leaves; ++j) {
            for (int i = 0; i < x.leaves; ++i) {
                const openvdb::Coord at(x.origins[std::size_t(i)], y.origins[std::size_t(j)], z);
                const FloatLeaf* leaf = tree.probeConstLeaf(at);
                Source& source = sources_[std::size_t(j)][std::size_t(i)];
                source = leaf ? Source{leaf->buffer().data(), 0} : Source{nullptr, tree.getValue(at)};
                any_ = any_ || leaf != nullptr || source.tile > 0;
            }
        }
    }

    bool any() const { return any_; }  // false: all voxels are 0

    // Returns whether the block that holds a voxel of the window is in the tree.
    bool has_block(std::size_t x, std::size_t y) const {
        const Source& source = sources_[std::size_t(y_.leaf[y])][std::size_t(x_.leaf[x])];
        return source.values != nullptr || source.tile > 0;
    }

    // Reads the voxels of a level, 0 the lowest of the leaves.
    void read(int level, LevelWindow<voxels_across>& window) const {
        for (std::size_t j = 0; j < voxels_across; ++j) {
            const auto& row = sources_[std::size_t(y_.leaf[j])];
            for (std::size_t i = 0; i < voxels_across; ++i) {
                const Source& source = row[std::size_t(x_.leaf[i])];
                window[j][i] = source.values ? source.values[leaf_offset(x_.inside[i], y_.inside[j], level)]
                                             : source.tile;
            }
        }
    }

    // The same of one level, or of all of them.
    void read(int level, BlockWindow<voxels_across>& window) const {
        each_column(window, [level](const Source& source, int offset, std::array<float, kBlock>& column) {
            column[std::size_t(level)] = source.values ? source.values[offset + level] : source.tile;
        });
    }
    void read(BlockWindow<voxels_across>& window) const {
        each_column(window, [](const Source& source, int offset, std::array<float, kBlock>& column) {
            if (source.values) {
                std::copy_n(source.values + offset, kBlock, column.data());
            } else {
                column.fill(source.tile);
            }
        });
    }

  private:
    struct Source {
        const float* values;
        float tile;
    };
    template <typename Each>
    void each_column(BlockWindow<voxels_across>& window, const Each& each) const {
        for (std::size_t j = 0; j < voxels_across; ++j) {
            const auto& row = sources_[std::size_t(y_.leaf[j])];
            for (std::size_t i = 0; i < voxels_across; ++i)
                each(row[std::size_t(x_.leaf[i])], leaf_offset(x_.inside[i], y_.inside[j], 0), window[j][i]);
        }
    }

    const Axis &x_, &y_;
    std::array<std::array<Source, Axis::kMostLeaves>, Axis::kMostLeaves> sources_;
    bool any_ = false;
};

}  // namespace nephos
