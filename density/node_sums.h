// SPDX-License-Identifier: Apache-2.0
#pragma once

// Means over the cells around the nodes of a brick, weighted by the field of a metaball (not installed).

#include <cstddef>
#include <vector>

#include "density/detail.h"

namespace nephos {

// The weights of cells for nodes of each of eight parities: a node lies at a corner, in the middle of an edge, of a face
// or of a cell. An immutable value.
class NodeSums {
  public:
    // `radius`: of the metaballs, cells.
    explicit NodeSums(double radius);

    int reach() const { return reach_; }           // cells beyond those of the brick that count
    int side() const { return side_; }             // of the cube of cells that a brick needs
    int pitch() const { return side_ + kRow; }     // of its rows; kRow numbers behind the last one are read
    std::size_t size() const { return std::size_t(side_ * side_ * pitch() + kRow); }

    // Computes the means at all kBrickNodes^3 nodes, x fastest, of size() numbers.
    void sum(const float* cells, float* nodes) const;

    struct Tap {
        int offset;  // from the cell at or below the node, in the rows of cells
        float weight;
    };
    static constexpr int kRow = 8;  // nodes of one parity in a row, at least kBrickNodes / 2 + 1

  private:
    int reach_, side_;
    std::vector<Tap> taps_[8];  // by parity: bits of x, y, z
};

}  // namespace nephos
