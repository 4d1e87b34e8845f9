// SPDX-License-Identifier: Apache-2.0
#include "density/carry.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include <tbb/parallel_for.h>

#include "core/error.h"
#include "core/text.h"
#include "density/level_window.h"
#include "density/openvdb_access.h"
#include "density/smoothing.h"

namespace nephos {
namespace {

using openvdb::Coord;

constexpr int kTaps = 6, kBefore = 2;  // voxels of the polynomial, and how many lie before the one below
constexpr int kWindow = kBlock + kTaps - 1;  // voxels along an axis that a block of results needs

// One axis of one level: result i lies between the voxels i + base and i + base + 1.
struct AxisShift {
    int base = 0;
    std::array<float, kTaps> weights{};
    double shift = 0;
};

AxisShift axis_shift(double shift) {
    AxisShift axis;
    axis.shift = shift;
    const double place = -shift, below = std::floor(place), f = place - below;
    axis.base = int(below);
    for (int m = 0; m < kTaps; ++m) {
        double weight = 1;
        for (int n = 0; n < kTaps; ++n)
            if (n != m) weight *= (f + kBefore - n) / (m - n);
        axis.weights[std::size_t(m)] = float(weight);
    }
    return axis;
}

using Window = BlockWindow<kWindow>;
using Column = std::array<float, kBlock>;        // values of the levels of a block
using Values = std::array<float, kBlockVoxels>;  // of a block, as a leaf has them
using Weights = std::array<Column, kTaps>;       // of each voxel of the polynomial, for each level

// Writes the values between two columns of voxels by the six around them, each limited to the range of the two. `taps`:
// the first of the six, `stride` columns from one to the next.
inline void between(const Column* taps, std::size_t stride, const Weights& weights, float* out) {
    Column sum{};
    for (std::size_t m = 0; m < kTaps; ++m)
        for (std::size_t z = 0; z < kBlock; ++z) sum[z] += taps[m * stride][z] * weights[m][z];
    const Column &a = taps[kBefore * stride], &b = taps[(kBefore + 1) * stride];
    for (std::size_t z = 0; z < kBlock; ++z) {
        const float least = b[z] < a[z] ? b[z] : a[z], most = a[z] < b[z] ? b[z] : a[z];
        const float raised = sum[z] < least ? least : sum[z];
        sum[z] = most < raised ? most : raised;
    }
    std::copy(sum.begin(), sum.end(), out);
}

// Blocks that are reached, each once.
class Blocks {
  public:
    explicit Blocks(const Extent& extent)
        : across_(blocks(extent.x)), deep_(blocks(extent.y)), reached_(across_ * deep_ * blocks(extent.z)) {}
    void add(const Coord& origin) {
        reached_[(block(origin.z()) * deep_ + block(origin.y())) * across_ + block(origin.x())] = true;
    }
    // In block_order().
    std::vector<Coord> origins() const {
        std::vector<Coord> found;
        for (std::size_t n = 0; n < reached_.size(); ++n) {
            if (!reached_[n]) continue;
            const std::size_t row = n / across_;
            found.emplace_back(kBlock * int(n % across_), kBlock * int(row % deep_),
                               kBlock * int(row / deep_));
        }
        return found;
    }

  private:
    static std::size_t block(int voxel) { return std::size_t(voxel / kBlock); }
    static std::size_t blocks(int voxels) { return block(voxels + kBlock - 1); }
    std::size_t across_, deep_;
    std::vector<bool> reached_;
};

class Carrier {
  public:
    Carrier(const CarriedGrid& state, const Boundaries& boundaries)
        : density_(*state.grid),
          grid_(OpenvdbAccess::grid(*state.grid)),
          extent_(state.grid->extent()),
          boundaries_(boundaries) {
        if (state.shift.size() != std::size_t(extent_.z)) {
            throw Error(ErrorCode::usage, std::to_string(state.shift.size()) + " displacements for " +
                                              std::to_string(extent_.z) + " levels of a grid");
        }
        for (const Vec2& shift : state.shift) {
            for (const double along : {shift.x, shift.y}) {
                if (std::abs(along) <= 0x1p30) continue;
                throw Error(ErrorCode::usage,
                            "a displacement of " + number_text(along, 6) + " voxels: must be within 2^30");
            }
            // Whole periods change nothing.
            const auto near = [](double along, int voxels, Boundary boundary) {
                return boundary == Boundary::periodic ? std::remainder(along, double(voxels)) : along;
            };
            x_.push_back(axis_shift(near(shift.x, extent_.x, boundaries.x)));
            y_.push_back(axis_shift(near(shift.y, extent_.y, boundaries.y)));
        }
    }

