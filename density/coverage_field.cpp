// SPDX-License-Identifier: Apache-2.0

// How a CoverageField is made of a grid (detail.h).

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <string>

#include <tbb/parallel_for.h>

#include "core/error.h"
#include "density/detail_kernels.h"
#include "density/detail_scalar.h"
#include "density/metaballs.h"
#include "density/openvdb_access.h"

namespace nephos {
namespace {

namespace text = detail_text;

constexpr int kEdge = CoverageField::kBrickNodes, kCells = CoverageField::kBrickCells;
constexpr double kBumps = 8;      // of size_m on an edge of the large noise
constexpr double kUsualBumps_m = 160;  // of which detail_formulas.h says when they fade
// Tiles of the medium noise in one of the large: 0.6 and 0.8 of it, by which it is turned, are whole, too, so that
// nothing changes when the drift passes a tile.
constexpr float kMediumTiles = 15;
constexpr double kFraction = 0.01;  // of the mass that lies below the base

// Rows that turn places so that the period of the noise shows along no axis.
constexpr double kTurn[3][3] = {{.8, .6, 0}, {-.48, .64, .6}, {.36, -.48, .8}};

void require(bool good, const char* name, double value, const char* expected) {
    if (!good)
        throw Error(ErrorCode::usage, std::string("detail: ") + name + " is " + std::to_string(value) +
                                          ": expected " + expected);
}

bool within(double value, double low, double high) { return value >= low && value <= high; }

std::array<int, 3> unpacked(std::size_t place, const std::array<int, 3>& size) {
    const auto at = int(place);
    return {at % size[0], at / size[0] % size[1], at / size[0] / size[1]};
}

// The size of the largest bumps in cells of an edge.
double bump_size_m(const DetailOptions& options, double cell_m) {
    return options.size_m > 0 ? options.size_m : 4 * cell_m;
}

// Large noise of mean 1 that multiplies densities: hollows and towers between the bumps and the voxels' field.
class Thermals {
  public:
    Thermals(const DetailSetting& setting, double cell_m)
        : strength_(float(setting.options.thermals)),
          drift_m_(setting.drift_m),
          per_m_(1 / (4 * kBumps * bump_size_m(setting.options, cell_m))) {}

    float factor(const Vec3& place) const {
        if (!(strength_ > 0)) return 1;
        const Vec3 p = per_m_ * (place - drift_m_);
        const auto turned = [&](int row) {  // other axes than those of the erosion
            const double tiles = kTurn[row][1] * p.x - kTurn[row][2] * p.y + kTurn[row][0] * p.z;
            return float((tiles - std::floor(tiles)) * kLargeNoiseVoxels);
        };
        return 1 + strength_ * (1 - 2 * scalar_noise(detail_noise().large, kLargeNoiseVoxels, turned(0), turned(1),
                                                     turned(2)));
    }

