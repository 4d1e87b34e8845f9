// SPDX-License-Identifier: Apache-2.0
#pragma once

// Means over the cells around the nodes of a brick, weighted by the field of a metaball (not installed).

#include <array>
#include <cstddef>
#include <cstdint>
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

    // Numbers of all nodes of a brick, x fastest, and of no meaning behind them.
    static constexpr std::size_t kNodes =
        std::size_t(CoverageField::kBrickNodes) * CoverageField::kBrickNodes * CoverageField::kBrickNodes;
    static constexpr std::size_t kBehind = 64;
    using Nodes = std::array<float, kNodes + kBehind>;

    // Computes the means at all nodes of size() numbers.
    void sum(const float* cells, float* nodes) const;

    // Writes the bytes of CoverageField::nodes(): t of the means, and growth. `growths`: means of growth times density.
    static void to_bytes(const Nodes& means, const Nodes& growths, float half_density, std::uint8_t* out);

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
