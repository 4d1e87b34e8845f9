// SPDX-License-Identifier: Apache-2.0
#include "density/coverage_cells.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include <tbb/parallel_for.h>

#include "density/detail_noise.h"
#include "density/detail_scalar.h"

namespace nephos {
namespace {

// Whole numbers of periods near those of an edge, with the cost of their distance: not all 0.
struct Periods {
    Vec3 whole{};
    double cost = 0;
};

std::vector<Periods> periods_near(const Vec3& exact) {
    std::vector<Periods> result;
    const double squared = glm::dot(exact, exact);
    for (int n = 0; n < 27; ++n) {
        const Vec3 whole = glm::round(exact) + Vec3(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1), apart = whole - exact;
        if (glm::dot(whole, whole) > 0) result.push_back({whole, glm::dot(apart, apart) / squared});
    }
    return result;
}

// Large noise of mean 1 that multiplies densities: hollows and towers between the bumps and the voxels' field.
class Thermals {
  public:
    Thermals(const DetailSetting& setting, const Extent& extent, double cell_m)
        : strength_(float(setting.options.thermals)), drift_m_(setting.drift_m) {
        const double per_m = 1 / (4 * kBumpsOfTile * bump_size_m(setting.options, cell_m));
        for (std::size_t row = 0; row < 3; ++row)  // other axes than those of the erosion
            rows_[row] = per_m * Vec3(kNoiseTurn[row][1], -kNoiseTurn[row][2], kNoiseTurn[row][0]);
        rows_ = repeating(rows_, setting.boundaries, extent, cell_m);
    }

    float factor(const Vec3& place) const {
        if (!(strength_ > 0)) return 1;
        const auto turned = [&](std::size_t row) {
            const double tiles = glm::dot(rows_[row], place - drift_m_);
            return float((tiles - std::floor(tiles)) * kLargeNoiseVoxels);
        };
        return 1 + strength_ * (1 - 2 * scalar_noise(detail_noise().large, kLargeNoiseVoxels, turned(0), turned(1),
                                                     turned(2)));
    }