  private:
    float strength_;
    Vec3 drift_m_;
    double per_m_;
};

// The cells of a grid with thermals, and how much they grow, in blocks of 8 x 8 x 8.
class Cells {
  public:
    Cells(const DensityGrid& grid, const DetailSetting& setting, const DensityGrid* moisture)
        : blocks_(blocks_of(grid)), boundaries_(setting.boundaries), extent_(grid.extent()) {
        std::erase_if(blocks_, [](const Block& block) { return block.positive_count() == 0; });
        const Extent extent = grid.extent();
        const int size[3] = {extent.x, extent.y, extent.z};
        for (std::size_t axis = 0; axis < 3; ++axis) size_[axis] = (size[axis] + kBlock - 1) / kBlock;
        table_.assign(std::size_t(size_[0]) * std::size_t(size_[1]) * std::size_t(size_[2]), -1);
        density_.resize(blocks_.size() * kBlockVoxels);
        if (moisture != nullptr) growth_.resize(density_.size());
        masses_.resize(blocks_.size());
        std::vector<double> moist(blocks_.size(), 0), cloudy(blocks_.size(), 0);
        const Thermals thermals(setting, grid.placement().cell_size_m);
        const Vec3 origin = grid.placement().origin_m;
        const double cell = grid.placement().cell_size_m;
        tbb::parallel_for(std::size_t{0}, blocks_.size(), [&](std::size_t n) {
            const Block& block = blocks_[n];
            table_[index_of(block.origin.x() / kBlock, block.origin.y() / kBlock, block.origin.z() / kBlock)] =
                std::int32_t(n);
            std::optional<openvdb::FloatGrid::ConstAccessor> growing;
            if (moisture != nullptr) growing.emplace(OpenvdbAccess::grid(*moisture).getConstAccessor());
            masses_[n].fill(0);
            for (int v = 0; v < kBlockVoxels; ++v) {
                const openvdb::Coord voxel = block.origin.offsetBy(v & 7, v >> 3 & 7, v >> 6);
                const float q = block.value(leaf_offset(v & 7, v >> 3 & 7, v >> 6));
                if (!(q > 0)) continue;
                masses_[n][std::size_t(v >> 6)] += double(q);
                const std::size_t at = n * kBlockVoxels + std::size_t(v);
                density_[at] = q * thermals.factor(origin + cell * Vec3(voxel.x() + 0.5, voxel.y() + 0.5,
                                                                        voxel.z() + 0.5));
                if (!growing) continue;
                growth_[at] = growing->getValue(voxel);
                moist[n] += double(growth_[at] * density_[at]);
                cloudy[n] += double(density_[at]);
            }
        });
        if (moisture == nullptr) return;
        const double sum = std::accumulate(moist.begin(), moist.end(), 0.0),
                     mass = std::accumulate(cloudy.begin(), cloudy.end(), 0.0);
        const auto per_mean = float(sum > 0 ? mass / sum : 0);
        for (std::size_t n = 0; n < growth_.size(); ++n)
            growth_[n] = density_[n] * (per_mean > 0 ? std::min(growth_[n] * per_mean - 1, 1.0f) : 0.0f);
    }

    const std::vector<Block>& blocks() const { return blocks_; }
    bool grows() const { return !growth_.empty(); }

    // Sums of the grid's own values in each layer of cells.
    std::vector<double> masses() const {
        std::vector<double> result(std::size_t(size_[2]) * kBlock, 0);
        for (std::size_t n = 0; n < blocks_.size(); ++n)
            for (std::size_t z = 0; z < kBlock; ++z)
                result[std::size_t(blocks_[n].origin.z()) + z] += masses_[n][z];
        return result;
    }

