// SPDX-License-Identifier: Apache-2.0
#pragma once

// Sub-voxel detail by procedural noise erosion: one definition of density for pictures, light and files.
//
//     density(x) = min(gain D / G(C), max(D, cap)) mask(C - e(x))
//
// D is the density of the metaballs (metaballs.h) times thermals, a low-frequency noise of mean 1 with bumps of 4,
// 2 and 1 times DetailOptions::size_m. C = D^2 / (D^2 + half^2), 0..1, is the coverage: the local cloud fraction
// before erosion. half = 1 / (2 extinction mean_free_path) is the density at which half of the space is cloud; where
// the scene leaves the mean free path open, it is at most 0.7 of the mean density within four cells, weighted by mass.
//
// e = 1/2 + the sum of width (n - 1/2) over three noises n, each distributed uniformly over 0..1 and low in the
// middle of a bump (Worley noise; detail_noise.h). The large noise has bumps of 4, 2 and 1 cells by default (160,
// 80 and 40 m in cells of 40 m); near the eye a medium one of 21 to 5 m and a fine one of 2.5 to 0.6 m follow, in
// proportion to the large. mask(u) = clamp(u / softness + 1/2, 0, 1) cuts the cloud out where C > e.
//
// G(C) = P(e < C), of a sum of two uniform numbers, is known in closed form (cloudy_fraction() in
// detail_formulas.h), so that the mean of the density over the noise is D. Mass is lost where C is too small to be
// drawn, at the caps, and where a small cloud has few bumps: one gain for the whole field makes up for it, within
// limits, so that conservation is approximate (tests measure 0.98 to 1.02 of the grid's mass).
//
// The noise is fixed in air that drifts with the wind. Where the wind changes with height, bands of height drift each with
// the wind in its middle, and the noise of one passes into that of the next. It varies with the height above the base (billows above, wisps
// below) and with the growth of the cloud, -1 where it dissolves (shreds) to 1 where it grows (crisp bumps). Detail
// smaller than the footprint, the filter width in metres (that of a pixel or a voxel), fades.

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "core/vec.h"
#include "density/density_grid.h"
#include "density/options.h"

