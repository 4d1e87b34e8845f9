// SPDX-License-Identifier: Apache-2.0

// How a CoverageField is made of a grid (detail.h).

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <string>

#include <tbb/parallel_for.h>

#include "core/error.h"
#include "density/coverage_cells.h"
#include "density/detail_kernels.h"
#include "density/detail_scalar.h"
#include "density/empty_space.h"
#include "density/node_sums.h"
#include "density/openvdb_access.h"

namespace nephos {
namespace {

namespace text = detail_text;

constexpr int kEdge = CoverageField::kBrickNodes, kCells = CoverageField::kBrickCells;
constexpr double kUsualBumps_m = 160;  // of which detail_formulas.h says when they fade
// Tiles of the medium noise in one of the large: 0.6 and 0.8 of it, by which it is turned, are whole, too, so that
// nothing changes when the drift passes a tile.
constexpr float kMediumTiles = 15;
constexpr double kHalfOfMean = 0.7;  // largest half density that is not a scene's own, in mean densities
constexpr double kFraction = 0.01;  // of the mass that lies below the base

void require(bool good, const char* name, double value, const char* expected) {
    if (!good)
        throw Error(ErrorCode::usage, std::string("detail: ") + name + " is " + std::to_string(value) +
                                          ": expected " + expected);
}

bool within(double value, double low, double high) { return value >= low && value <= high; }

void check(const DetailSetting& setting) {
    nephos::check(setting.options);
    require(within(setting.metaball_radius_cells, 1, 8), "metaball radius", setting.metaball_radius_cells, "1..8 cells");
    require(within(setting.opacity, 0, 1), "opacity", setting.opacity, "0..1");
}

[[noreturn]] void throw_too_large(double bricks) {
    throw Error(ErrorCode::usage,
                "detail: a cloud of " + std::to_string(std::int64_t(bricks)) +
                    " bricks of 8 x 8 x 8 samples is too large: expected at most " +
                    std::to_string(std::size_t(std::numeric_limits<std::int32_t>::max()) / CoverageField::kBrickBytes) +
                    "; draw it without (detail.enabled = false)");
}

}  // namespace

void check(const DetailOptions& o) {
    require(within(o.strength, 0, 1.4), "strength", o.strength, "0..1.4");
    require(o.size_m == 0 || within(o.size_m, 20, 5000), "size_m", o.size_m, "0 or 20..5000");
    require(within(o.stretch, 1, 50), "stretch", o.stretch, "1..50");
    require(within(o.wisps, 0, 1), "wisps", o.wisps, "0..1");
    require(within(o.thermals, 0, 1), "thermals", o.thermals, "0..1");
    require(o.mean_free_path_m == 0 || within(o.mean_free_path_m, 1, 10000), "mean_free_path_m", o.mean_free_path_m,
            "0 or 1..10000");
    require(o.apron_cells >= 0 && o.apron_cells <= 64, "apron_cells", o.apron_cells, "0..64");
}

namespace {

// Returns how many cells above the lowest layer the base of a cloud is: a hundredth of it lies below, so that the base
// moves no faster than the cloud.
double base_cells(std::span<const double> masses, double mass) {
    double below = 0;
    for (std::size_t z = 0; z < masses.size(); ++z) {
        if (below + masses[z] >= kFraction * mass)
            return double(z) + (masses[z] > 0 ? (kFraction * mass - below) / masses[z] : 0);
        below += masses[z];
    }
    return 0;
}

}  // namespace

CoverageField::CoverageField(const DensityGrid& grid, const DetailSetting& setting, const DensityGrid* moisture)
    : extinction_per_m_(setting.extinction_per_m) {
    check(setting);
    const double cell = grid.placement().cell_size_m;
    const NodeSums sums(setting.metaball_radius_cells);
    node_m_ = 0.5 * cell;
    const std::array<int, 3> extent{grid.extent().x, grid.extent().y, grid.extent().z};
    // Whole bricks around all that the metaballs reach.
    const int before = (sums.reach() + kCells - 1) / kCells * kCells;
    corner_m_ = grid.placement().origin_m - Vec3(before * cell);
    home_m_ = before * cell;
    if (repeats(setting))
        period_m_ = cell * Vec2(extent[0], extent[1]);
    double bricks = 1;
    for (std::size_t axis = 0; axis < 3; ++axis)
        bricks *= bricks_[axis] = (extent[axis] + 2 * before + kCells - 1) / kCells;
    if (bricks > double(std::numeric_limits<std::int32_t>::max())) throw_too_large(bricks);
    table_.assign(std::size_t(bricks), -1);

    const CoverageCells cells(grid, setting, moisture);
    const std::vector<double> masses = cells.masses();
    mass_ = std::accumulate(masses.begin(), masses.end(), 0.0);
    const double base_m = (before + base_cells(masses, mass_)) * cell;
    mean_density_ = cells.mean_density();
    set_erosion(setting, grid, base_m);
    const Boundaries beyond = setting.images ? setting.boundaries : Boundaries{};
    find_places(cells, beyond, extent, before, sums.reach());
    sample_nodes(cells, sums, before);
    mass_ *= 8;  // nodes for each cell
    set_erosion(setting, grid, base_m);
    cells_ = cells_of(nodes_, places_, table_, bricks_, erosion_.cloud_odds(), repeats(setting) ? kMostInImages : 1);
    set_distances(table_, bricks_);

    const Boundary boundaries[3] = {beyond.x, beyond.y, beyond.z};
    std::array<std::vector<std::uint8_t>, 3> counted;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        counted[axis].assign(std::size_t(bricks_[axis]) * kCells, 1);
        for (int c = 0; boundaries[axis] == Boundary::periodic && c < bricks_[axis] * kCells; ++c)
            if (c < before || c >= before + extent[axis]) counted[axis][std::size_t(c)] = 0;
    }
    measure_cells(counted);
}