    // Copies a cube of cells with its lowest corner at (i, j, k) into rows of `pitch` numbers. Returns false if all
    // are 0; then what was copied is not complete.
    bool copy(const int (&corner)[3], int side, int pitch, float* density, float* growth) const {
        std::fill_n(density, side * side * pitch, 0.0f);
        if (growth != nullptr) std::fill_n(growth, side * side * pitch, 0.0f);
        bool any = false;
        if (crosses_periodic_side(corner, side)) {
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

  private:
    bool crosses_periodic_side(const int (&corner)[3], int side) const {
        const auto crosses = [&](int at, int size, Boundary boundary) {
            return boundary == Boundary::periodic && (at < 0 || at + side > size);
        };
        return crosses(corner[0], extent_.x, boundaries_.x) || crosses(corner[1], extent_.y, boundaries_.y) ||
               crosses(corner[2], extent_.z, boundaries_.z);
    }

    // Index of a cell in density_; -1 where there is none.
    std::ptrdiff_t index_in_blocks(int x, int y, int z) const {
        if (x < 0 || y < 0 || z < 0 || x >= extent_.x || y >= extent_.y || z >= extent_.z) return -1;
        const std::int32_t block = table_[index_of(x / kBlock, y / kBlock, z / kBlock)];
        if (block < 0) return -1;
        return std::ptrdiff_t(block) * kBlockVoxels + ((z % kBlock * kBlock) + y % kBlock) * kBlock + x % kBlock;
    }

    std::size_t index_of(int x, int y, int z) const {
        return (std::size_t(z) * std::size_t(size_[1]) + std::size_t(y)) * std::size_t(size_[0]) + std::size_t(x);
    }

    std::vector<Block> blocks_;
    Boundaries boundaries_;
    Extent extent_;
    std::array<int, 3> size_{};
    std::vector<std::int32_t> table_;
    std::vector<float> density_, growth_;
    std::vector<std::array<double, kBlock>> masses_;
};

// Sums over the cells around the nodes of a brick, a row of nodes of one parity at a time.
class NodeSums {
  public:
    explicit NodeSums(double radius) : reach_(int(std::ceil(radius)) + 1), side_(2 * reach_ + kCells + 1) {
        for (int parity = 0; parity < 8; ++parity) {
            const double at[3] = {0.5 * (parity & 1), 0.5 * (parity >> 1 & 1), 0.5 * (parity >> 2)};
            double sum = 0;
            for (int k = -reach_; k <= reach_; ++k) {
                for (int j = -reach_; j <= reach_; ++j) {
                    for (int i = -reach_; i <= reach_; ++i) {
                        const double x = i + 0.5 - at[0], y = j + 0.5 - at[1], z = k + 0.5 - at[2];
                        const double field = metaball_field(std::sqrt(x * x + y * y + z * z) / radius);
                        if (!(field > 0)) continue;
                        taps_[parity].push_back({(k * side_ + j) * pitch() + i, float(field)});
                        sum += field;
                    }
                }
            }
            for (Tap& tap : taps_[parity]) tap.weight = float(tap.weight / sum);
        }
    }

    int reach() const { return reach_; }
    int side() const { return side_; }                // of the cube of cells that a brick needs
    int pitch() const { return side_ + kRow; }        // of its rows
    std::size_t size() const { return std::size_t(side_ * side_ * pitch()); }

    // Means of the cells around all nodes, x fastest.
    void sum(const float* cells, float* nodes) const {
        for (int parity = 0; parity < 8; ++parity) {
            for (int z = parity >> 2; z < kEdge; z += 2) {
                for (int y = parity >> 1 & 1; y < kEdge; y += 2) {
                    const float* const from =
                        cells + ((z / 2 + reach_) * side_ + y / 2 + reach_) * pitch() + reach_;
                    float row[kRow] = {};
                    for (const Tap& tap : taps_[parity])
                        for (int i = 0; i < kRow; ++i) row[i] += tap.weight * from[tap.offset + i];
                    for (int x = parity & 1; x < kEdge; x += 2) nodes[(z * kEdge + y) * kEdge + x] = row[x / 2];
                }
            }
        }
    }

  private:
    static constexpr int kRow = 8;  // at least kBrickNodes / 2 + 1
    struct Tap {
        int offset;
        float weight;
    };
    int reach_, side_;
    std::vector<Tap> taps_[8];
};

}  // namespace

void check(const DetailOptions& o) {
    require(within(o.strength, 0, 1.4), "strength", o.strength, "0..1.4");
    require(o.size_m == 0 || within(o.size_m, 20, 5000), "size_m", o.size_m, "0 or 20..5000");
    require(within(o.stretch, 1, 50), "stretch", o.stretch, "1..50");
    require(within(o.wisps, 0, 1), "wisps", o.wisps, "0..1");
    require(within(o.thermals, 0, 1), "thermals", o.thermals, "0..1");
    require(o.mean_free_path_m == 0 || within(o.mean_free_path_m, 1, 10000), "mean_free_path_m", o.mean_free_path_m,
            "0 or 1..10000");
}

CoverageField::CoverageField(const DensityGrid& grid, const DetailSetting& setting, const DensityGrid* moisture)
    : extinction_per_m_(setting.extinction_per_m) {
    check(setting.options);
    const double cell = grid.placement().cell_size_m;
    const NodeSums sums(setting.metaball_radius_cells);
    node_m_ = 0.5 * cell;
    const Extent extent = grid.extent();
    const int cells_of[3] = {extent.x, extent.y, extent.z};
    // Whole bricks around all that the metaballs reach.
    const int before = (sums.reach() + kCells - 1) / kCells * kCells;
    corner_m_ = grid.placement().origin_m - Vec3(before * cell);
    for (std::size_t axis = 0; axis < 3; ++axis)
        bricks_[axis] = (cells_of[axis] + 2 * before + kCells - 1) / kCells;
    table_.assign(std::size_t(bricks_[0]) * std::size_t(bricks_[1]) * std::size_t(bricks_[2]), -1);

    const Cells cells(grid, setting, moisture);
    const std::vector<double> masses = cells.masses();
    mass_ = std::accumulate(masses.begin(), masses.end(), 0.0);
    // The base: a hundredth of the cloud lies below it, so that it moves no faster than the cloud.
    double below = 0, base = 0;
    for (std::size_t z = 0; z < masses.size(); ++z) {
        if (below + masses[z] >= kFraction * mass_) {
            base = double(before) + double(z) + (masses[z] > 0 ? (kFraction * mass_ - below) / masses[z] : 0);
            break;
        }
        below += masses[z];
    }
    set_erosion(setting, base * cell);

    // Bricks near blocks with cloud: some of them may hold none.
    std::vector<std::uint8_t> reached(table_.size(), 0);
    const auto reach_around = [&](const openvdb::Coord& origin) {
        int low[3], high[3];
        for (int axis = 0; axis < 3; ++axis) {
            low[axis] = std::max((origin[axis] + before - sums.reach()) / kCells, 0);
            high[axis] = std::min((origin[axis] + before + kBlock + sums.reach()) / kCells,
                                  bricks_[std::size_t(axis)] - 1);
        }
        for (int z = low[2]; z <= high[2]; ++z)
            for (int y = low[1]; y <= high[1]; ++y)
                for (int x = low[0]; x <= high[0]; ++x)
                    reached[(std::size_t(z) * std::size_t(bricks_[1]) + std::size_t(y)) * std::size_t(bricks_[0]) +
                            std::size_t(x)] = 1;
    };
    // Images of blocks beyond periodic sides reach into the lattice, too.
    const auto images = [](Boundary boundary) { return boundary == Boundary::periodic ? 1 : 0; };
    for (const Block& block : cells.blocks())
        for (int k = -images(setting.boundaries.z); k <= images(setting.boundaries.z); ++k)
            for (int j = -images(setting.boundaries.y); j <= images(setting.boundaries.y); ++j)
                for (int i = -images(setting.boundaries.x); i <= images(setting.boundaries.x); ++i)
                    reach_around(block.origin.offsetBy(i * extent.x, j * extent.y, k * extent.z));
    for (std::size_t n = 0; n < table_.size(); ++n)
        if (reached[n] != 0) places_.push_back(std::int32_t(n));
    if (places_.size() > std::size_t(std::numeric_limits<std::int32_t>::max()) / kBrickBytes)
        throw Error(ErrorCode::usage, "detail: a cloud of " + std::to_string(places_.size()) +
                                          " bricks of 8 x 8 x 8 samples is too large: expected at most " +
                                          std::to_string(std::numeric_limits<std::int32_t>::max() / kBrickBytes));

    nodes_.assign(places_.size() * kBrickBytes, 0);
    std::vector<std::array<std::uint16_t, 256>> histograms(places_.size());
    std::vector<std::uint8_t> empty(places_.size(), 0);
    const float half_density = erosion_.half_density;
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, places_.size(), 16), [&](const auto& range) {
        std::vector<float> density(sums.size() + 64), growing(cells.grows() ? density.size() : 0);
        std::array<float, kEdge * kEdge * kEdge> means, growths{};
        for (std::size_t n = range.begin(); n != range.end(); ++n) {
            const auto at = unpacked(std::size_t(places_[n]), bricks_);
            int corner[3];
            for (std::size_t axis = 0; axis < 3; ++axis) corner[axis] = at[axis] * kCells - before - sums.reach();
            if (!cells.copy(corner, sums.side(), sums.pitch(), density.data(),
                            cells.grows() ? growing.data() : nullptr)) {
                empty[n] = 1;
                continue;
            }
            sums.sum(density.data(), means.data());
            if (cells.grows()) sums.sum(growing.data(), growths.data());
            histograms[n].fill(0);
            std::uint8_t* out = &nodes_[n * kBrickBytes];
            for (std::size_t node = 0; node < means.size(); ++node, out += 2) {
                const float d = means[node];
                out[0] = std::uint8_t(255 * (d / (d + half_density)) + 0.5f);
                const float growth_here = d > 0 ? std::clamp(growths[node] / d, -1.0f, 1.0f) : 0.0f;
                out[1] = std::uint8_t(128.5f + 127 * growth_here);
                const std::size_t x = node % kEdge, y = node / kEdge % kEdge, z = node / kEdge / kEdge;
                if (std::max({x, y, z}) < kEdge - 1) ++histograms[n][out[0]];  // the others are the next brick's
            }
        }
    });
    std::size_t kept = 0;
    histogram_.fill(0);
    for (std::size_t n = 0; n < places_.size(); ++n) {
        if (empty[n] != 0) continue;
        for (std::size_t t = 0; t < histogram_.size(); ++t) histogram_[t] += histograms[n][t];
        if (kept != n)
            std::copy_n(nodes_.begin() + std::ptrdiff_t(n * kBrickBytes), kBrickBytes,
                        nodes_.begin() + std::ptrdiff_t(kept * kBrickBytes));
        table_[std::size_t(places_[n])] = std::int32_t(kept);
        places_[kept++] = places_[n];
    }
    places_.resize(kept);
    nodes_.resize(kept * kBrickBytes);
    mass_ *= 8;  // nodes for each cell
    set_erosion(setting, base * cell);
    measure_clearance();
    set_distances();
    const Boundary boundaries[3] = {setting.boundaries.x, setting.boundaries.y, setting.boundaries.z};
    std::array<std::vector<std::uint8_t>, 3> counted;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        counted[axis].assign(std::size_t(bricks_[axis]) * kCells, 1);
        for (int c = 0; boundaries[axis] == Boundary::periodic && c < bricks_[axis] * kCells; ++c)
            if (c < before || c >= before + cells_of[axis]) counted[axis][std::size_t(c)] = 0;
    }
    measure_cells(counted);
}