namespace nephos {

// How much farther than DetailSetting::drift_m the wind has carried bands of height, one above the other from the bottom of
// the grid; without bands it has carried all heights alike.
struct DriftBands {
    double height_m = 0;  // of each band; above 0 where there are some
    std::vector<Vec2> apart_m;
    bool operator==(const DriftBands&) const = default;
};

// Inputs of detail beside the density.
struct DetailSetting {
    DetailOptions options;
    double extinction_per_m = 0.02;      // at density 1
    double metaball_radius_cells = 2.0;  // 1..8
    double opacity = 1;                  // density of a fully cloudy cell, 0..1
    Vec3 drift_m{};                      // how far the wind has carried the air
    DriftBands bands;                    // ... at different heights
    // Direction of DetailOptions::stretch: east and north. Precondition: of length 1.
    Vec2 along{1, 0};
    // Sides of the grid: open, no cloud beyond, and cloud thins out towards them over DetailOptions::apron_cells cells;
    // periodic, images of the grid beyond, and noise that repeats with it.
    Boundaries boundaries;
    bool images = true;  // false: no cloud beyond periodic sides either
};

// Bounds the density in the images of a grid that repeats: at most so many times that of the grid.
inline constexpr float kMostInImages = 2.5f;

// Returns whether the cloud goes on to the horizon in pictures.
inline bool repeats(const DetailSetting& setting) {
    return setting.images && setting.options.to_horizon && setting.boundaries.x == Boundary::periodic &&
           setting.boundaries.y == Boundary::periodic;
}

// Largest number of clouds with detail in a picture.
inline constexpr std::size_t kMaxDetailedClouds = 16;

class CoverageCells;
class NodeSums;

// ErosionConstants::whole that disables erosion, of a field with DetailOptions::strength 0: a bias of the coverage
// above any noise, so that mask and G are 1 and the density is that of the metaballs.
inline constexpr float kWhole = 8;

// The constants of the erosion, as kernels and shaders read them.
struct ErosionConstants {
    float half_density = 0.1f;
    float cap = 0.7f;  // largest density where cloud is eroded; where D is larger, D is the limit
    // Widths of the noises, in coverage. The large one: at the base, from 160 m above it on, and where the cloud
    // dissolves (large_width() in detail_formulas.h); then the medium and the fine one, for footprint 0.
    float base_width = 0.5f, top_width = 0.62f, dissolving_width = 0.9f, medium_width = 0.17f,
          fine_width = 0.03f;
    float wisps = 1;               // DetailOptions::wisps
    float least_coverage = 0.03f;  // where C is not larger there is no cloud, whatever the noise
    // D / half there, or a little less: t / (1 - t).
    float cloud_odds() const { return std::sqrt(least_coverage / (1 - least_coverage)) * 0.9999f; }
    float whole = 0;               // added to C in mask and G: 0, or kWhole to disable erosion
    float base_m = 0;              // height of the cloud's base above corner_m()
    std::array<float, 2> gain{};   // for scaled footprints up to 13 m, and from 25 m on; linear between
    // 3x4 matrix, row by row, from metres relative to corner_m() to texture coordinates of the large noise: 1 is one
    // period; drift and stretch are included. A grid's edge along a periodic axis has a whole number of periods, so
    // that the noise repeats with the grid.
    std::array<std::array<float, 4>, 3> to_noise{};
    float medium_scale = 15, fine_scale = 128;  // periods of these noises in one of the large noise
    // Voxels of these noises at mip level 0 per metre of a scaled footprint. A scaled footprint is footprint *
    // footprint_scale, 160 m / size of the large bumps: the formulas are written for bumps of 160 m.
    float medium_per_m = 1, fine_per_m = 1, footprint_scale = 1;
    // Of DriftBands: texture coordinates of the large noise that are added to to_noise's, and last by how much the noise
    // of a band differs from that of the next: 0 not at all, 1 entirely. The middle of band n is at height (n + 1/2) /
    // bands_per_m above bands_begin_m, relative to corner_m(). Empty: there are none.
    std::vector<std::array<float, 4>> bands;
    float bands_begin_m = 0, bands_per_m = 0;
    bool operator==(const ErosionConstants&) const = default;
};

// The density of a grid's metaballs, sampled at the corners of half cells (nodes), in bricks of 8^3 half cells. A
// brick stores its 9^3 nodes, so that it is interpolated without its neighbours: nodes of a common face are in
// both. An immutable value after construction; const functions are thread-safe.
class CoverageField {
  public:
    static constexpr int kBrickNodes = 9;  // on an edge
    static constexpr int kBrickCells = 4;  // cells of the lattice on an edge
    static constexpr std::size_t kBrickBytes = 1460;  // 729 nodes of 2 bytes, and 2 of padding for reads of 4

    // Samples D at all nodes where it is above 0. `moisture`, of the same extent, gives the growth of the cloud:
    // clamp(moisture / mean - 1, -1, 1), its mean over the cells weighted by their density. Without it growth is 0.
    // Throws Error(usage) when a setting is out of range, and when the field has more than 2^31 bytes.
    CoverageField(const DensityGrid& grid, const DetailSetting& setting, const DensityGrid* moisture = nullptr);

    // World position of the first node, and the distance between nodes (half a cell), metres. The corner lies outside
    // the grid, which is padded by whole bricks as far as metaballs reach: on periodic axes they hold image cloud.
    const Vec3& corner_m() const { return corner_m_; }
    double node_m() const { return node_m_; }
    // The edges of the grid along x and y, metres, along which it repeats to the horizon; 0: it does not. Its
    // first cell begins home_m() from corner_m(), on each axis.
    const Vec2& period_m() const { return period_m_; }
    double home_m() const { return home_m_; }
    // World height of the top of the highest brick that holds cloud; that of corner_m() without one.
    double top_m() const {
        return corner_m_.z + (places_.empty() ? 0 : 8 * node_m_ * (places_.back() / bricks_[0] / bricks_[1] + 1));
    }
    // Returns the place in the grid that has the same cloud as a place of its repetitions; both from corner_m().
    Vec3 at_home(Vec3 place_m) const {
        for (int axis = 0; axis < 2 && period_m_[axis] > 0; ++axis)
            place_m[axis] -= period_m_[axis] * std::floor((place_m[axis] - home_m_) / period_m_[axis]);
        return place_m;
    }
    // Bricks on each axis.
    const std::array<int, 3>& bricks() const { return bricks_; }
    // For each brick, x fastest: its number among those that hold cloud, from 0; or, below 0, the empty cubes that begin
    // there: for each octant n (1: towards rising x, 2: y, 4: z) the edge in bricks, 1..8, less by one, in three bits
    // from bit 3 n on.
    const std::vector<std::int32_t>& table() const { return table_; }
    // For each brick that holds cloud, by its number: its index in table(), rising.
    const std::vector<std::int32_t>& places() const { return places_; }
    // kBrickBytes of each of these: t = D / (D + half) of each node, x fastest (0..255 for 0..1; detail_formulas.h
    // turns it into C and D), each followed by its growth (1..255 for -1..1).
    const std::vector<std::uint8_t>& nodes() const { return nodes_; }
    // kBrickCells^3 bytes for each octant (as in table()) of each of these, x fastest, and three bytes more for reads of 4.
    // Up to kOccupied: the cell may hold cloud where D is more than kFactorStep times this as large. Above: by how much, the
    // edge in cells, 1..5, of the cube without cloud that begins there, whatever D is in images.
    const std::vector<std::uint8_t>& cells() const { return cells_; }
    static constexpr int kOccupied = 247;
    static constexpr float kFactorStep = kMostInImages / (kOccupied + 1);
    static constexpr std::size_t kCellBytes = 8 * kBrickCells * kBrickCells * kBrickCells;  // of a brick

