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

constexpr int kTaps = 6, kBefore = 2;         // voxels of the polynomial, and how many lie before the one below
constexpr int kWindow = kBlock + kTaps - 1;   // voxels along an axis that a block of results needs

// One axis of one level: result i lies between the voxels i + base and i + base + 1.
struct AxisShift {
    int base = 0;
    bool whole = true;  // exactly on the first of the two
    std::array<float, kTaps> weights{};
    double shift = 0;
};

AxisShift axis_shift(double shift) {
    AxisShift axis;
    axis.shift = shift;
    const double place = -shift, below = std::floor(place), f = place - below;
    axis.base = int(below);
    axis.whole = f == 0;
    for (int m = 0; m < kTaps; ++m) {
        double weight = 1;
        for (int n = 0; n < kTaps; ++n)
            if (n != m) weight *= (f + kBefore - n) / (m - n);
        axis.weights[std::size_t(m)] = float(weight);
    }
    return axis;
}

using Window = LevelWindow<kWindow>;

// Returns the value between two voxels of a window by its six, limited to the range of the two.
inline float between(const float* taps, std::ptrdiff_t stride, const AxisShift& axis) {
    float sum = 0;
    for (std::size_t m = 0; m < kTaps; ++m) sum += taps[std::ptrdiff_t(m) * stride] * axis.weights[m];
    const float a = taps[kBefore * stride], b = taps[(kBefore + 1) * stride];
    return std::clamp(sum, std::min(a, b), std::max(a, b));
}

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
                throw Error(ErrorCode::usage, "a displacement of " + number_text(along, 6) + " voxels: must be within 2^30");
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
    void add_reached(std::vector<Coord>& origins) const {
        for (const Block& block : blocks_of(density_)) {
            if (block.positive_count() == 0) continue;
            const auto along_x = reached(block.origin.x(), block.origin.z(), x_, extent_.x, boundaries_.x),
                       along_y = reached(block.origin.y(), block.origin.z(), y_, extent_.y, boundaries_.y);
            for (const int y : along_y)
                for (const int x : along_x) origins.emplace_back(x, y, block.origin.z());
        }
    }

    // Whether the state reaches voxel `at` of a level along an axis; an open side extends by one voxel.
    bool reaches_x(int k, int at) const { return reaches(x_[std::size_t(k)], at, extent_.x, boundaries_.x); }
    bool reaches_y(int k, int at) const { return reaches(y_[std::size_t(k)], at, extent_.y, boundaries_.y); }

    // Writes the values of a block's level, x fastest; 0 where the state does not reach.
    void sample(const Coord& origin, int k, std::array<float, kBlock * kBlock>& out) const {
        const AxisShift &x = x_[std::size_t(k)], &y = y_[std::size_t(k)];
        Window window;
        if (!gather(origin, k, window)) {
            out.fill(0);
            return;
        }
        std::array<std::array<float, kBlock>, kWindow> rows;
        for (std::size_t j = 0; j < kWindow; ++j) {
            for (std::size_t i = 0; i < kBlock; ++i)
                rows[j][i] = x.whole ? window[j][i + kBefore] : between(&window[j][i], 1, x);
        }
        for (int j = 0; j < kBlock; ++j) {
            const bool row = reaches_y(k, origin.y() + j);
            for (int i = 0; i < kBlock; ++i) {
                const float* first = &rows[std::size_t(j)][std::size_t(i)];
                const float value = y.whole ? first[kBefore * kBlock] : between(first, kBlock, y);
                out[std::size_t(j * kBlock + i)] = row && reaches_x(k, origin.x() + i) ? value : 0.0f;
            }
        }
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
        for (std::size_t k = std::size_t(level); k < std::min(shifts.size(), std::size_t(level + kBlock)); ++k) {
            least = std::min(least, shifts[k].shift);
            most = std::max(most, shifts[k].shift);
        }
        const int last_of_block = std::min(origin + kBlock, voxels) - 1;
        // Outermost voxels of an open side reach one further.
        const int first = int(std::floor(origin + least)) - 1, last = int(std::ceil(last_of_block + most)) + 1;
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

    // Reads the voxels that a block of results needs of a level; false when all are 0.
    bool gather(const Coord& origin, int k, Window& window) const {
        const WindowAxis<kWindow> x(origin.x() + x_[std::size_t(k)].base - kBefore, extent_.x, boundaries_.x),
            y(origin.y() + y_[std::size_t(k)].base - kBefore, extent_.y, boundaries_.y);
        const int z = k & ~(kBlock - 1);
        const WindowLeaves<kWindow> leaves(grid_.tree(), x, y, z);
        if (leaves.any()) leaves.read(k - z, window);
        return leaves.any();
    }

    const DensityGrid& density_;
    const FloatGrid& grid_;
    const Extent extent_;
    const Boundaries boundaries_;
    std::vector<AxisShift> x_, y_;  // of each level
};

// Computes all blocks; level(origin, k, values) writes one level of a block.
template <typename Level>
DensityGrid make_blocks(const DensityGrid& like, std::vector<Coord> origins, const Level& level) {
    const auto before = [](const Coord& a, const Coord& b) { return block_order(a) < block_order(b); };
    std::sort(origins.begin(), origins.end(), before);
    origins.erase(std::unique(origins.begin(), origins.end()), origins.end());
    const Extent extent = like.extent();
    std::vector<NewBlock> blocks(origins.size());
    tbb::parallel_for(std::size_t{0}, origins.size(), [&](std::size_t n) {
        const Coord& origin = origins[n];
        auto leaf = uninitialised_leaf(origin);
        float* out = leaf->buffer().data();
        std::fill_n(out, kBlockVoxels, 0.0f);
        const int nx = std::min(kBlock, extent.x - origin.x()), ny = std::min(kBlock, extent.y - origin.y()),
                  nz = std::min(kBlock, extent.z - origin.z());
        std::array<float, kBlock * kBlock> values;
        for (int z = 0; z < nz; ++z) {
            level(origin, origin.z() + z, values);
            for (int y = 0; y < ny; ++y)
                for (int x = 0; x < nx; ++x) out[leaf_offset(x, y, z)] = values[std::size_t(y * kBlock + x)];
        }
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
    std::vector<Coord> origins;
    carrier.add_reached(origins);
    return make_blocks(*state.grid, std::move(origins),
                       [&](const Coord& origin, int k, std::array<float, kBlock * kBlock>& values) {
                           carrier.sample(origin, k, values);
                       });
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
    std::vector<Coord> origins;
    from.add_reached(origins);
    to.add_reached(origins);
    const float f = float(fraction);
    return make_blocks(*before.grid, std::move(origins),
                       [&](const Coord& origin, int k, std::array<float, kBlock * kBlock>& values) {
                           std::array<float, kBlock * kBlock> later;
                           from.sample(origin, k, values);
                           to.sample(origin, k, later);
                           for (int n = 0; n < kBlock * kBlock; ++n) {
                               const int x = origin.x() + n % kBlock, y = origin.y() + n / kBlock;
                               float& value = values[std::size_t(n)];
                               const float other = later[std::size_t(n)];
                               if (!from.reaches_x(k, x) || !from.reaches_y(k, y)) {
                                   value = other;
                               } else if (to.reaches_x(k, x) && to.reaches_y(k, y)) {
                                   value += (other - value) * f;
                               }
                           }
                       });
}

}  // namespace nephos