// The cells are those of the closed form; what they lack of the grid's mass then makes all denser.
void CoverageField::measure_cells(const std::array<std::vector<std::uint8_t>, 3>& counted) {
    constexpr std::size_t kSamples = 2 * kCells, kOfBrick = kCells * kCells * kCells;
    cell_density_.assign(places_.size() * kOfBrick, 0.0f);
    std::vector<double> sums(places_.size(), 0);
    tbb::parallel_for(std::size_t{0}, places_.size(), [&](std::size_t n) {
        std::array<float, kSamples * kSamples * kSamples> samples;
        detailed_density_of_brick(*this, n, samples);
        float* const to = &cell_density_[n * kOfBrick];
        const auto at = unpacked(std::size_t(places_[n]), bricks_);
        const auto is_counted = [&](std::size_t axis, std::size_t sample) {
            return counted[axis][std::size_t(at[axis]) * kCells + sample / 2] != 0;
        };
        for (std::size_t i = 0; i < samples.size(); ++i) {
            const std::size_t x = i % kSamples, y = i / kSamples % kSamples, z = i / kSamples / kSamples;
            to[(z / 2 * kCells + y / 2) * kCells + x / 2] += 0.125f * samples[i];
            if (is_counted(0, x) && is_counted(1, y) && is_counted(2, z)) sums[n] += double(samples[i]);
        }
    });
    const double sum = std::accumulate(sums.begin(), sums.end(), 0.0);
    if (!(sum > 0)) return;
    const auto more = float(std::clamp(mass_ / sum, 0.5, 2.0));
    for (float& gain : erosion_.gain) gain *= more;
    for (float& density : cell_density_) density *= more;
}

