// SPDX-License-Identifier: Apache-2.0
#include "density/sharpen.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <string>

#include <tbb/parallel_for.h>

#include "core/error.h"
#include "density/level_window.h"
#include "density/openvdb_access.h"

namespace nephos {
namespace {

using openvdb::Coord;

constexpr int kMargin = 2;  // voxels around a block: differences of what is masked need two
constexpr int kAcross = kBlock + 2 * kMargin;
constexpr int kMasked = kBlock + 2;  // voxels of a window that have all neighbours
using Window = LevelWindow<kAcross>;
using Masked = std::array<std::array<float, kMasked>, kMasked>;  // [y][x], from the voxel before the block on

// Gains of a level along x and y.
struct Gains {
    float x = 0, y = 0;
    bool any() const { return x > 0 || y > 0; }
};

// Sums of a level, and how those of gradients grow with the gains: growth[axis][gain].
struct LevelSums {
    double mass = 0;
    std::array<double, 2> gradients{};
    std::array<std::array<double, 2>, 2> growth{};

    void add(const LevelSums& other) {
        mass += other.mass;
        for (std::size_t a = 0; a < 2; ++a) {
            gradients[a] += other.gradients[a];
            for (std::size_t b = 0; b < 2; ++b) growth[a][b] += other.growth[a][b];
        }
    }
};
using BlockSums = std::array<LevelSums, kBlock>;

// What unsharp masking adds along x and y at voxel (i, j) of a window, for a gain of 1.
inline float detail_x(const Window& w, std::size_t i, std::size_t j) {
    return 0.25f * ((w[j][i] - w[j][i - 1]) + (w[j][i] - w[j][i + 1]));
}
inline float detail_y(const Window& w, std::size_t i, std::size_t j) {
    return 0.25f * ((w[j][i] - w[j - 1][i]) + (w[j][i] - w[j + 1][i]));
}

// The blocks of a grid with their surroundings.
class Levels {
  public:
    Levels(const DensityGrid& density, const Boundaries& boundaries)
        : tree_(OpenvdbAccess::grid(density).tree()),
          extent_(density.extent()),
          boundaries_(boundaries) {
        for (const Block& block : blocks_of(density)) blocks_.push_back(block.origin);
    }

    const std::vector<Coord>& blocks() const { return blocks_; }
    Extent extent() const { return extent_; }
    int levels_of(const Coord& origin) const { return std::min(kBlock, extent_.z - origin.z()); }
    int rows_of(const Coord& origin) const { return std::min(kBlock, extent_.y - origin.y()); }
    int columns_of(const Coord& origin) const { return std::min(kBlock, extent_.x - origin.x()); }

    // Calls each(level of the block, window, leaves) for the levels of a block.
    template <typename Each>
    void for_levels(const Coord& origin, const Each& each) const {
        const WindowAxis<kAcross> x(origin.x() - kMargin, extent_.x, boundaries_.x),
            y(origin.y() - kMargin, extent_.y, boundaries_.y);
        const WindowLeaves<kAcross> leaves(tree_, x, y, origin.z());
        Window window;
        for (int z = 0; z < levels_of(origin); ++z) {
            leaves.read(z, window);
            each(z, window, leaves);
        }
    }

    // Adds up each block's levels in the order of blocks, whichever thread computed them.
    template <typename Sums>
    std::vector<LevelSums> sums_of(const Sums& sums_of_block) const {
        std::vector<BlockSums> parts(blocks_.size());
        tbb::parallel_for(std::size_t{0}, blocks_.size(), [&](std::size_t n) { sums_of_block(n, parts[n]); });
        std::vector<LevelSums> sums(std::size_t(extent_.z));
        for (std::size_t n = 0; n < blocks_.size(); ++n)
            for (int z = 0; z < levels_of(blocks_[n]); ++z)
                sums[std::size_t(blocks_[n].z() + z)].add(parts[n][std::size_t(z)]);
        return sums;
    }

    // Sums of the levels of one block. A difference belongs to the block of its first voxel or, where that is in none, to
    // that of its second.
    void add_block(const Coord& origin, BlockSums& sums) const {
        const auto rows = std::size_t(rows_of(origin)), columns = std::size_t(columns_of(origin));
        for_levels(origin, [&](int z, const Window& w, const WindowLeaves<kAcross>& leaves) {
            LevelSums& level = sums[std::size_t(z)];
            Masked x, y;
            for (std::size_t j = 0; j < kMasked; ++j)
                for (std::size_t i = 0; i < kMasked; ++i) {
                    x[j][i] = detail_x(w, i + 1, j + 1);
                    y[j][i] = detail_y(w, i + 1, j + 1);
                }
            const auto add = [&](std::size_t axis, std::size_t i, std::size_t j) {
                const std::size_t in = axis == 0 ? i + 1 : i, jn = axis == 0 ? j : j + 1;
                const double d = double(w[jn + 1][in + 1]) - double(w[j + 1][i + 1]);
                const double dx = double(x[jn][in]) - double(x[j][i]),
                             dy = double(y[jn][in]) - double(y[j][i]);
                level.gradients[axis] += std::abs(d);
                level.growth[axis][0] += d > 0 ? dx : d < 0 ? -dx : std::abs(dx);
                level.growth[axis][1] += d > 0 ? dy : d < 0 ? -dy : std::abs(dy);
            };
            const bool left = !leaves.has_block(kMargin - 1, kMargin),
                       below = !leaves.has_block(kMargin, kMargin - 1);
            // Beyond an open side there is nothing to differ from.
            const bool east = boundaries_.x == Boundary::periodic || origin.x() + kBlock < extent_.x,
                       north = boundaries_.y == Boundary::periodic || origin.y() + kBlock < extent_.y;
            for (std::size_t j = 1; j <= rows; ++j)
                for (std::size_t i = left ? 0 : 1; i < columns + (east ? 1 : 0); ++i) add(0, i, j);
            for (std::size_t j = below ? 0 : 1; j < rows + (north ? 1 : 0); ++j)
                for (std::size_t i = 1; i <= columns; ++i) add(1, i, j);
            for (std::size_t j = 1; j <= rows; ++j)
                for (std::size_t i = 1; i <= columns; ++i) level.mass += double(w[j + 1][i + 1]);
        });
    }