    bool moves() const {
        return std::ranges::any_of(x_, [](const AxisShift& a) { return a.shift != 0; }) ||
               std::ranges::any_of(y_, [](const AxisShift& a) { return a.shift != 0; });
    }

    // Adds the origins of the blocks that the grid's clouds reach.
    void add_reached(Blocks& reached_blocks) const {
        for (const Block& block : blocks_of(density_)) {
            if (block.positive_count() == 0) continue;
            const auto along_x = reached(block.origin.x(), block.origin.z(), x_, extent_.x, boundaries_.x),
                       along_y = reached(block.origin.y(), block.origin.z(), y_, extent_.y, boundaries_.y);
            for (const int y : along_y)
                for (const int x : along_x) reached_blocks.add({x, y, block.origin.z()});
        }
    }

    // Writes the values of a block; 0 where the state does not reach.
    void sample(const Coord& origin, Values& out) const {
        Window window;
        out.fill(0);
        if (!gather(origin, window)) return;
        const int levels = std::min(kBlock, extent_.z - origin.z());
        Weights x{}, y{};
        for (int z = 0; z < levels; ++z) {
            for (std::size_t m = 0; m < kTaps; ++m) {
                x[m][std::size_t(z)] = x_[std::size_t(origin.z() + z)].weights[m];
                y[m][std::size_t(z)] = y_[std::size_t(origin.z() + z)].weights[m];
            }
        }
        std::array<std::array<Column, kBlock>, kWindow> rows;
        for (std::size_t j = 0; j < kWindow; ++j)
            for (std::size_t i = 0; i < kBlock; ++i) between(&window[j][i], 1, x, rows[j][i].data());
        for (int j = 0; j < kBlock; ++j)
            for (int i = 0; i < kBlock; ++i)
                between(&rows[std::size_t(j)][std::size_t(i)], kBlock, y,
                        &out[std::size_t(leaf_offset(i, j, 0))]);
        if (levels == kBlock && boundaries_.x == Boundary::periodic && boundaries_.y == Boundary::periodic)
            return;
        for (int z = 0; z < kBlock; ++z)
            for (int j = 0; j < kBlock; ++j)
                for (int i = 0; i < kBlock; ++i)
                    if (z >= levels || !reaches(origin, i, j, z)) out[std::size_t(leaf_offset(i, j, z))] = 0;
    }

    // Returns whether the state reaches a voxel of a block; an open side extends by one voxel.
    bool reaches(const Coord& origin, int i, int j, int z) const {
        const auto k = std::size_t(origin.z() + z);
        return reaches(x_[k], origin.x() + i, extent_.x, boundaries_.x) &&
               reaches(y_[k], origin.y() + j, extent_.y, boundaries_.y);
    }

  private:
    static bool reaches(const AxisShift& axis, int at, int voxels, Boundary boundary) {
        const double place = at - axis.shift;
        return boundary == Boundary::periodic || (place >= -1 && place <= voxels);
    }

    // Origins along an axis of the blocks that a block's cloud may reach; each once.
    static std::vector<int> reached(int origin, int level, const std::vector<AxisShift>& shifts, int voxels,
                                    Boundary boundary) {
        double least = shifts[std::size_t(level)].shift, most = least;
        for (std::size_t k = std::size_t(level); k < std::min(shifts.size(), std::size_t(level + kBlock));
             ++k) {
            least = std::min(least, shifts[k].shift);
            most = std::max(most, shifts[k].shift);
        }
        const int last_of_block = std::min(origin + kBlock, voxels) - 1;
        // Outermost voxels of an open side reach one further.
        const int first = int(std::floor(origin + least)) - 1,
                  last = int(std::ceil(last_of_block + most)) + 1;
        std::vector<int> origins;
        const auto add = [&](int from, int to) {
            for (int at = std::max(from, 0) & ~(kBlock - 1); at <= std::min(to, voxels - 1); at += kBlock)
                origins.push_back(at);
        };
        if (boundary == Boundary::open) {
            add(first, last);
        } else if (last - first >= voxels) {
            add(0, voxels - 1);
        } else {
            const int begin = repeated(first, voxels, boundary), end = begin + (last - first);
            add(begin, end);
            if (end >= voxels) add(0, end - voxels);
        }
        std::ranges::sort(origins);
        origins.erase(std::unique(origins.begin(), origins.end()), origins.end());
        return origins;
    }

