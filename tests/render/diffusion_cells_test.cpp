// SPDX-License-Identifier: Apache-2.0
// The equation of diffusion in vectors of cells (render/cloud/diffusion_cells.h) against its definition, cell by cell.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <map>
#include <vector>

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "density/density_grid.h"
#include "render/cloud/cloud_volume.h"
#include "render/cloud/diffusion_cells.h"
#include "tests/render/voxel_cloud.h"

namespace nephos {
namespace {

constexpr float kCosine = 0.8f;
constexpr double kAlbedo = 0.999;

// Separate heaps and holes, so that there are folds, flanks and cells beside cloud.
CloudVolume heaps(int seed) {
    const Extent extent{40, 36, 24};
    std::vector<float> values(extent.cells(), 0.0f);
    for (int z = 0; z < extent.z; ++z)
        for (int y = 0; y < extent.y; ++y)
            for (int x = 0; x < extent.x; ++x)
                if (test::voxel_noise(x / 5, y / 5, z / 5, seed) > 0.6f)
                    values[linear_index(extent, x, y, z)] = test::voxel_noise(x, y, z, seed + 1);
    DetailedVoxels part;
    part.density = DensityGrid::from_dense(values, extent, {{0, 0, 1000}, 40});
    part.setting.extinction_per_m = 0.05;
    return CloudVolume(part);
}

// A cell by its place on a lattice of cells.
using Place = std::array<int, 3>;
struct Cell {
    std::size_t brick = 0, number = 0;
};

Place place_of(const CoverageField& field, const Cell& cell) {
    const auto& size = field.bricks();
    const int at = field.places()[cell.brick], number = int(cell.number);
    return {2 * (at % size[0]) + number % 2, 2 * (at / size[0] % size[1]) + number / 2 % 2,
            2 * (at / size[0] / size[1]) + number / 4};
}

// Fluence, source and coefficients, one cell after the other.
class Naive {
  public:
    Naive(const CoverageField& field, const DiffusionCells& cells) : cells_(cells) {
        for (std::size_t brick = 0; brick < cells.bricks; ++brick)
            for (std::size_t n = 0; n < kDiffusionCells; ++n) all_[place_of(field, {brick, n})] = {brick, n};
    }
    const std::map<Place, Cell>& all() const { return all_; }
    double thickness(const Place& at) const {
        const auto found = all_.find(at);
        return found == all_.end() ? 0 : double(of(cells_.thickness, found->second));
    }
    static float of(const std::vector<BrickOfCells>& values, const Cell& cell) {
        return values[cell.brick].of[cell.number];
    }
    static Place beside(Place at, int direction) {
        at[std::size_t(direction / 2)] += direction % 2 == 0 ? -1 : 1;
        return at;
    }
    static double loss(double thickness) { return 1 / (2 + 1.5 * thickness); }
    // Flux per difference of fluence through a face.
    double through(const Place& at, int direction) const {
        const double a = thickness(at), b = thickness(beside(at, direction));
        if (b > 0) return std::min(a, b) <= 1e-6f ? loss(std::max(a, b)) : std::min(1 / (1.5 * (a + b)), 10.0);
        double open[3] = {};
        for (int n = 0; n < 6; ++n) open[n / 2] += thickness(beside(at, n)) > 0 ? 0 : 1;
        return std::hypot(open[0], open[1], open[2]) / (open[0] + open[1] + open[2]) * loss(a);
    }
    // Flux out of a cell through a face.
    double flux(const Place& at, int direction, const std::vector<BrickOfCells>& fluence, const FluenceOutside& sky) const {
        const Place next = beside(at, direction);
        const double other = thickness(next) > 0 ? double(of(fluence, all_.at(next))) : double(sky[std::size_t(direction)]);
        return through(at, direction) * (double(of(fluence, all_.at(at))) - other);
    }
    // Weight, fluence, and flux to the east, north and up.
    std::array<double, 5> light(const Place& at, const std::vector<BrickOfCells>& fluence, const FluenceOutside& sky) const {
        std::array<double, 5> result{};
        if (thickness(at) > 0) {
            result = {1 / (thickness(at) + 0.1), double(of(fluence, all_.at(at)))};
            for (int n = 0; n < 6; ++n)
                result[2 + std::size_t(n / 2)] += (n % 2 == 0 ? -0.5 : 0.5) * flux(at, n, fluence, sky);
            return result;
        }
        double count = 0;
        for (int n = 0; n < 6; ++n) {
            const Place next = beside(at, n);
            if (!(thickness(next) > 0)) continue;
            const std::array<double, 5> there = light(next, fluence, sky);
            const double arriving = double(sky[std::size_t(n ^ 1)]);
            result[1] += arriving + 2 * loss(thickness(next)) * (there[1] - arriving);
            for (std::size_t i = 2; i < 5; ++i) result[i] += there[i];
            ++count;
        }
        for (double& value : result) value /= std::max(count, 1.0);
        result[0] = count > 0 ? 10 : 0;
        return result;
    }