// The bricks near the boxes of cloud in blocks: some of them may hold none.
void CoverageField::find_places(const CoverageCells& cells, const Boundaries& boundaries,
                                const std::array<int, 3>& extent, int before, int reach) {
    std::vector<std::uint8_t> reached(table_.size(), 0);
    const auto reach_around = [&](const VoxelBox& cloud, const openvdb::Coord& move) {
        int low[3], high[3];
        for (int axis = 0; axis < 3; ++axis) {
            const auto n = std::size_t(axis);
            low[axis] = std::max((cloud.min[n] + move[axis] + before - reach - 1) / kCells, 0);
            high[axis] = std::min((cloud.max[n] + move[axis] + before + reach) / kCells, bricks_[n] - 1);
        }
        for (int z = low[2]; z <= high[2]; ++z)
            for (int y = low[1]; y <= high[1]; ++y)
                for (int x = low[0]; x <= high[0]; ++x)
                    reached[(std::size_t(z) * std::size_t(bricks_[1]) + std::size_t(y)) * std::size_t(bricks_[0]) +
                            std::size_t(x)] = 1;
    };
    // Images of blocks beyond periodic sides reach into the lattice, too.
    const auto images = [](Boundary boundary) { return boundary == Boundary::periodic ? 1 : 0; };
    for (const VoxelBox& cloud : cells.boxes())
        for (int k = -images(boundaries.z); k <= images(boundaries.z); ++k)
            for (int j = -images(boundaries.y); j <= images(boundaries.y); ++j)
                for (int i = -images(boundaries.x); i <= images(boundaries.x); ++i)
                    reach_around(cloud, {i * extent[0], j * extent[1], k * extent[2]});
    for (std::size_t n = 0; n < table_.size(); ++n)
        if (reached[n] != 0) places_.push_back(std::int32_t(n));
    if (places_.size() > std::size_t(std::numeric_limits<std::int32_t>::max()) / kBrickBytes)
        throw_too_large(double(places_.size()));
}

// Fills nodes_, histogram_ and table_, and drops places without cloud.
void CoverageField::sample_nodes(const CoverageCells& cells, const NodeSums& sums, int before) {
    nodes_.assign(places_.size() * kBrickBytes, 0);
    std::array<std::atomic<std::uint64_t>, 256> histogram{};
    std::vector<std::uint8_t> empty(places_.size(), 0);
    const float half_density = erosion_.half_density;
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, places_.size(), 16), [&](const auto& range) {
        std::vector<float> density(sums.size()), growing(cells.grows() ? density.size() : 0);
        NodeSums::Nodes means{}, growths{};
        std::array<std::uint32_t, 256> counts{};
        for (std::size_t n = range.begin(); n != range.end(); ++n) {
            const auto at = brick_at(places_[n], bricks_);
            int corner[3];
            for (std::size_t axis = 0; axis < 3; ++axis) corner[axis] = at[axis] * kCells - before - sums.reach();
            if (!cells.copy(corner, sums.side(), sums.pitch(), density.data(),
                            cells.grows() ? growing.data() : nullptr)) {
                empty[n] = 1;
                continue;
            }
            sums.sum(density.data(), means.data());
            if (cells.grows()) sums.sum(growing.data(), growths.data());
            std::uint8_t* const out = &nodes_[n * kBrickBytes];
            NodeSums::to_bytes(means, growths, half_density, out);
            for (std::size_t row = 0; row < kEdge * (kEdge - 1); ++row) {  // the last ones are those of other bricks
                if (row % kEdge == kEdge - 1) continue;
                for (std::size_t x = 0; x < kEdge - 1; ++x) ++counts[out[2 * (row * kEdge + x)]];
            }
        }
        for (std::size_t t = 0; t < counts.size(); ++t)
            if (counts[t] > 0) histogram[t] += counts[t];
    });
    std::ranges::transform(histogram, histogram_.begin(), [](const auto& count) { return double(count.load()); });
    std::size_t kept = 0;
    for (std::size_t n = 0; n < places_.size(); ++n) {
        if (empty[n] != 0) continue;
        if (kept != n)
            std::copy_n(nodes_.begin() + std::ptrdiff_t(n * kBrickBytes), kBrickBytes,
                        nodes_.begin() + std::ptrdiff_t(kept * kBrickBytes));
        table_[std::size_t(places_[n])] = std::int32_t(kept);
        places_[kept++] = places_[n];
    }
    places_.resize(kept);
    nodes_.resize(kept * kBrickBytes);
}

