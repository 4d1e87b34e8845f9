// SPDX-License-Identifier: Apache-2.0
#pragma once

// Detail below the voxel: one definition of density for pictures, light and files.
//
//     density(x) = mask(C(x) - e(x)) D(x) / G(C(x))
//
// D is the density of the metaballs (metaballs.h), C = D^2 / (D^2 + half^2) its coverage, half = 1 / (2 extinction
// mean_free_path) the density at which half of the space is cloud. e is noise of mean 1/2: Worley noise of 160, 80
// and 40 m (DetailOptions::size_m), with a medium one of 21 to 5 m and a fine one of 2.5 to 0.6 m near the eye, and
// mask(u) = clamp(u / softness + 1/2, 0, 1). G(C) is the fraction of the noise below C, so that the mean over the
// noise is D again: mass is conserved in closed form (cloudy_fraction() in detail_formulas.h), but for the thinnest
// fringe, which holds no cloud, and for the few bumps that a small cloud has. For these the rest is denser by a gain,
// so that the whole field has the mass of the grid.
//
// The noise lies fixed in air that drifts with the wind. It varies with the height above the base (billows above,
// wisps below) and with the growth of the cloud, -1 where it dissolves (shreds) to 1 where it grows (crisp bumps).
// Detail smaller than a footprint, the size of a pixel or a voxel, fades.

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/vec.h"
#include "density/density_grid.h"
#include "density/options.h"

namespace nephos {

// What detail depends on beside the density.
struct DetailSetting {
    DetailOptions options;
    double extinction_per_m = 0.02;      // at density 1
    double metaball_radius_cells = 2.0;  // 1..8
    double opacity = 1;                  // density of saturated cells, 0..1
    Vec3 drift_m{};                      // how far the wind has carried the air
    Vec2 along{1, 0};                    // unit direction of DetailOptions::stretch
    Boundaries boundaries;               // of the grid; an open axis ends the cloud
};

// Largest number of clouds with detail in a picture.
inline constexpr std::size_t kMaxDetailedClouds = 16;

class CoverageCells;
class NodeSums;

// ErosionConstants::whole of a field with DetailOptions::strength 0, whose density is that of the metaballs.
inline constexpr float kWhole = 8;

// The constants of the erosion, as kernels and shaders read them.
struct ErosionConstants {
    float half_density = 0.1f;
    float cap = 0.7f;  // the erosion makes nothing denser than this
    float base_width = 0.5f, top_width = 0.62f, dissolving_width = 0.9f, medium_width = 0.17f,
          fine_width = 0.03f;
    float wisps = 1;
    float least_coverage = 0.03f;  // of less there is no cloud, whatever the noise
    float whole = 0;               // added to coverage: 0, or kWhole where nothing is eroded
    float base_m = 0;              // of the cloud, above the field's corner
    std::array<float, 2> gain{};   // for footprints up to 13 m, and from 25 m on
    // Rows that turn a place relative to the field's corner into one in the large noise, in tiles; the fourth
    // numbers are its offset.
    std::array<std::array<float, 4>, 3> to_noise{};
    float medium_scale = 15, fine_scale = 128;  // tiles of the small noise in one of the large
    // Voxels of the small noise per metre at its level 0, for bumps of 160 m; footprints times footprint_scale are those
    // that detail with such bumps would have.
    float medium_per_m = 1, fine_per_m = 1, footprint_scale = 1;
    bool operator==(const ErosionConstants&) const = default;
};

// The density of a grid's metaballs, sampled at the corners of half cells, in bricks of 8 x 8 x 8 of them. An
// immutable value after build; const functions are thread-safe.
class CoverageField {
  public:
    static constexpr int kBrickNodes = 9;  // on an edge; those of a face belong to both bricks
    static constexpr int kBrickCells = 4;  // cells of the lattice on an edge
    static constexpr std::size_t kBrickBytes = 1460;  // two for each node, and two more