// Cells as bits: a row of three bricks' cells along x in a word.
void CoverageField::measure_clearance() {
    std::array<bool, 256> cloud{};
    for (std::size_t t = 0; t < cloud.size(); ++t) cloud[t] = text::coverage_of(float(t) / 255) > kLeastCoverage;
    // Four bits for each row of cells of each brick: a cell may hold cloud when one of its nodes does.
    std::vector<std::array<std::uint8_t, kCells * kCells>> occupied(places_.size());
    tbb::parallel_for(std::size_t{0}, places_.size(), [&](std::size_t n) {
        const std::uint8_t* const nodes = &nodes_[n * kBrickBytes];
        std::array<std::uint16_t, kEdge * kEdge> rows{};  // a bit for each node
        for (std::size_t row = 0; row < rows.size(); ++row)
            for (std::size_t x = 0; x < kEdge; ++x)
                rows[row] = std::uint16_t(rows[row] | (cloud[nodes[2 * (row * kEdge + x)]] ? 1u << x : 0u));
        for (std::size_t cell = 0; cell < kCells * kCells; ++cell) {
            const std::size_t y = cell % kCells, z = cell / kCells;
            unsigned any = 0;
            for (std::size_t m = 0; m < 9; ++m) any |= rows[(2 * z + m / 3) * kEdge + 2 * y + m % 3];
            occupied[n][cell] = 0;
            for (unsigned x = 0; x < kCells; ++x)
                if ((any >> 2 * x & 7u) != 0) occupied[n][cell] = std::uint8_t(occupied[n][cell] | 1u << x);
        }
    });
    clearance_.assign(places_.size() * kCells * kCells * kCells + 3, 0);  // kernels read words
    constexpr int kSide = 3 * kCells;
    using Rows = std::array<std::uint16_t, kSide * kSide>;
    tbb::parallel_for(std::size_t{0}, places_.size(), [&](std::size_t n) {
        const auto at = unpacked(std::size_t(places_[n]), bricks_);
        Rows near{};
        for (int m = 0; m < 27; ++m) {
            const int o[3] = {m % 3, m / 3 % 3, m / 9};
            int b[3];
            bool inside = true;
            for (std::size_t axis = 0; axis < 3; ++axis) {
                b[axis] = at[axis] + o[axis] - 1;
                inside = inside && b[axis] >= 0 && b[axis] < bricks_[axis];
            }
            if (!inside) continue;
            const std::int32_t number =
                table_[(std::size_t(b[2]) * std::size_t(bricks_[1]) + std::size_t(b[1])) * std::size_t(bricks_[0]) +
                       std::size_t(b[0])];
            if (number < 0) continue;
            for (int cell = 0; cell < kCells * kCells; ++cell) {
                std::uint16_t& to =
                    near[std::size_t((o[2] * kCells + cell / kCells) * kSide + o[1] * kCells + cell % kCells)];
                to = std::uint16_t(to | occupied[std::size_t(number)][std::size_t(cell)] << kCells * o[0]);
            }
        }
        std::uint8_t* const out = &clearance_[n * kCells * kCells * kCells];
        std::fill_n(out, kCells * kCells * kCells, std::uint8_t(kCells));
        for (int distance = 0; distance < kCells; ++distance) {
            for (int cell = 0; cell < kCells * kCells * kCells; ++cell) {
                const unsigned row = near[std::size_t((kCells + cell / 16) * kSide + kCells + cell / 4 % 4)];
                if (out[cell] == kCells && (row >> (kCells + cell % 4) & 1u) != 0) out[cell] = std::uint8_t(distance);
            }
            Rows wider = near;
            for (std::uint16_t& row : wider) row = std::uint16_t(row | row << 1 | row >> 1);
            near = wider;
            for (std::size_t i = 0; i < near.size(); ++i) {
                if (i % kSide > 0) near[i] |= wider[i - 1];
                if (i % kSide + 1 < kSide) near[i] |= wider[i + 1];
            }
            wider = near;
            for (std::size_t i = 0; i < near.size(); ++i) {
                if (i >= kSide) near[i] |= wider[i - kSide];
                if (i + kSide < near.size()) near[i] |= wider[i + kSide];
            }
        }
    });
}