  private:
    const DiffusionCells& cells_;
    std::map<Place, Cell> all_;
};

constexpr FluenceOutside kSky{0.5f, 0.4f, 0.3f, 0.6f, 0.1f, 1.0f};

TEST(DiffusionCells, EmptyCellsBetweenCloudAreFoldsAndNoOthers) {
    const CloudVolume volume = heaps(3);
    const DiffusionCells cells(volume.field, volume.extinction, double(kCosine));
    const Naive naive(volume.field, cells);
    std::size_t folds = 0, empty = 0, cloud = 0;
    for (const auto& [place, cell] : naive.all()) {
        const float thickness = Naive::of(cells.thickness, cell);
        int beside = 0;
        for (int n = 0; n < 6; ++n) beside += naive.thickness(Naive::beside(place, n)) > 2e-6 ? 1 : 0;
        if (thickness == 0) {
            EXPECT_LE(beside, 1);
            ++empty;
        } else if (thickness < 2e-6f) {
            EXPECT_GE(beside, 2);
            ++folds;
        } else {
            ++cloud;
        }
    }
    EXPECT_GT(folds, 10u);
    EXPECT_GT(empty, 100u);
    EXPECT_GT(cloud, 1000u);
}

// What leaves each cell is what comes in and what it scatters, but for the residual that ends the iterations.
TEST(DiffusionCells, SolutionsBalanceInEveryCell) {
    const CloudVolume volume = heaps(5);
    const DiffusionCells cells(volume.field, volume.extinction, double(kCosine));
    const Naive naive(volume.field, cells);
    const std::vector<BrickOfCells> source = light_from_outside(cells, kSky);
    const std::vector<BrickOfCells> fluence = solve(cells, source, kAlbedo);
    double squares = 0, all = 0;
    for (const auto& [place, cell] : naive.all()) {
        const double thickness = naive.thickness(place);
        if (!(thickness > 0)) {
            EXPECT_EQ(Naive::of(fluence, cell), 0.0f);
            continue;
        }
        double balance = (1 - kAlbedo) * thickness / (1 - double(kCosine)) * double(Naive::of(fluence, cell)), light = 0;
        for (int n = 0; n < 6; ++n) {
            balance += naive.flux(place, n, fluence, kSky);
            if (!(naive.thickness(Naive::beside(place, n)) > 0)) light += naive.through(place, n) * double(kSky[std::size_t(n)]);
        }
        EXPECT_NEAR(light, double(Naive::of(source, cell)), 1e-6);
        squares += balance * balance;
        all += light * light;
    }
    EXPECT_LT(std::sqrt(squares / all), 2e-3);
}

TEST(DiffusionCells, LightIsThatOfItsDefinition) {
    const CloudVolume volume = heaps(7);
    const DiffusionCells cells(volume.field, volume.extinction, double(kCosine));
    const Naive naive(volume.field, cells);
    const std::vector<BrickOfCells> fluence = solve(cells, light_from_outside(cells, kSky), kAlbedo);
    const std::vector<LightOfCells> light = light_of_cells(cells, fluence, kSky);
    for (const auto& [place, cell] : naive.all()) {
        const std::array<double, 5> expected = naive.light(place, fluence, kSky);
        for (std::size_t n = 0; n < expected.size(); ++n) {
            const double found = double(light[cell.brick][n].of[cell.number]),
                         weighted = n == 0 ? expected[0] : expected[0] * expected[n];
            ASSERT_NEAR(found, weighted, 2e-5 * std::max(1.0, expected[0])) << "cell " << cell.number << " of brick "
                                                                          << cell.brick << ", number " << n;
        }
    }
}

TEST(DiffusionCells, ThreadsDoNotCount) {
    const CloudVolume volume = heaps(11);
    const auto fluence_of = [&](int threads) {
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, std::size_t(threads));
        const DiffusionCells cells(volume.field, volume.extinction, double(kCosine));
        std::vector<float> all;
        for (const BrickOfCells& brick : solve(cells, light_from_outside(cells, kSky), kAlbedo))
            all.insert(all.end(), brick.of.begin(), brick.of.end());
        return all;
    };
    const std::vector<float> one = fluence_of(1);
    EXPECT_EQ(one, fluence_of(2));
    EXPECT_EQ(one, fluence_of(7));
    EXPECT_GT(*std::max_element(one.begin(), one.end()), 0.3f);
}

}  // namespace
}  // namespace nephos
