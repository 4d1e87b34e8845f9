// SPDX-License-Identifier: Apache-2.0
#include "density/detail.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <span>
#include <string>

#include <tbb/parallel_for.h>

#include "core/error.h"
#include "density/detail_kernels.h"
#include "density/metaballs.h"
#include "density/openvdb_access.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "density/detail.cpp"
#include <hwy/foreach_target.h>
// foreach_target.h must come first
#include <hwy/highway.h>

#include "density/detail-inl.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {

constexpr std::size_t kMaxLanes = 16;

// Detailed density at `count` places relative to the field's corner, whose brick, x, y and z in it (nodes) and x, y, z
// in metres are given. Up to kMaxLanes numbers behind those of the places are read.
void sample_places(const DetailKernel& field, std::int32_t brick, const float* const (&local)[3],
                   const float* const (&place)[3], std::size_t count, float footprint, float* out) {
    using namespace erosion;
    const Lanes d;
    const std::size_t lanes = hn::Lanes(d);
    HWY_ALIGN float results[kMaxLanes];
    for (std::size_t n = 0; n < count; n += lanes) {
        const std::size_t some = std::min(lanes, count - n);
        const auto load = [&](const float* from) { return hn::LoadU(d, from + n); };
        const Node node = node_at(field, integer(brick), load(local[0]), load(local[1]), load(local[2]));
        const Eroded result = eroded(field, node, load(place[0]), load(place[1]), load(place[2]),
                                     number(footprint), hn::FirstN(d, some));
        hn::Store(result.density, d, results);
        std::copy_n(results, some, out + n);
    }
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace nephos {

HWY_EXPORT(sample_places);

namespace {

namespace text {
#define NEPHOS_FUNCTION inline
using Real = float;
inline float min(float a, float b) { return b < a ? b : a; }
inline float max(float a, float b) { return a < b ? b : a; }
inline float mul_add(float a, float b, float c) { return a * b + c; }
inline float select(bool condition, float a, float b) { return condition ? a : b; }
#include "density/detail_formulas.h"
#undef NEPHOS_FUNCTION
}  // namespace text

constexpr int kEdge = CoverageField::kBrickNodes, kCells = CoverageField::kBrickCells, kNodes = kEdge * kEdge * kEdge;
constexpr std::size_t kLanesBehind = 16;  // that sample_places() reads
constexpr double kPeriod = 8;  // tiles of the large noise in size_m * ...: bumps of 16 voxels of 128

// Rotates without a common axis, so that the tile's period shows along none: rows of the large noise.
constexpr double kTurn[3][3] = {{.8, .6, 0}, {-.48, .64, .6}, {.36, -.48, .8}};

void require(bool good, const char* name, double value, const char* expected) {
    if (!good)
        throw Error(ErrorCode::usage, std::string("detail: ") + name + " is " + std::to_string(value) +
                                          ": expected " + expected);
}

bool within(double value, double low, double high) { return value >= low && value <= high; }

// Gradually from one value of the small noise to the next; place in voxels.
float scalar_noise(std::span<const std::uint32_t> words, int edge, float x, float y, float z) {
    const float at[3] = {x - 0.5f, y - 0.5f, z - 0.5f};
    int whole[3];
    float rest[3];
    for (int n = 0; n < 3; ++n) {
        const float below = std::floor(at[n]);
        rest[n] = at[n] - below;
        whole[n] = int(below) & (edge - 1);
    }
    const auto plane = [&](int k) {
        const std::uint32_t word =
            words[(std::size_t(k & (edge - 1)) * std::size_t(edge) + std::size_t(whole[1])) * std::size_t(edge) +
                  std::size_t(whole[0])];
        const auto byte = [word](int shift) { return float(word >> shift & 255); };
        const float low = byte(0) + rest[0] * (byte(8) - byte(0)), high = byte(16) + rest[0] * (byte(24) - byte(16));
        return low + rest[1] * (high - low);
    };
    const float low = plane(whole[2]), high = plane(whole[2] + 1);
    return (low + rest[2] * (high - low)) / 255.0f;
}

float scalar_small_noise(float level, float x, float y, float z) {
    const int below = std::min(int(level), 2);
    const auto at = [&](int l) {
        const float scale = 1.0f / float(1 << l);
        return scalar_noise(std::span(detail_noise().small).subspan(first_of_level(l)), kSmallNoiseVoxels >> l,
                            x * scale, y * scale, z * scale);
    };
    const float fine = at(below);
    return fine + (level - float(below)) * (at(below + 1) - fine);
}

// Multiplies a density by large noise of mean 1: hollows and towers between the bumps and the voxels' field.
class Thermals {
  public:
    Thermals(const DetailSetting& setting) : setting_(setting), per_m_(1 / (4 * kPeriod * setting.options.size_m)) {}

    float factor(const Vec3& place) const {
        if (!(setting_.options.thermals > 0)) return 1;
        const Vec3 p = per_m_ * (place - setting_.drift_m);
        const auto turned = [&](int row) {  // other axes than those of the erosion
            const double tiles = kTurn[row][1] * p.x - kTurn[row][2] * p.y + kTurn[row][0] * p.z;
            return float((tiles - std::floor(tiles)) * kLargeNoiseVoxels);
        };
        const float noise =
            scalar_noise(detail_noise().large, kLargeNoiseVoxels, turned(0), turned(1), turned(2));
        return 1 + float(setting_.options.thermals) * (1 - 2 * noise);
    }

  private:
    const DetailSetting& setting_;
    double per_m_;
};

// The cells in reach of a node with an even or odd number on each axis, with their fields.
struct NodeTaps {
    struct Tap {
        int i, j, k;  // from the cell above the node
        float weight;
    };
    std::vector<Tap> taps[8];

    explicit NodeTaps(double radius) {
        const int reach = int(std::ceil(radius)) + 1;
        for (int phase = 0; phase < 8; ++phase) {
            const double at[3] = {0.5 * (phase & 1), 0.5 * (phase >> 1 & 1), 0.5 * (phase >> 2)};
            double sum = 0;
            for (int k = -reach; k <= reach; ++k) {
                for (int j = -reach; j <= reach; ++j) {
                    for (int i = -reach; i <= reach; ++i) {
                        const double x = i + 0.5 - at[0], y = j + 0.5 - at[1], z = k + 0.5 - at[2];
                        const double field = metaball_field(std::sqrt(x * x + y * y + z * z) / radius);
                        if (!(field > 0)) continue;
                        taps[phase].push_back({i, j, k, float(field)});
                        sum += field;
                    }
                }
            }
            for (Tap& tap : taps[phase]) tap.weight = float(tap.weight / sum);
        }
    }
};

std::array<int, 3> unpacked(std::int32_t place, const std::array<int, 3>& size) {
    return {place % size[0], place / size[0] % size[1], place / size[0] / size[1]};
}

// Values of a cube of cells around a brick.
struct CellCube {
    int side;
    std::vector<float> density, growth;
    bool any = false;
    std::size_t index(int i, int j, int k) const {
        return (std::size_t(k) * std::size_t(side) + std::size_t(j)) * std::size_t(side) + std::size_t(i);
    }
};

}  // namespace

DetailKernel::DetailKernel(const CoverageField& field)
    : nodes(field.nodes().data()),
      table(field.table().data()),
      clearance(field.clearance().data()),
      large_noise(detail_noise().large.data()),
      small_noise(detail_noise().small.data()),
      erosion(&field.erosion()),
      bricks(field.bricks()),
      node_m(float(field.node_m())),
      extinction_per_m(float(field.extinction_per_m())),
      corner_m{field.corner_m().x, field.corner_m().y, field.corner_m().z} {}

void check(const DetailOptions& o) {
    require(within(o.strength, 0, 1.4), "strength", o.strength, "0..1.4");
    require(within(o.size_m, 20, 5000), "size_m", o.size_m, "20..5000");
    require(within(o.stretch, 1, 50), "stretch", o.stretch, "1..50");
    require(within(o.wisps, 0, 1), "wisps", o.wisps, "0..1");
    require(within(o.thermals, 0, 1), "thermals", o.thermals, "0..1");
    require(within(o.mean_free_path_m, 1, 10000), "mean_free_path_m", o.mean_free_path_m, "1..10000");
}

CoverageField::CoverageField(const DensityGrid& grid, const DetailSetting& setting, const DensityGrid* growth)
    : extinction_per_m_(setting.extinction_per_m) {
    check(setting.options);
    const double radius = setting.metaball_radius_cells, cell = grid.placement().cell_size_m;
    const NodeTaps taps(radius);
    const int reach = int(std::ceil(radius)) + 1;
    node_m_ = 0.5 * cell;
    const Extent extent = grid.extent();
    const int cells[3] = {extent.x, extent.y, extent.z};
    // Whole bricks around all that the metaballs reach.
    const int before = (reach + kCells - 1) / kCells * kCells;
    corner_m_ = grid.placement().origin_m - Vec3(before * cell);
    for (std::size_t axis = 0; axis < 3; ++axis)
        bricks_[axis] = (cells[axis] + 2 * before + kCells - 1) / kCells;
    table_.assign(std::size_t(bricks_[0]) * std::size_t(bricks_[1]) * std::size_t(bricks_[2]), -1);
    find_bricks(grid, reach);
    if (places_.size() > std::size_t(std::numeric_limits<std::int32_t>::max()) / kBrickBytes)
        throw Error(ErrorCode::usage, "detail: a cloud of " + std::to_string(places_.size()) +
                                          " bricks of 8 x 8 x 8 samples is too large: expected at most " +
                                          std::to_string(std::numeric_limits<std::int32_t>::max() / kBrickBytes));

    set_erosion(setting, 0);  // for half_density
    const float half_density = erosion_.half_density;
    const Thermals thermals(setting);
    nodes_.assign(places_.size() * kBrickBytes, 0);
    clearance_.assign(places_.size() * kCells * kCells * kCells, 0);
    const auto& tree = OpenvdbAccess::grid(grid);
    std::vector<std::array<double, 256>> histograms(places_.size());
    std::vector<double> masses(places_.size());
    std::vector<std::vector<double>> by_height(places_.size());
    tbb::parallel_for(std::size_t{0}, places_.size(), [&](std::size_t n) {
        const auto at = unpacked(places_[n], bricks_);
        auto voxels = tree.getConstAccessor();
        std::optional<openvdb::FloatGrid::ConstAccessor> growing;
        if (growth != nullptr) growing.emplace(OpenvdbAccess::grid(*growth).getConstAccessor());
        CellCube cube{2 * reach + kCells + 1, {}, {}, false};
        const int first[3] = {at[0] * kCells - before - reach, at[1] * kCells - before - reach,
                              at[2] * kCells - before - reach};
        std::vector<double> plain;  // without thermals
        for (int k = 0; k < cube.side; ++k) {
            for (int j = 0; j < cube.side; ++j) {
                for (int i = 0; i < cube.side; ++i) {
                    const openvdb::Coord voxel(first[0] + i, first[1] + j, first[2] + k);
                    float q = voxels.getValue(voxel);
                    plain.push_back(double(q));
                    if (q > 0) {
                        const Vec3 middle = grid.placement().origin_m +
                                            cell * Vec3(voxel.x() + 0.5, voxel.y() + 0.5, voxel.z() + 0.5);
                        q *= thermals.factor(middle);
                    }
                    cube.density.push_back(q);
                    cube.growth.push_back(growing && q > 0 ? q * (2 * growing->getValue(voxel) - 1) : 0.0f);
                }
            }
        }
        std::uint8_t* out = &nodes_[n * kBrickBytes];
        histograms[n].fill(0);
        by_height[n].assign(std::size_t(kEdge), 0);
        for (int node = 0; node < kNodes; ++node, out += 2) {
            const int x = node % kEdge, y = node / kEdge % kEdge, z = node / kEdge / kEdge;
            const int phase = (x & 1) | (y & 1) << 1 | (z & 1) << 2;
            float density = 0, growths = 0;
            double without = 0;
            for (const NodeTaps::Tap& tap : taps.taps[phase]) {
                const std::size_t cell_at =
                    cube.index(x / 2 + reach + tap.i, y / 2 + reach + tap.j, z / 2 + reach + tap.k);
                density += tap.weight * cube.density[cell_at];
                growths += tap.weight * cube.growth[cell_at];
                without += double(tap.weight) * plain[cell_at];
            }
            const float t = density / (density + half_density);
            out[0] = std::uint8_t(255 * t + 0.5f);
            out[1] = std::uint8_t(128.5f + 127 * (density > 0 ? std::clamp(growths / density, -1.0f, 1.0f) : 0.0f));
            if (x == kEdge - 1 || y == kEdge - 1 || z == kEdge - 1) continue;  // the next brick's
            histograms[n][out[0]] += 1;
            masses[n] += without;
            by_height[n][std::size_t(z)] += without;
        }
    });
    histogram_.fill(0);
    std::vector<double> levels(std::size_t(bricks_[2]) * (kEdge - 1), 0);
    for (std::size_t n = 0; n < places_.size(); ++n) {
        for (std::size_t t = 0; t < histogram_.size(); ++t) histogram_[t] += histograms[n][t];
        mass_ += masses[n];
        const std::size_t low = std::size_t(unpacked(places_[n], bricks_)[2]) * (kEdge - 1);
        for (std::size_t z = 0; z + 1 < std::size_t(kEdge); ++z) levels[low + z] += by_height[n][z];
    }
    // The base: a hundredth of the cloud lies below it. It moves no faster than the cloud.
    double below = 0, base = 0;
    for (std::size_t z = 0; z < levels.size(); ++z) {
        if (below + levels[z] >= 0.01 * mass_) {
            base = (double(z) + (levels[z] > 0 ? (0.01 * mass_ - below) / levels[z] : 0.0)) * node_m_;
            break;
        }
        below += levels[z];
    }
    set_erosion(setting, base);
    measure_clearance();
    set_distances();
}

void CoverageField::find_bricks(const DensityGrid& grid, int reach) {
    const int before = (reach + kCells - 1) / kCells * kCells;
    std::vector<std::uint8_t> reached(table_.size(), 0);
    for (const Block& block : blocks_of(grid)) {
        if (block.positive_count() == 0) continue;
        int low[3], high[3];
        for (int axis = 0; axis < 3; ++axis) {
            low[axis] = std::max((block.origin[axis] + before - reach) / kCells, 0);
            high[axis] = std::min((block.origin[axis] + before + kBlock + reach) / kCells,
                                  bricks_[std::size_t(axis)] - 1);
        }
        for (int z = low[2]; z <= high[2]; ++z)
            for (int y = low[1]; y <= high[1]; ++y)
                for (int x = low[0]; x <= high[0]; ++x)
                    reached[(std::size_t(z) * std::size_t(bricks_[1]) + std::size_t(y)) * std::size_t(bricks_[0]) +
                            std::size_t(x)] = 1;
    }
    // Of the blocks' surroundings only those bricks that a cell with cloud reaches, or nearly: light is looked up
    // some metres beyond the cloud.
    std::vector<std::uint8_t> holds(table_.size(), 0);
    const auto& tree = OpenvdbAccess::grid(grid);
    tbb::parallel_for(std::size_t{0}, table_.size(), [&](std::size_t n) {
        if (reached[n] == 0) return;
        const auto at = unpacked(std::int32_t(n), bricks_);
        auto voxels = tree.getConstAccessor();
        const int first[3] = {at[0] * kCells - before, at[1] * kCells - before, at[2] * kCells - before};
        for (int k = first[2] - reach; k < first[2] + kCells + reach; ++k)
            for (int j = first[1] - reach; j < first[1] + kCells + reach; ++j)
                for (int i = first[0] - reach; i < first[0] + kCells + reach; ++i)
                    if (voxels.getValue({i, j, k}) > 0) {
                        holds[n] = 1;
                        return;
                    }
    });
    for (std::size_t n = 0; n < table_.size(); ++n) {
        if (holds[n] == 0) continue;
        table_[n] = std::int32_t(places_.size());
        places_.push_back(std::int32_t(n));
    }
}

void CoverageField::measure_clearance() {
    // A cell may hold cloud when the largest of its nodes does.
    std::array<bool, 256> cloud{};
    for (std::size_t t = 0; t < cloud.size(); ++t) cloud[t] = text::coverage_of(float(t) / 255) > kLeastCoverage;
    std::vector<std::uint8_t> occupied(clearance_.size(), 0);
    tbb::parallel_for(std::size_t{0}, places_.size(), [&](std::size_t n) {
        const std::uint8_t* nodes = &nodes_[n * kBrickBytes];
        for (int cell = 0; cell < kCells * kCells * kCells; ++cell) {
            const int x = cell % kCells, y = cell / kCells % kCells, z = cell / kCells / kCells;
            bool any = false;
            for (int m = 0; m < 27; ++m)
                any = any || cloud[nodes[2 * (((2 * z + m / 9) * kEdge + 2 * y + m / 3 % 3) * kEdge + 2 * x + m % 3)]];
            occupied[n * 64 + std::size_t(cell)] = any ? 1 : 0;
        }
    });
    constexpr int kSide = 3 * kCells, kStride[3] = {1, kSide, kSide * kSide};
    tbb::parallel_for(std::size_t{0}, places_.size(), [&](std::size_t n) {
        std::uint8_t* out = &clearance_[n * 64];
        if (std::all_of(&occupied[n * 64], &occupied[n * 64] + 64, [](std::uint8_t o) { return o != 0; })) return;
        const auto at = unpacked(places_[n], bricks_);
        std::array<std::uint8_t, kSide * kSide * kSide> distance, next;
        distance.fill(kCells);
        for (int m = 0; m < 27; ++m) {
            const int b[3] = {at[0] + m % 3 - 1, at[1] + m / 3 % 3 - 1, at[2] + m / 9 - 1};
            if (b[0] < 0 || b[1] < 0 || b[2] < 0 || b[0] >= bricks_[0] || b[1] >= bricks_[1] || b[2] >= bricks_[2])
                continue;
            const std::int32_t number =
                table_[(std::size_t(b[2]) * std::size_t(bricks_[1]) + std::size_t(b[1])) * std::size_t(bricks_[0]) +
                       std::size_t(b[0])];
            if (number < 0) continue;
            for (int cell = 0; cell < 64; ++cell)
                if (occupied[std::size_t(number) * 64 + std::size_t(cell)] != 0)
                    distance[std::size_t(((m / 9) * kCells + cell / 16) * kStride[2] +
                                         ((m / 3 % 3) * kCells + cell / 4 % 4) * kStride[1] + (m % 3) * kCells +
                                         cell % 4)] = 0;
        }
        for (int round = 1; round < kCells; ++round) {
            std::array<std::uint8_t, kSide * kSide * kSide> least = distance;
            for (const int stride : kStride) {
                next = least;
                for (int i = 0; i < int(least.size()); ++i) {
                    const int c = i / stride % kSide;
                    std::uint8_t& to = next[std::size_t(i)];
                    if (c > 0) to = std::min(to, least[std::size_t(i - stride)]);
                    if (c + 1 < kSide) to = std::min(to, least[std::size_t(i + stride)]);
                }
                least = next;
            }
            for (std::size_t i = 0; i < distance.size(); ++i)
                distance[i] = std::min(distance[i], std::uint8_t(least[i] + 1));
        }
        for (int cell = 0; cell < 64; ++cell)
            out[cell] = distance[std::size_t((kCells + cell / 16) * kStride[2] + (kCells + cell / 4 % 4) * kStride[1] +
                                             kCells + cell % 4)];
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
    return drawn > 0 ? float(mass_ / drawn) : 1.0f;
}

void CoverageField::set_erosion(const DetailSetting& setting, double base_m) {
    const DetailOptions& o = setting.options;
    ErosionConstants& e = erosion_;
    // Extinction of zero: nothing shows; any number will do.
    const double extinction = std::max(setting.extinction_per_m, 1e-9);
    e.half_density = float(std::clamp(1 / (2 * extinction * o.mean_free_path_m), 1e-6, 10.0));
    e.cap = 10 * e.half_density;
    const auto strength = float(o.strength);
    e.base_width = std::max(0.5f * strength, 0.02f);
    e.top_width = std::max(0.62f * strength, 0.02f);
    e.dissolving_width = std::max(0.9f * strength, 0.02f);
    e.medium_width = 0.17f * strength;
    e.fine_width = 0.03f * strength;
    e.wisps = float(o.wisps);
    e.base_m = float(base_m);
    const double tile = kPeriod * o.size_m;
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
    const double medium_tile = tile / 16, fine_tile = tile / 128;
    e.medium_scale = 16;
    e.fine_scale = 128;
    e.medium_per_m = float(kSmallNoiseVoxels / medium_tile);
    e.fine_per_m = float(kSmallNoiseVoxels / fine_tile);
    e.gain = {1, 1};
    if (mass_ > 0) e.gain = {gain_at(13), gain_at(25)};
}

std::size_t CoverageField::memory_bytes() const {
    return nodes_.size() + clearance_.size() + 4 * (table_.size() + places_.size());
}

std::vector<float> detailed_density(const CoverageField& field, const Vec3& corner_m,
                                    const std::array<int, 3>& count, double footprint_m) {
    const auto nx = std::size_t(count[0]), ny = std::size_t(count[1]), nz = std::size_t(count[2]);
    std::vector<float> result(nx * ny * nz, 0.0f);
    const DetailKernel kernel(field);
    const Vec3 from = corner_m - field.corner_m();
    const double per_brick = 1 / (field.node_m() * (kEdge - 1));
    tbb::parallel_for(std::size_t{0}, ny * nz, [&](std::size_t row) {
        const double y = from.y + (double(row % ny) + 0.5) * footprint_m,
                     z = from.z + (double(row / ny) + 0.5) * footprint_m;
        const int by = int(std::floor(y * per_brick)), bz = int(std::floor(z * per_brick));
        if (by < 0 || bz < 0 || by >= kernel.bricks[1] || bz >= kernel.bricks[2]) return;
        std::vector<float> local[3], place[3];
        const auto x_of = [&](std::size_t i) { return from.x + (double(i) + 0.5) * footprint_m; };
        const auto brick_of = [&](std::size_t i) { return int(std::floor(x_of(i) * per_brick)); };
        for (std::size_t begin = 0, end = 0; begin < nx; begin = end) {
            const int bx = brick_of(begin);
            while (end < nx && brick_of(end) == bx) ++end;
            if (bx < 0 || bx >= kernel.bricks[0]) continue;
            const std::int32_t brick =
                kernel.table[(std::size_t(bz) * std::size_t(kernel.bricks[1]) + std::size_t(by)) *
                                 std::size_t(kernel.bricks[0]) +
                             std::size_t(bx)];
            if (brick < 0) continue;
            for (auto& values : local) values.clear();
            for (auto& values : place) values.clear();
            for (std::size_t i = begin; i < end; ++i) {
                const double at[3] = {x_of(i), y, z};
                const int b[3] = {bx, by, bz};
                for (std::size_t axis = 0; axis < 3; ++axis) {
                    place[axis].push_back(float(at[axis]));
                    local[axis].push_back(float((at[axis] * per_brick - b[axis]) * (kEdge - 1)));
                }
            }
            for (std::size_t axis = 0; axis < 3; ++axis) {
                place[axis].resize(place[axis].size() + kLanesBehind);
                local[axis].resize(local[axis].size() + kLanesBehind);
            }
            const float* const locals[3] = {local[0].data(), local[1].data(), local[2].data()};
            const float* const places[3] = {place[0].data(), place[1].data(), place[2].data()};
            HWY_DYNAMIC_DISPATCH(sample_places)
            (kernel, brick, locals, places, end - begin, float(footprint_m), &result[row * nx + begin]);
        }
    });
    return result;
}

float detailed_density_at(const CoverageField& field, const Vec3& place_m, float footprint) {
    const Vec3 from = place_m - field.corner_m();
    const auto& bricks = field.bricks();
    int b[3], whole[3];
    float rest[3];
    for (int axis = 0; axis < 3; ++axis) {
        const double nodes = from[axis] / field.node_m();
        b[axis] = int(std::floor(nodes / (kEdge - 1)));
        if (b[axis] < 0 || b[axis] >= bricks[std::size_t(axis)]) return 0;
        const double local = nodes - double(b[axis]) * (kEdge - 1);
        whole[axis] = std::min(int(local), kEdge - 2);
        rest[axis] = float(local - whole[axis]);
    }
    const std::int32_t brick =
        field.table()[(std::size_t(b[2]) * std::size_t(bricks[1]) + std::size_t(b[1])) * std::size_t(bricks[0]) +
                      std::size_t(b[0])];
    if (brick < 0) return 0;
    const std::uint8_t* nodes = &field.nodes()[std::size_t(brick) * CoverageField::kBrickBytes];
    float t = 0, growth = 0;
    for (int n = 0; n < 8; ++n) {
        const int o[3] = {n & 1, n >> 1 & 1, n >> 2};
        float weight = 1;
        for (int axis = 0; axis < 3; ++axis) weight *= o[axis] != 0 ? rest[axis] : 1 - rest[axis];
        const std::uint8_t* at =
            nodes + 2 * (((whole[2] + o[2]) * kEdge + whole[1] + o[1]) * kEdge + whole[0] + o[0]);
        t += weight * float(at[0]) / 255.0f;
        growth += weight * (float(at[1]) - 128.0f) / 127.0f;
    }
    const ErosionConstants& e = field.erosion();
    const float c = text::coverage_of(t), top = text::towards_top(float(from.z) - e.base_m);
    const float large = text::large_width(top, growth, e.base_width, e.top_width, e.dissolving_width);
    const float medium = text::medium_width(footprint, e.medium_width),
                fine = text::fine_width(footprint, e.fine_width), soft = text::edge_softness(footprint);
    const float others = 0.5f * (medium + fine + soft);
    if (!(c > std::max(0.5f - 0.5f * large - others, kLeastCoverage))) return 0;
    float turned[3];
    for (std::size_t row = 0; row < 3; ++row) {
        const auto& to = e.to_noise[row];
        turned[row] = to[0] * float(from.x) + to[1] * float(from.y) + to[2] * float(from.z) + to[3];
    }
    const auto [u, v, w] = turned;
    const auto edge = float(kLargeNoiseVoxels);
    float noise =
        0.5f + large * (scalar_noise(detail_noise().large, kLargeNoiseVoxels, u * edge, v * edge, w * edge) - 0.5f);
    const auto level = [&](float voxels_per_m) {
        int exponent = 0;
        const float mantissa = std::frexp(std::max(footprint * voxels_per_m, 1.0f), &exponent);
        return std::min(float(exponent - 1) + (2 * mantissa - 1), 3.0f);
    };
    if (std::abs(c - noise) < others && medium > 0) {
        const float s = e.medium_scale * float(kSmallNoiseVoxels), a = u * s, g = w * s;
        noise += medium * text::billows(top, growth, e.wisps) *
                 (scalar_small_noise(level(e.medium_per_m), 0.6f * a - 0.8f * g, v * s, 0.8f * a + 0.6f * g) - 0.5f);
        const float f = e.fine_scale * float(kSmallNoiseVoxels);
        if (fine > 0) noise += fine * (scalar_small_noise(level(e.fine_per_m), u * f, v * f, w * f) - 0.5f);
    }
    const float mask = text::saturate((c - noise) / soft + 0.5f);
    const float small = std::min(std::sqrt(medium * medium + soft * soft), large);
    const float fraction = std::max(text::cloudy_fraction(c, large, small), 0.02f);
    const float coarse = text::saturate((footprint - 13.0f) / 12.0f);
    const float mean = text::density_of(t, e.half_density);
    return mask * std::min((e.gain[0] + coarse * (e.gain[1] - e.gain[0])) * mean / fraction, std::max(mean, e.cap));
}

DensityGrid resample_with_detail(const CoverageField& field, Extent coarse, const Placement& placement, int refine) {
    if (refine < 1 || refine > kMaxRefine)
        throw Error(ErrorCode::usage,
                    "refinement of " + std::to_string(refine) + " voxels per cell: must be 1..8");
    if (std::int64_t{std::max({coarse.x, coarse.y, coarse.z})} * refine > std::numeric_limits<int>::max() - kBlock)
        throw Error(ErrorCode::usage,
                    "a refinement of " + std::to_string(refine) + " gives too many voxels on an axis");
    const Extent fine{coarse.x * refine, coarse.y * refine, coarse.z * refine};
    Placement finer = placement;
    finer.cell_size_m /= refine;
    // Blocks that a brick with cloud touches.
    const auto& bricks = field.bricks();
    const Vec3 shift = (field.corner_m() - placement.origin_m) / finer.cell_size_m;  // voxels
    const double brick_voxels = field.node_m() * (kEdge - 1) / finer.cell_size_m;
    std::vector<openvdb::Coord> origins;
    for (const std::int32_t place : field.places()) {
        const auto at = unpacked(place, bricks);
        int low[3], high[3];
        const int sizes[3] = {fine.x, fine.y, fine.z};
        for (int axis = 0; axis < 3; ++axis) {
            const double begin = shift[axis] + at[std::size_t(axis)] * brick_voxels;
            low[axis] = std::max(int(std::floor(begin)), 0) & ~(kBlock - 1);
            high[axis] = std::min(int(std::ceil(begin + brick_voxels)), sizes[axis]);
        }
        for (int z = low[2]; z < high[2]; z += kBlock)
            for (int y = low[1]; y < high[1]; y += kBlock)
                for (int x = low[0]; x < high[0]; x += kBlock) origins.emplace_back(x, y, z);
    }
    std::ranges::sort(origins, {}, block_order);
    origins.erase(std::unique(origins.begin(), origins.end()), origins.end());
    std::vector<NewBlock> blocks(origins.size());
    tbb::parallel_for(std::size_t{0}, origins.size(), [&](std::size_t n) {
        const openvdb::Coord& o = origins[n];
        const Vec3 corner = placement.origin_m + finer.cell_size_m * Vec3(o.x(), o.y(), o.z());
        const std::vector<float> values =
            detailed_density(field, corner, {kBlock, kBlock, kBlock}, finer.cell_size_m);
        auto leaf = uninitialised_leaf(o);
        float* const out = leaf->buffer().data();
        for (int v = 0; v < kBlockVoxels; ++v) {
            const int x = v & 7, y = v >> 3 & 7, z = v >> 6;
            const bool inside = o.x() + x < fine.x && o.y() + y < fine.y && o.z() + z < fine.z;
            out[leaf_offset(x, y, z)] = inside ? values[std::size_t(v)] : 0.0f;
        }
        blocks[n] = NewBlock::from(std::move(leaf));
    });
    TreeBuilder builder;
    for (std::size_t n = 0; n < blocks.size(); ++n) blocks[n].move_to(builder, origins[n]);
    return builder.finish(fine, finer);
}

}  // namespace nephos
#endif