    // Samples D at all nodes where it is above 0. `moisture`, of the same extent, says how much the cloud grows: not at
    // all where it has its mean over the cloud, by 1 from twice that on, by -1 at 0. Without it nothing grows or
    // dissolves. Beyond open boundaries there is no cloud. Throws Error(usage) when a setting is out of range, and when
    // the field has more than 2^31 bytes.
    CoverageField(const DensityGrid& grid, const DetailSetting& setting, const DensityGrid* moisture = nullptr);

    // World place of the first node, and the distance between nodes (half a cell), metres.
    const Vec3& corner_m() const { return corner_m_; }
    double node_m() const { return node_m_; }
    // Bricks on each axis.
    const std::array<int, 3>& bricks() const { return bricks_; }
    // For each brick, x fastest: its number among those that hold cloud; or -n where there is none within less
    // than n bricks in any direction, at most -127.
    const std::vector<std::int32_t>& table() const { return table_; }
    // Index in table() of each brick that holds cloud, rising.
    const std::vector<std::int32_t>& places() const { return places_; }
    // kBrickBytes of each of these: t of each node, x fastest (detail_formulas.h; 0..255 for 0..1), each followed by
    // its growth (1..255 for -1..1).
    const std::vector<std::uint8_t>& nodes() const { return nodes_; }
    // kBrickCells^3 of each of these, x fastest: the number of cells to the next that may hold cloud, at most 4.
    const std::vector<std::uint8_t>& clearance() const { return clearance_; }

    // kBrickCells^3 of each of these, x fastest: the mean detailed density of each cell, of eight samples whose
    // footprint is half a cell.
    const std::vector<float>& cell_density() const { return cell_density_; }

    const ErosionConstants& erosion() const { return erosion_; }
    double extinction_per_m() const { return extinction_per_m_; }
    std::size_t memory_bytes() const;

  private:
    void find_places(const CoverageCells& cells, const Boundaries& boundaries, const std::array<int, 3>& extent,
                     int before, int reach);
    void sample_nodes(const CoverageCells& cells, const NodeSums& sums, int before);
    // `counted`: 1 for each layer of cells on each axis whose mass is that of the grid, not of an image.
    void measure_cells(const std::array<std::vector<std::uint8_t>, 3>& counted);
    void set_erosion(const DetailSetting& setting, double base_m);
    float gain_at(double footprint_m) const;

    Vec3 corner_m_{};
    double node_m_ = 1, extinction_per_m_ = 0;
    std::array<int, 3> bricks_{};
    std::vector<std::int32_t> table_, places_;
    std::vector<std::uint8_t> nodes_, clearance_;
    std::vector<float> cell_density_;
    std::array<double, 256> histogram_{};  // of t over the nodes
    double mass_ = 0;                      // sum of D over the nodes, without thermals
    ErosionConstants erosion_;
};

// Returns the detailed density at the middles of count[0] x count[1] x count[2] boxes of edge `footprint_m`, x
// fastest; the first box begins at `corner_m` in the world.
std::vector<float> detailed_density(const CoverageField& field, const Vec3& corner_m,
                                    const std::array<int, 3>& count, double footprint_m);

// The same in the middles of the 8 x 8 x 8 boxes between the nodes of a brick that holds cloud, by its number; x
// fastest.
void detailed_density_of_brick(const CoverageField& field, std::size_t number, std::span<float> out);

// The same for one place, in double-free scalar code: the reference of the kernels.
float detailed_density_at(const CoverageField& field, const Vec3& place_m, float footprint_m);

// Samples detailed density at the centres of voxels `refine` times smaller than those of the grid that `field` was
// made of, whose extent and placement are given. Throws as resample() in metaballs.h.
DensityGrid resample_with_detail(const CoverageField& field, Extent extent, const Placement& placement, int refine);

// Throws Error(usage) naming the first option that is out of its range.
void check(const DetailOptions& options);

}  // namespace nephos