namespace {

constexpr std::size_t kSamples = 2 * kCells;  // on an edge of a brick
constexpr std::size_t kOfBrick = std::size_t(kCells) * kCells * kCells;
using CellSums = std::array<float, kOfBrick>;

// Sums the eight samples of each cell.
CellSums sums_of_cells(std::span<const float> samples) {
    CellSums sums;
    for (std::size_t cell = 0; cell < sums.size(); ++cell) {
        const std::size_t x = cell % kCells, y = cell / kCells % kCells, z = cell / kCells / kCells;
        const float* const from = &samples[((2 * z) * kSamples + 2 * y) * kSamples + 2 * x];
        sums[cell] = 0;
        for (const std::size_t row : {std::size_t{0}, kSamples, kSamples * kSamples, kSamples * (kSamples + 1)})
            sums[cell] += from[row] + from[row + 1];
    }
    return sums;
}

// Adds up the cells of a brick that are counted.
double mass_of(const CellSums& sums, const std::array<int, 3>& brick,
               const std::array<std::vector<std::uint8_t>, 3>& counted) {
    double mass = 0;
    for (std::size_t cell = 0; cell < kOfBrick; ++cell) {
        const std::size_t at[3] = {cell % kCells, cell / kCells % kCells, cell / kCells / kCells};
        bool is_counted = true;
        for (std::size_t axis = 0; axis < 3; ++axis)
            is_counted = is_counted && counted[axis][std::size_t(brick[axis]) * kCells + at[axis]] != 0;
        if (is_counted) mass += double(sums[cell]);
    }
    return mass;
}

}  // namespace

// The cells are those of the closed form; what they lack of the grid's mass then makes all denser: as measured with a
// footprint of half a cell, and with one at which all of the medium noise is there.
void CoverageField::measure_cells(const std::array<std::vector<std::uint8_t>, 3>& counted) {
    constexpr double kFineFootprint_m = 13, kCoarseFootprint_m = 25;  // of ErosionConstants::gain, scaled
    const std::size_t stride = places_.size() < 1024 ? 1 : 4;          // of bricks with fine samples
    cell_density_.assign(places_.size() * kOfBrick, 0.0f);
    std::vector<std::array<double, 3>> masses(places_.size(), {0, 0, 0});  // coarse, and both where there are fine ones
    tbb::parallel_for(std::size_t{0}, places_.size(), [&](std::size_t n) {
        std::array<float, kSamples * kSamples * kSamples> samples;
        const auto at = brick_at(places_[n], bricks_);
        detailed_density_of_brick(*this, n, node_m_, BrickSamples::middles, samples);
        const CellSums sums = sums_of_cells(samples);
        for (std::size_t cell = 0; cell < kOfBrick; ++cell) cell_density_[n * kOfBrick + cell] = 0.125f * sums[cell];
        masses[n][0] = mass_of(sums, at, counted);
        if (n % stride != 0) return;
        masses[n][1] = masses[n][0];
        detailed_density_of_brick(*this, n, kFineFootprint_m / double(erosion_.footprint_scale), BrickSamples::quarters,
                                  samples);
        masses[n][2] = mass_of(sums_of_cells(samples), at, counted);
    });
    std::array<double, 3> sums{};
    for (const auto& each : masses)
        for (std::size_t i = 0; i < sums.size(); ++i) sums[i] += each[i];
    if (!(sums[0] > 0) || !(sums[2] > 0)) return;
    const double more = std::clamp(mass_ / sums[0], 0.5, 2.0), fine = std::clamp(more * sums[1] / sums[2], 0.5, 2.0);
    // The footprint of half a cell lies between those of the two gains; all three are to have the mass.
    const double between = std::clamp((node_m_ * double(erosion_.footprint_scale) - kFineFootprint_m) /
                                          (kCoarseFootprint_m - kFineFootprint_m), 0.0, 1.0);
    const double here = erosion_.gain[0] + between * (erosion_.gain[1] - erosion_.gain[0]),
                 fine_gain = erosion_.gain[0] * fine;
    erosion_.gain[0] = float(fine_gain);
    erosion_.gain[1] =
        float(between > 0.25 ? (more * here - (1 - between) * fine_gain) / between : more * erosion_.gain[1]);
    for (float& density : cell_density_) density *= float(more);
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
        if (!(c > erosion_.least_coverage && c + erosion_.whole > 0.5f - 0.5f * (large + medium + soft))) continue;
        const float mean = text::density_of(t, erosion_.half_density),
                    fraction = text::cloudy_fraction(c + erosion_.whole, large, small);
        drawn += histogram_[n] *
                 double(std::min(mean / std::max(fraction, 0.02f), std::max(mean, erosion_.cap)) * fraction);
    }
    return drawn > 0 ? float(std::clamp(mass_ / drawn, 0.5, 4.0)) : 1.0f;
}