  private:
    float strength_;
    Vec3 drift_m_;
    std::array<Vec3, 3> rows_;
};

// The part of a cell's cloud that is left, by its place between two open sides.
float apron_at(int cell, int count, Boundary boundary, int apron_cells) {
    if (boundary == Boundary::periodic || apron_cells == 0) return 1;
    const double in = std::min({1.0, (cell + 0.5) / apron_cells, (count - cell - 0.5) / apron_cells});
    return float(in * in * (3 - 2 * in));
}

}  // namespace

std::array<Vec3, 3> repeating(const std::array<Vec3, 3>& rows, const Boundaries& boundaries, const Extent& extent,
                              double cell_m) {
    const double edges_m[2] = {boundaries.x == Boundary::periodic ? cell_m * extent.x : 0,
                               boundaries.y == Boundary::periodic ? cell_m * extent.y : 0};
    std::vector<Periods> along[2];
    for (int axis = 0; axis < 2; ++axis)
        along[axis] = edges_m[axis] > 0
                          ? periods_near(edges_m[axis] * Vec3(rows[0][axis], rows[1][axis], rows[2][axis]))
                          : std::vector<Periods>{{Vec3(rows[0][axis], rows[1][axis], rows[2][axis]), 0}};
    // The nearest that are not nearly parallel.
    const auto cheaper = [](const Periods& a, const Periods& b) { return a.cost < b.cost; };
    const Periods *best_x = &*std::ranges::min_element(along[0], cheaper),
                  *best_y = &*std::ranges::min_element(along[1], cheaper);
    double least = std::numeric_limits<double>::infinity();
    for (const Periods& x : along[0]) {
        for (const Periods& y : along[1]) {
            const Vec3 across = glm::cross(x.whole, y.whole);
            const double sine_squared =
                glm::dot(across, across) / (glm::dot(x.whole, x.whole) * glm::dot(y.whole, y.whole));
            if (sine_squared < 0.25 || x.cost + y.cost >= least) continue;
            least = x.cost + y.cost;
            best_x = &x;
            best_y = &y;
        }
    }
    std::array<Vec3, 3> result = rows;
    for (int row = 0; row < 3; ++row) {
        if (edges_m[0] > 0) result[std::size_t(row)].x = best_x->whole[row] / edges_m[0];
        if (edges_m[1] > 0) result[std::size_t(row)].y = best_y->whole[row] / edges_m[1];
    }
    return result;
}

CoverageCells::CoverageCells(const DensityGrid& grid, const DetailSetting& setting, const DensityGrid* moisture)
    : blocks_(blocks_of(grid)), boundaries_(setting.images ? setting.boundaries : Boundaries{}), extent_(grid.extent()) {
    std::erase_if(blocks_, [](const Block& block) { return block.positive_count() == 0; });
    const Extent extent = grid.extent();
    const int size[3] = {extent.x, extent.y, extent.z};
    for (std::size_t axis = 0; axis < 3; ++axis) size_[axis] = (size[axis] + kBlock - 1) / kBlock;
    table_.assign(std::size_t(size_[0]) * std::size_t(size_[1]) * std::size_t(size_[2]), -1);
    density_.resize(blocks_.size() * kBlockVoxels);
    if (moisture != nullptr) growth_.resize(density_.size());
    masses_.resize(blocks_.size());
    squares_.assign(blocks_.size(), 0);
    boxes_.resize(blocks_.size(), {{extent.x, extent.y, extent.z}, {-1, -1, -1}});
    std::vector<double> moist(blocks_.size(), 0), cloudy(blocks_.size(), 0);
    const Thermals thermals(setting, extent, grid.placement().cell_size_m);
    // Without images a side beside an open one is open, too.
    const bool soft = !setting.images && (setting.boundaries.x == Boundary::open) != (setting.boundaries.y == Boundary::open);
    const Boundaries sides = soft ? Boundaries{} : setting.boundaries;
    std::vector<float> aprons[2];
    for (int i = 0; i < size_[0] * kBlock; ++i)
        aprons[0].push_back(apron_at(i, extent.x, sides.x, setting.options.apron_cells));
    for (int j = 0; j < size_[1] * kBlock; ++j)
        aprons[1].push_back(apron_at(j, extent.y, sides.y, setting.options.apron_cells));
    const Vec3 origin = grid.placement().origin_m;
    const double cell = grid.placement().cell_size_m;
    tbb::parallel_for(std::size_t{0}, blocks_.size(), [&](std::size_t n) {
        const Block& block = blocks_[n];
        table_[index_of(block.origin.x() / kBlock, block.origin.y() / kBlock, block.origin.z() / kBlock)] =
            std::int32_t(n);
        Block growing;
        if (moisture != nullptr) {
            const auto accessor = OpenvdbAccess::grid(*moisture).getConstAccessor();
            growing = {block.origin, accessor.probeConstLeaf(block.origin), accessor.getValue(block.origin)};
        }
        masses_[n].fill(0);
        std::array<double, 8> of_cubes{};
        for (int v = 0; v < kBlockVoxels; ++v) {
            const openvdb::Coord voxel = block.origin.offsetBy(v & 7, v >> 3 & 7, v >> 6);
            const float inside = aprons[0][std::size_t(voxel.x())] * aprons[1][std::size_t(voxel.y())];
            const float q = inside * block.value(leaf_offset(v & 7, v >> 3 & 7, v >> 6));
            if (!(q > 0)) continue;
            masses_[n][std::size_t(v >> 6)] += double(q);
            of_cubes[std::size_t((v >> 2 & 1) | (v >> 5 & 1) << 1 | v >> 8 << 2)] += double(q);
            for (int axis = 0; axis < 3; ++axis) {
                boxes_[n].min[std::size_t(axis)] = std::min(boxes_[n].min[std::size_t(axis)], voxel[axis]);
                boxes_[n].max[std::size_t(axis)] = std::max(boxes_[n].max[std::size_t(axis)], voxel[axis]);
            }
            const std::size_t at = n * kBlockVoxels + std::size_t(v);
            density_[at] = q * thermals.factor(origin + cell * Vec3(voxel.x() + 0.5, voxel.y() + 0.5,
                                                                    voxel.z() + 0.5));
            if (moisture == nullptr) continue;
            growth_[at] = growing.value(leaf_offset(v & 7, v >> 3 & 7, v >> 6));
            moist[n] += double(growth_[at] * density_[at]);
            cloudy[n] += double(density_[at]);
        }
        for (const double mass : of_cubes) squares_[n] += mass * mass / 64;
    });
    if (moisture == nullptr) return;
    const double sum = std::accumulate(moist.begin(), moist.end(), 0.0),
                 mass = std::accumulate(cloudy.begin(), cloudy.end(), 0.0);
    const auto per_mean = float(sum > 0 ? mass / sum : 0);
    for (std::size_t n = 0; n < growth_.size(); ++n)
        growth_[n] = density_[n] * (per_mean > 0 ? std::min(growth_[n] * per_mean - 1, 1.0f) : 0.0f);
}

std::vector<double> CoverageCells::masses() const {
    std::vector<double> result(std::size_t(size_[2]) * kBlock, 0);
    for (std::size_t n = 0; n < blocks_.size(); ++n)
        for (std::size_t z = 0; z < kBlock; ++z)
            result[std::size_t(blocks_[n].origin.z()) + z] += masses_[n][z];
    return result;
}

double CoverageCells::mean_density() const {
    double mass = 0, squares = 0;
    for (std::size_t n = 0; n < blocks_.size(); ++n) {
        mass = std::accumulate(masses_[n].begin(), masses_[n].end(), mass);
        squares += squares_[n];
    }
    return mass > 0 ? squares / mass : 0;
}

bool CoverageCells::copy_images(const int (&corner)[3], int side, int pitch, float* density, float* growth) const {
    bool any = false;
    for (int z = 0; z < side; ++z) {
        for (int y = 0; y < side; ++y) {
            for (int x = 0; x < side; ++x) {
                const std::ptrdiff_t from = index_in_blocks(repeated(corner[0] + x, extent_.x, boundaries_.x),
                                                            repeated(corner[1] + y, extent_.y, boundaries_.y),
                                                            repeated(corner[2] + z, extent_.z, boundaries_.z));
                if (from < 0) continue;
                const int to = (z * side + y) * pitch + x;
                density[to] = density_[std::size_t(from)];
                any = any || density[to] > 0;
                if (growth != nullptr) growth[to] = growth_[std::size_t(from)];
            }
        }
    }
    return any;
}

bool CoverageCells::copy(const int (&corner)[3], int side, int pitch, float* density, float* growth) const {
    std::fill_n(density, side * side * pitch, 0.0f);
    if (growth != nullptr) std::fill_n(growth, side * side * pitch, 0.0f);
    if (crosses_periodic_side(corner, side)) return copy_images(corner, side, pitch, density, growth);
    bool any = false;
    const auto first = [&](std::size_t axis) { return std::max(corner[axis], 0) / kBlock; };
    const auto end = [&](std::size_t axis) {
        return std::min((corner[axis] + side - 1 + kBlock) / kBlock, size_[axis]);
    };
    for (int bz = first(2); bz < end(2); ++bz) {
        for (int by = first(1); by < end(1); ++by) {
            for (int bx = first(0); bx < end(0); ++bx) {
                const std::int32_t number = table_[index_of(bx, by, bz)];
                if (number < 0) continue;
                const int low[3] = {bx * kBlock - corner[0], by * kBlock - corner[1], bz * kBlock - corner[2]};
                const auto begins = [&](int axis) { return std::max(low[axis], 0); };
                const auto ends = [&](int axis) { return std::min(low[axis] + kBlock, side); };
                for (int z = begins(2); z < ends(2); ++z) {
                    for (int y = begins(1); y < ends(1); ++y) {
                        const std::size_t from = std::size_t(number) * kBlockVoxels +
                                                 std::size_t(((z - low[2]) * kBlock + y - low[1]) * kBlock);
                        const int to = (z * side + y) * pitch;
                        for (int x = begins(0); x < ends(0); ++x) {
                            density[to + x] = density_[from + std::size_t(x - low[0])];
                            any = any || density[to + x] > 0;
                            if (growth != nullptr) growth[to + x] = growth_[from + std::size_t(x - low[0])];
                        }
                    }
                }
            }
        }
    }
    return any;
}

bool CoverageCells::crosses_periodic_side(const int (&corner)[3], int side) const {
    const auto crosses = [&](int at, int size, Boundary boundary) {
        return boundary == Boundary::periodic && (at < 0 || at + side > size);
    };
    return crosses(corner[0], extent_.x, boundaries_.x) || crosses(corner[1], extent_.y, boundaries_.y) ||
           crosses(corner[2], extent_.z, boundaries_.z);
}

std::ptrdiff_t CoverageCells::index_in_blocks(int x, int y, int z) const {
    if (x < 0 || y < 0 || z < 0 || x >= extent_.x || y >= extent_.y || z >= extent_.z) return -1;
    const std::int32_t block = table_[index_of(x / kBlock, y / kBlock, z / kBlock)];
    if (block < 0) return -1;
    return std::ptrdiff_t(block) * kBlockVoxels + ((z % kBlock * kBlock) + y % kBlock) * kBlock + x % kBlock;
}

std::size_t CoverageCells::index_of(int x, int y, int z) const {
    return (std::size_t(z) * std::size_t(size_[1]) + std::size_t(y)) * std::size_t(size_[0]) + std::size_t(x);
}

}  // namespace nephos