    // kBrickCells^3 of each of these, x fastest: the mean detailed density of each cell, of eight samples whose
    // footprint is half a cell.
    const std::vector<float>& cell_density() const { return cell_density_; }
    // Returns it and keeps none.
    std::vector<float> take_cell_density() { return std::exchange(cell_density_, {}); }

    const ErosionConstants& erosion() const { return erosion_; }
    double extinction_per_m() const { return extinction_per_m_; }
    std::size_t memory_bytes() const;

  private:
    void find_places(const CoverageCells& cells, const Boundaries& boundaries, const std::array<int, 3>& extent,
                     int before, int reach);
    void sample_nodes(const CoverageCells& cells, const NodeSums& sums, int before);
    // `counted`: 1 for each layer of cells on each axis whose mass is that of the grid, not of an image.
    void measure_cells(const std::array<std::vector<std::uint8_t>, 3>& counted);
    void set_erosion(const DetailSetting& setting, const DensityGrid& grid, double base_m);
    float gain_at(double footprint_m) const;

    Vec3 corner_m_{};
    double node_m_ = 1, extinction_per_m_ = 0, home_m_ = 0;
    Vec2 period_m_{0, 0};
    std::array<int, 3> bricks_{};
    std::vector<std::int32_t> table_, places_;
    std::vector<std::uint8_t> nodes_, cells_;
    std::vector<float> cell_density_;
    std::array<double, 256> histogram_{};  // of t over the nodes
    double mass_ = 0;                      // 8 nodes a cell times the sum of the grid's values
    double mean_density_ = 0;              // CoverageCells::mean_density()
    ErosionConstants erosion_;
};

// Returns the detailed density at the middles of count[0] x count[1] x count[2] boxes of edge `footprint_m`, x
// fastest; the first box begins at `corner_m` in the world. Each value is a point sample, with noise limited to the
// footprint and not a mean over the box; 0 outside of the field.
std::vector<float> detailed_density(const CoverageField& field, const Vec3& corner_m,
                                    const std::array<int, 3>& count, double footprint_m);

// Where a brick is sampled: in the middle of the boxes between its nodes, or a quarter of one away from it on each axis,
// to either side, which stands for samples finer than the boxes.
enum class BrickSamples { middles, quarters };

// Returns the detailed density in each of the 8 x 8 x 8 boxes between the nodes of a brick, x fastest. `number` indexes
// places(); `footprint_m`: filter width of the noise; `out` has at least 512 numbers.
void detailed_density_of_brick(const CoverageField& field, std::size_t number, double footprint_m,
                               BrickSamples samples, std::span<float> out);

// The same for one point, in scalar code: the test reference of the SIMD kernels and shaders.
float detailed_density_at(const CoverageField& field, const Vec3& place_m, float footprint_m);

// Samples detailed density at the centres of voxels `refine` (1..8) times smaller than the cells of the grid that
// `field` was made of; `extent` and `placement` are those of that coarse grid. Throws as resample() in metaballs.h.
DensityGrid resample_with_detail(const CoverageField& field, Extent extent, const Placement& placement, int refine);

// Returns the size of the largest bumps, metres, in cells with edges of `cell_m`.
double bump_size_m(const DetailOptions& options, double cell_m);

// Throws Error(usage) naming the first option that is out of its range.
void check(const DetailOptions& options);

}  // namespace nephos