void CoverageField::set_erosion(const DetailSetting& setting, const DensityGrid& grid, double base_m) {
    const DetailOptions& o = setting.options;
    ErosionConstants& e = erosion_;
    // Extinction of zero: nothing shows; any number will do.
    const double extinction = std::max(setting.extinction_per_m, 1e-9);
    const double free_path_m = o.mean_free_path_m > 0 ? o.mean_free_path_m : 1.5 * node_m_;
    // Of a layer's opacity, which is the density of its saturated cells, at most a quarter: those are cloud throughout,
    // however thin; and at least as much as nodes of a byte can tell from it.
    const double opacity = std::max(setting.opacity, 1e-6);
    double half_density = 1 / (2 * extinction * free_path_m);
    // By itself below what the cloud has in the mean: a thin one would be torn to crumbs.
    if (o.mean_free_path_m == 0) half_density = std::min(half_density, kHalfOfMean * mean_density_);
    e.half_density = float(std::clamp(half_density, 0.004 * opacity, 0.25 * opacity));
    e.cap = std::min(10 * e.half_density, float(opacity));
    const auto strength = float(o.strength);
    e.base_width = std::max(0.5f * strength, 0.02f);
    e.top_width = std::max(0.62f * strength, 0.02f);
    e.dissolving_width = std::max(0.9f * strength, 0.02f);
    e.medium_width = 0.17f * strength;
    e.fine_width = 0.03f * strength;
    e.wisps = float(o.wisps);
    if (o.strength == 0) {
        e.least_coverage = 0;
        e.whole = kWhole;
    }
    e.base_m = float(base_m);
    const double size_m = bump_size_m(o, 2 * node_m_), tile = kBumpsOfTile * size_m;
    const Vec2 along = setting.along;
    std::array<Vec3, 3> rows;
    for (std::size_t row = 0; row < 3; ++row) {
        const Vec3 turn(kNoiseTurn[row][0], kNoiseTurn[row][1], kNoiseTurn[row][2]);
        // Places are squeezed along the wind before they are turned.
        const double shrink = 1 / o.stretch - 1, of_along = turn.x * along.x + turn.y * along.y;
        rows[row] = (turn + Vec3(along * (shrink * of_along), 0.0)) / tile;
    }
    rows = repeating(rows, setting.boundaries, grid.extent(), 2 * node_m_);
    for (std::size_t row = 0; row < 3; ++row) {
        const Vec3& to = rows[row];
        const double offset = glm::dot(to, corner_m_ - setting.drift_m);
        e.to_noise[row] = {float(to.x), float(to.y), float(to.z), float(offset - std::floor(offset))};
    }
    const DriftBands& bands = setting.bands;
    e.bands.resize(bands.apart_m.size());
    for (std::size_t n = 0; n < e.bands.size(); ++n) {
        for (std::size_t row = 0; row < 3; ++row) {
            const double offset = -glm::dot(Vec2(rows[row]), bands.apart_m[n]);
            e.bands[n][row] = float(offset - std::floor(offset));
        }
        const Vec2 to_next = bands.apart_m[std::min(n + 1, e.bands.size() - 1)] - bands.apart_m[n];
        e.bands[n][3] = float(std::min(2 * glm::length(to_next) / size_m, 1.0));
    }
    e.bands_begin_m = float(grid.placement().origin_m.z - corner_m_.z);
    e.bands_per_m = e.bands.empty() ? 0.0f : float(1 / bands.height_m);
    // The offset of the small noises is that of the large one: a whole number of their tiles in one of its.
    e.medium_scale = kMediumTiles;
    e.fine_scale = 128;
    e.medium_per_m = float(kSmallNoiseVoxels / (kBumpsOfTile * kUsualBumps_m / kMediumTiles));
    e.fine_per_m = float(kSmallNoiseVoxels / (kBumpsOfTile * kUsualBumps_m / 128));
    e.footprint_scale = float(kUsualBumps_m / size_m);
    e.gain = {1, 1};
    if (mass_ > 0) e.gain = {gain_at(13), gain_at(25)};
}

}  // namespace nephos