    std::vector<LevelSums> all_sums() const {
        return sums_of([this](std::size_t n, BlockSums& sums) { add_block(blocks_[n], sums); });
    }

    // Writes the masked levels of a block, and adds up their mass.
    void mask_block(const Coord& origin, const std::vector<Gains>& gains, float* out, BlockSums& sums) const {
        std::fill_n(out, kBlockVoxels, 0.0f);
        for_levels(origin, [&](int z, const Window& w, const WindowLeaves<kAcross>&) {
            const Gains& gain = gains[std::size_t(origin.z() + z)];
            for (std::size_t j = 0; j < std::size_t(rows_of(origin)); ++j)
                for (std::size_t i = 0; i < std::size_t(columns_of(origin)); ++i) {
                    float value = w[j + kMargin][i + kMargin];
                    if (gain.any())
                        value += gain.x * detail_x(w, i + kMargin, j + kMargin) +
                                 gain.y * detail_y(w, i + kMargin, j + kMargin);
                    value = std::clamp(value, 0.0f, 1.0f);
                    out[leaf_offset(int(i), int(j), z)] = value;
                    sums[std::size_t(z)].mass += double(value);
                }
        });
    }

  private:
    const FloatTree& tree_;
    const Extent extent_;
    const Boundaries boundaries_;
    std::vector<Coord> blocks_;
};

// One step of Newton's method from gains of 0. Sums that are above what is wanted already stay. A level without structure
// along one axis, as those of a lattice of one row, has a gain along the other alone.
Gains gains_for(const LevelSums& sums, const Vec2& wanted) {
    const double x = std::max(0.0, wanted.x - sums.gradients[0]),
                 y = std::max(0.0, wanted.y - sums.gradients[1]);
    const auto& g = sums.growth;
    const auto alone = [](double missing, double growth) {
        return float(std::clamp(missing / growth, 0.0, 1.0));
    };
    if (g[0][0] > 0 && g[1][1] == 0) return {alone(x, g[0][0]), 0};
    if (g[1][1] > 0 && g[0][0] == 0) return {0, alone(y, g[1][1])};
    const double determinant = g[0][0] * g[1][1] - g[0][1] * g[1][0];
    if (!(determinant > 1e-9 * g[0][0] * g[1][1]) || !(g[0][0] > 0)) return {};
    return {float(std::clamp((x * g[1][1] - y * g[0][1]) / determinant, 0.0, 1.0)),
            float(std::clamp((y * g[0][0] - x * g[1][0]) / determinant, 0.0, 1.0))};
}

}  // namespace

std::vector<Vec2> gradients_of(const DensityGrid& density, const Boundaries& boundaries) {
    std::vector<Vec2> gradients;
    for (const LevelSums& level : Levels(density, boundaries).all_sums())
        gradients.emplace_back(level.gradients[0], level.gradients[1]);
    return gradients;
}

DensityGrid sharpened(const DensityGrid& density, const std::vector<Vec2>& gradients,
                      const Boundaries& boundaries) {
    const Levels levels(density, boundaries);
    if (gradients.size() != std::size_t(levels.extent().z)) {
        throw Error(ErrorCode::usage, std::to_string(gradients.size()) + " sums of gradients for " +
                                          std::to_string(levels.extent().z) + " levels of a grid");
    }
    const std::vector<LevelSums> before = levels.all_sums();
    std::vector<Gains> gains;
    for (std::size_t k = 0; k < before.size(); ++k) gains.push_back(gains_for(before[k], gradients[k]));
    if (std::ranges::none_of(gains, &Gains::any)) return density;
    const std::vector<Coord>& origins = levels.blocks();
    std::vector<std::unique_ptr<FloatLeaf>> leaves(origins.size());
    const std::vector<LevelSums> after = levels.sums_of([&](std::size_t n, BlockSums& sums) {
        leaves[n] = uninitialised_leaf(origins[n]);
        levels.mask_block(origins[n], gains, leaves[n]->buffer().data(), sums);
    });
    std::vector<float> scale(before.size(), 1.0f);
    for (std::size_t k = 0; k < scale.size(); ++k)
        if (gains[k].any() && after[k].mass > 0) scale[k] = float(before[k].mass / after[k].mass);
    std::vector<NewBlock> blocks(origins.size());
    tbb::parallel_for(std::size_t{0}, origins.size(), [&](std::size_t n) {
        float* values = leaves[n]->buffer().data();
        for (int z = 0; z < levels.levels_of(origins[n]); ++z) {
            const float factor = scale[std::size_t(origins[n].z() + z)];
            if (factor == 1) continue;
            for (int column = 0; column < kBlock * kBlock; ++column) {
                float& value = values[column * kBlock + z];
                value = std::min(1.0f, value * factor);
            }
        }
        blocks[n] = NewBlock::from(std::move(leaves[n]));
    });
    TreeBuilder builder;
    for (std::size_t n = 0; n < blocks.size(); ++n) blocks[n].move_to(builder, origins[n]);
    return builder.finish(levels.extent(), density.placement());
}

}  // namespace nephos