void CoverageField::set_distances() {
    std::vector<std::uint8_t> distance(table_.size()), next;
    for (std::size_t n = 0; n < table_.size(); ++n) distance[n] = table_[n] >= 0 ? 0 : 127;
    const std::size_t strides[3] = {1, std::size_t(bricks_[0]), std::size_t(bricks_[0]) * std::size_t(bricks_[1])};
    const int longest = std::min(*std::ranges::max_element(bricks_), 32);
    for (int round = 1; round <= longest; ++round) {
        // A box of 3 x 3 x 3, one axis after the other.
        std::vector<std::uint8_t> least = distance;
        for (std::size_t axis = 0; axis < 3; ++axis) {
            next = least;
            const std::size_t stride = strides[axis], count = std::size_t(bricks_[axis]);
            for (std::size_t i = 0; i < least.size(); ++i) {
                const std::size_t c = i / stride % count;
                if (c > 0) next[i] = std::min(next[i], least[i - stride]);
                if (c + 1 < count) next[i] = std::min(next[i], least[i + stride]);
            }
            least.swap(next);
        }
        bool changed = false;
        for (std::size_t i = 0; i < distance.size(); ++i) {
            if (distance[i] <= least[i] + 1) continue;
            distance[i] = std::uint8_t(least[i] + 1);
            changed = true;
        }
        if (!changed) break;
    }
    for (std::size_t n = 0; n < table_.size(); ++n)
        if (table_[n] < 0) table_[n] = -std::int32_t(std::min<int>(distance[n], longest));
}