    // Reads the voxels that a block of results needs; false when all are 0. Levels that are shifted alike, as nearly all
    // neighbours are, are read together.
    bool gather(const Coord& origin, Window& window) const {
        const int low = origin.z(), high = std::min(low + kBlock, extent_.z);
        const auto like_first = [&](int k) {
            return x_[std::size_t(k)].base == x_[std::size_t(low)].base &&
                   y_[std::size_t(k)].base == y_[std::size_t(low)].base;
        };
        bool alike = true, any = false;
        for (int k = low + 1; k < high; ++k) alike = alike && like_first(k);
        if (!alike) window = {};
        for (int k = low; k < (alike ? low + 1 : high); ++k) {
            const WindowAxis<kWindow> x(origin.x() + x_[std::size_t(k)].base - kBefore, extent_.x,
                                        boundaries_.x),
                y(origin.y() + y_[std::size_t(k)].base - kBefore, extent_.y, boundaries_.y);
            const WindowLeaves<kWindow> leaves(grid_.tree(), x, y, low);
            any = any || leaves.any();
            if (alike) {
                if (any) leaves.read(window);
            } else {
                leaves.read(k - low, window);
            }
        }
        return any;
    }

    const DensityGrid& density_;
    const FloatGrid& grid_;
    const Extent extent_;
    const Boundaries boundaries_;
    std::vector<AxisShift> x_, y_;  // of each level
};

// Computes all blocks; fill(origin, values) writes those of a block, also beyond the grid, where they are left out.
template <typename Fill>
DensityGrid make_blocks(const DensityGrid& like, const std::vector<Coord>& origins, const Fill& fill) {
    const Extent extent = like.extent();
    std::vector<NewBlock> blocks(origins.size());
    tbb::parallel_for(std::size_t{0}, origins.size(), [&](std::size_t n) {
        const Coord& origin = origins[n];
        auto leaf = uninitialised_leaf(origin);
        Values values;
        fill(origin, values);
        const int nx = std::min(kBlock, extent.x - origin.x()), ny = std::min(kBlock, extent.y - origin.y());
        for (int x = 0; x < kBlock; ++x)
            for (int y = 0; y < kBlock; ++y)
                if (x >= nx || y >= ny) std::fill_n(&values[std::size_t(leaf_offset(x, y, 0))], kBlock, 0.0f);
        std::copy(values.begin(), values.end(), leaf->buffer().data());
        blocks[n] = NewBlock::from(std::move(leaf));
    });
    TreeBuilder builder;
    for (std::size_t n = 0; n < blocks.size(); ++n) blocks[n].move_to(builder, origins[n]);
    return builder.finish(extent, like.placement());
}

}  // namespace

DensityGrid carried(const CarriedGrid& state, const Boundaries& boundaries) {
    const Carrier carrier(state, boundaries);
    if (!carrier.moves()) return *state.grid;
    Blocks reached(state.grid->extent());
    carrier.add_reached(reached);
    return make_blocks(*state.grid, reached.origins(),
                       [&](const Coord& origin, Values& values) { carrier.sample(origin, values); });
}

DensityGrid carried_mix(const CarriedGrid& before, const CarriedGrid& after, double fraction,
                        const Boundaries& boundaries) {
    const Carrier from(before, boundaries), to(after, boundaries);
    if ((!from.moves() && !to.moves()) || !(before.grid->placement() == after.grid->placement()) ||
        !(before.grid->extent() == after.grid->extent()) || !(fraction >= 0 && fraction <= 1)) {
        return mix(*before.grid, *after.grid, fraction);
    }
    if (fraction == 0) return carried(before, boundaries);
    if (fraction == 1) return carried(after, boundaries);
    Blocks reached(before.grid->extent());
    from.add_reached(reached);
    to.add_reached(reached);
    const float f = float(fraction);
    const int levels = before.grid->extent().z;
    return make_blocks(*before.grid, reached.origins(), [&](const Coord& origin, Values& values) {
        Values later;
        from.sample(origin, values);
        to.sample(origin, later);
        for (int z = 0; z < std::min(kBlock, levels - origin.z()); ++z) {
            for (int j = 0; j < kBlock; ++j) {
                for (int i = 0; i < kBlock; ++i) {
                    float& value = values[std::size_t(leaf_offset(i, j, z))];
                    const float other = later[std::size_t(leaf_offset(i, j, z))];
                    if (!from.reaches(origin, i, j, z)) {
                        value = other;
                    } else if (to.reaches(origin, i, j, z)) {
                        value += (other - value) * f;
                    }
                }
            }
        }
    });
}

}  // namespace nephos