// Mass of the field to that of the detailed field with gain 1, in the mean over the noise.
float CoverageField::gain_at(double footprint_m) const {
    // Of detail with usual bumps; the kernels scale theirs.
    const auto footprint = float(footprint_m);
    const float medium = text::medium_width(footprint, erosion_.medium_width), soft = text::edge_softness(footprint);
    const float large = erosion_.top_width, small = std::min(std::sqrt(medium * medium + soft * soft), large);
    double drawn = 0;
    for (std::size_t n = 1; n < histogram_.size(); ++n) {
        const float t = float(n) / 255, c = text::coverage_of(t);
        if (!(c > std::max(0.5f - 0.5f * (large + medium + soft), kLeastCoverage))) continue;
        const float mean = text::density_of(t, erosion_.half_density), fraction = text::cloudy_fraction(c, large, small);
        drawn += histogram_[n] *
                 double(std::min(mean / std::max(fraction, 0.02f), std::max(mean, erosion_.cap)) * fraction);
    }
    return drawn > 0 ? float(std::clamp(mass_ / drawn, 0.5, 4.0)) : 1.0f;
}

void CoverageField::set_erosion(const DetailSetting& setting, double base_m) {
    const DetailOptions& o = setting.options;
    ErosionConstants& e = erosion_;
    // Extinction of zero: nothing shows; any number will do.
    const double extinction = std::max(setting.extinction_per_m, 1e-9);
    const double free_path_m = o.mean_free_path_m > 0 ? o.mean_free_path_m : 1.5 * node_m_;
    // At most a quarter: saturated cells are cloud throughout, however thin.
    e.half_density = float(std::clamp(1 / (2 * extinction * free_path_m), 1e-6, 0.25));
    e.cap = std::min(10 * e.half_density, 1.0f);
    const auto strength = float(o.strength);
    e.base_width = std::max(0.5f * strength, 0.02f);
    e.top_width = std::max(0.62f * strength, 0.02f);
    e.dissolving_width = std::max(0.9f * strength, 0.02f);
    e.medium_width = 0.17f * strength;
    e.fine_width = 0.03f * strength;
    e.wisps = float(o.wisps);
    e.base_m = float(base_m);
    const double size_m = bump_size_m(o, 2 * node_m_), tile = kBumps * size_m;
    const Vec2 along = setting.along;
    for (std::size_t row = 0; row < 3; ++row) {
        const Vec3 turn(kTurn[row][0], kTurn[row][1], kTurn[row][2]);
        // Places are squeezed along the wind before they are turned.
        const double shrink = 1 / o.stretch - 1, of_along = turn.x * along.x + turn.y * along.y;
        const Vec3 to = (turn + Vec3(along * (shrink * of_along), 0.0)) / tile;
        const double offset = glm::dot(to, corner_m_ - setting.drift_m);
        e.to_noise[row] = {float(to.x), float(to.y), float(to.z), float(offset - std::floor(offset))};
    }
    // The offset of the small noises is that of the large one: a whole number of their tiles in one of its.
    e.medium_scale = kMediumTiles;
    e.fine_scale = 128;
    e.medium_per_m = float(kSmallNoiseVoxels / (kBumps * kUsualBumps_m / kMediumTiles));
    e.fine_per_m = float(kSmallNoiseVoxels / (kBumps * kUsualBumps_m / 128));
    e.footprint_scale = float(kUsualBumps_m / size_m);
    e.gain = {1, 1};
    if (mass_ > 0) e.gain = {gain_at(13), gain_at(25)};
}

}  // namespace nephos
