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
#include "render/cloud/diffusion_solver.h"
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
    std::size_t octet = 0, number = 0;
};

Place place_of(const CoverageField& field, const DiffusionCells& cells, const Cell& cell) {
    const auto& size = field.bricks();
    const int at = field.places()[cells.brick_of(cell.octet)];
    const Place brick{at % size[0], at / size[0] % size[1], at / size[0] / size[1]};
    Place place;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const int number = int(cell.number >> axis & 1), octet = int(cells.within_brick(cell.octet) >> axis & 1);
        place[axis] = cells.octets_of_brick == 1 ? 2 * brick[axis] + number : 4 * brick[axis] + 2 * octet + number;
    }
    return place;
}

// Fluence, source and coefficients, one cell after the other.
class Naive {
  public:
    Naive(const CoverageField& field, const DiffusionCells& cells) : cells_(cells) {
        for (std::size_t octet = 0; octet < cells.octets; ++octet)
            for (std::size_t n = 0; n < kDiffusionCells; ++n) all_[place_of(field, cells, {octet, n})] = {octet, n};
    }
    const std::map<Place, Cell>& all() const { return all_; }
    double thickness(const Place& at) const {
        const auto found = all_.find(at);
        return found == all_.end() ? 0 : double(of(cells_.thickness, found->second));
    }
    static float of(const std::vector<Octet>& values, const Cell& cell) {
        return values[cell.octet].of[cell.number];
    }
    static Place beside(Place at, int direction) {
        at[std::size_t(direction / 2)] += direction % 2 == 0 ? -1 : 1;
        return at;
    }
    static double loss(double thickness) { return 1 / (2 + 1.5 * thickness); }
    // Flux per difference of fluence through a face.
    double through(const Place& at, int direction) const {
        const double a = thickness(at), b = thickness(beside(at, direction));
        if (b > 0) return std::min(a, b) <= 1e-6f ? loss(std::max(a, b)) : std::min(1 / (1.5 * (a + b)), cells_.octets_of_brick == 1 ? 10.0 : 7.0);
        double open[3] = {};
        for (int n = 0; n < 6; ++n) open[n / 2] += thickness(beside(at, n)) > 0 ? 0 : 1;
        return std::hypot(open[0], open[1], open[2]) / (open[0] + open[1] + open[2]) * loss(a);
    }
    // Light that leaves through a face without cloud at once.
    double leaves(const Place& at, int direction) const {
        if (leaving.empty() || thickness(beside(at, direction)) > 0) return 0;
        const Cell& cell = all_.at(at);
        const bool upper = (cell.number >> (direction / 2) & 1) != 0, outer = upper == (direction % 2 != 0);
        return double(leaving[cell.octet][std::size_t(direction / 2 * 2 + (outer ? 1 : 0))].of[cell.number]);
    }
    // Flux out of a cell through a face.
    double flux(const Place& at, int direction, const std::vector<Octet>& fluence, const FluenceOutside& sky) const {
        const Place next = beside(at, direction);
        const double other = thickness(next) > 0 ? double(of(fluence, all_.at(next))) : double(sky[std::size_t(direction)]);
        return through(at, direction) * (double(of(fluence, all_.at(at))) - other) + leaves(at, direction);
    }
    // Weight, fluence, and flux to the east, north and up.
    std::array<double, 5> light(const Place& at, const std::vector<Octet>& fluence, const FluenceOutside& sky) const {
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
            result[1] += arriving + 2 * loss(thickness(next)) * (there[1] - arriving) + 2 * leaves(next, n ^ 1);
            for (std::size_t i = 2; i < 5; ++i) result[i] += there[i];
            ++count;
        }
        for (double& value : result) value /= std::max(count, 1.0);
        result[0] = count > 0 ? 10 : 0;
        return result;
    }

    std::vector<NumbersOfFaces> leaving;

  private:
    const DiffusionCells& cells_;
    std::map<Place, Cell> all_;
};

// Cells of two lattice cells, and of one.
class DiffusionCellsOf : public testing::TestWithParam<std::size_t> {
  protected:
    static DiffusionCells cells_of(const CloudVolume& volume) {
        DiffusionCells wide = wide_cells(volume.field, volume.extinction, double(kCosine));
        return GetParam() == 1 ? wide : halved(wide, volume.extinction);
    }
};

constexpr FluenceOutside kSky{0.5f, 0.4f, 0.3f, 0.6f, 0.1f, 1.0f};

TEST_P(DiffusionCellsOf, EmptyCellsBetweenCloudAreFoldsAndNoOthers) {
    const CloudVolume volume = heaps(3);
    const DiffusionCells cells = cells_of(volume);
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
TEST_P(DiffusionCellsOf, SolutionsBalanceInEveryCell) {
    const CloudVolume volume = heaps(5);
    const DiffusionCells cells = cells_of(volume);
    const Naive naive(volume.field, cells);
    const std::vector<Octet> source = light_from_outside(cells, kSky);
    const std::vector<Octet> fluence = solve(cells, source, kAlbedo);
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
    EXPECT_LT(std::sqrt(squares / all), 2.5e-3);
}

// Light that starts somewhere in each cell of cloud.
std::vector<StartingLight> lamps(const Naive& naive, std::size_t octets) {
    std::vector<StartingLight> starting(octets);
    int seed = 100;
    const auto random = [&](const Place& at) { return float(test::voxel_noise(at[0], at[1], at[2], ++seed)); };
    for (const auto& [place, cell] : naive.all()) {
        if (!(naive.thickness(place) > 0)) continue;
        starting[cell.octet].light.of[cell.number] = random(place);
        for (Octet& axis : starting[cell.octet].place) axis.of[cell.number] = 2 * random(place) - 1;
    }
    return starting;
}

// The part of a cell's light that each of its faces takes.
std::array<double, 6> shares(const Naive& naive, const Place& at, const StartingLight& octet, std::size_t number) {
    std::array<double, 6> result{};
    double sum = 0;
    for (int n = 0; n < 6; ++n) {
        const double place = (n % 2 == 0 ? -1 : 1) * double(octet.place[std::size_t(n / 2)].of[number]);
        result[std::size_t(n)] = 1.5 * naive.thickness(at) * std::max(place, 0.0) * naive.through(at, n);
        sum += result[std::size_t(n)];
    }
    for (double& share : result) share /= std::max(sum, 1.0);
    return result;
}

TEST_P(DiffusionCellsOf, LightThatStartsBesideTheMiddleIsShared) {
    const CloudVolume volume = heaps(13);
    const DiffusionCells cells = cells_of(volume);
    const Naive naive(volume.field, cells);
    const std::vector<StartingLight> starting = lamps(naive, cells.octets);
    std::map<Place, double> source, leaving[6];
    double started = 0;
    for (const auto& [place, cell] : naive.all()) {
        const double light = double(starting[cell.octet].light.of[cell.number]);
        const std::array<double, 6> parts = shares(naive, place, starting[cell.octet], cell.number);
        started += light;
        source[place] += light;
        for (int n = 0; n < 6; ++n) {
            const Place next = Naive::beside(place, n);
            const double share = light * parts[std::size_t(n)];
            source[place] -= share;
            if (naive.thickness(next) > 0)
                source[next] += share;
            else
                leaving[n][place] = share;
        }
    }
    const SharedLight shared = share_light(cells, starting);
    double arrived = 0, left = 0;
    for (const auto& [place, cell] : naive.all()) {
        ASSERT_NEAR(double(Naive::of(shared.source, cell)), source[place], 1e-5);
        arrived += double(Naive::of(shared.source, cell));
        for (int axis = 0; axis < 3; ++axis) {
            // Of an upper cell the inner face is the lower one.
            const int inner = 2 * axis + ((cell.number >> axis & 1) != 0 ? 0 : 1);
            const NumbersOfFaces& faces = shared.leaving[cell.octet];
            ASSERT_NEAR(double(faces[std::size_t(2 * axis)].of[cell.number]), leaving[inner][place], 1e-5);
            ASSERT_NEAR(double(faces[std::size_t(2 * axis + 1)].of[cell.number]), leaving[inner ^ 1][place], 1e-5);
            left += leaving[inner][place] + leaving[inner ^ 1][place];
        }
    }
    EXPECT_NEAR(arrived + left, started, 1e-4 * started);
    EXPECT_GT(left, 0.001 * started);
}

TEST_P(DiffusionCellsOf, LightIsThatOfItsDefinition) {
    const CloudVolume volume = heaps(7);
    const DiffusionCells cells = cells_of(volume);
    Naive naive(volume.field, cells);
    const SharedLight shared = share_light(cells, lamps(naive, cells.octets));
    const std::vector<Octet> fluence = solve(cells, shared.source, kAlbedo);
    naive.leaving = shared.leaving;
    const std::vector<LightOfCells> light = light_of_cells(cells, fluence, kSky, naive.leaving);
    for (const auto& [place, cell] : naive.all()) {
        const std::array<double, 5> expected = naive.light(place, fluence, kSky);
        for (std::size_t n = 0; n < expected.size(); ++n) {
            const double found = double(light[cell.octet][n].of[cell.number]),
                         weighted = n == 0 ? expected[0] : expected[0] * expected[n];
            ASSERT_NEAR(found, weighted, 2e-5 * std::max(1.0, std::abs(weighted))) << "cell " << cell.number << " of octet "
                                                                          << cell.octet << ", number " << n;
        }
    }
}

TEST_P(DiffusionCellsOf, ThreadsDoNotCount) {
    const CloudVolume volume = heaps(11);
    const auto fluence_of = [&](int threads) {
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, std::size_t(threads));
        const DiffusionCells cells = cells_of(volume);
        std::vector<float> all;
        for (const Octet& brick : solve(cells, light_from_outside(cells, kSky), kAlbedo))
            all.insert(all.end(), brick.of.begin(), brick.of.end());
        return all;
    };
    const std::vector<float> one = fluence_of(1);
    EXPECT_EQ(one, fluence_of(2));
    EXPECT_EQ(one, fluence_of(7));
    EXPECT_GT(*std::max_element(one.begin(), one.end()), 0.3f);
}

INSTANTIATE_TEST_SUITE_P(Widths, DiffusionCellsOf, testing::Values(1, 8),
                         [](const auto& octets) { return octets.param == 1 ? "Wide" : "OfTheLattice"; });

double root_mean_square(const DiffusionCells& cells, const std::vector<Octet>& a, const std::vector<Octet>& b) {
    double squares = 0, count = 0;
    for (const std::int32_t octet : cells.active) {
        for (std::size_t n = 0; n < kDiffusionCells; ++n, ++count) {
            const double difference = double(a[std::size_t(octet)].of[n]) - double(b[std::size_t(octet)].of[n]);
            squares += difference * difference;
        }
    }
    return std::sqrt(squares / count);
}

// A dense cloud, in which light goes from cell to cell many times.
CloudVolume thick_block() {
    const Extent extent{48, 40, 32};
    std::vector<float> values(extent.cells(), 0.0f);
    for (int z = 4; z < 28; ++z)
        for (int y = 3; y < 37; ++y)
            for (int x = 5; x < 43; ++x)
                values[linear_index(extent, x, y, z)] = 0.3f + 0.7f * test::voxel_noise(x / 3, y / 3, z / 3, 17);
    DetailedVoxels part;
    part.density = DensityGrid::from_dense(values, extent, {{0, 0, 1000}, 40});
    part.setting.extinction_per_m = 0.1;
    return CloudVolume(part);
}

// Wide cells change the way to the solution alone, and shorten it: six turns have 24 steps on the lattice's cells.
TEST(DiffusionSolver, WideCellsLeadToTheSameSolution) {
    for (const CloudVolume& volume : {heaps(19), thick_block()}) {
        const DiffusionCells wide = wide_cells(volume.field, volume.extinction, double(kCosine)),
                             cells = halved(wide, volume.extinction);
        const Naive naive(volume.field, cells);
        for (const std::vector<Octet>& source :
             {light_from_outside(cells, kSky), share_light(cells, lamps(naive, cells.octets)).source}) {
            const std::vector<Octet> alone = solve(cells, source, kAlbedo);
            const double all = root_mean_square(cells, alone, std::vector<Octet>(cells.octets + 1));
            EXPECT_GT(all, 0.1);
            const auto error = [&](int turns) {
                return root_mean_square(cells, solve(cells, wide, source, kAlbedo, turns), alone) / all;
            };
            EXPECT_LT(error(6), 0.01);
            EXPECT_GT(error(1), 2 * error(6));
        }
    }
}

TEST(DiffusionSolver, TwoLevelsDoNotDependOnThreads) {
    const CloudVolume volume = thick_block();
    const auto fluence_of = [&](int threads) {
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, std::size_t(threads));
        const DiffusionCells wide = wide_cells(volume.field, volume.extinction, double(kCosine)),
                             cells = halved(wide, volume.extinction);
        std::vector<float> all;
        for (const Octet& octet : solve(cells, wide, light_from_outside(cells, kSky), kAlbedo))
            all.insert(all.end(), octet.of.begin(), octet.of.end());
        return all;
    };
    EXPECT_EQ(fluence_of(1), fluence_of(3));
}

// In the shade of others hardly any light is left to diffuse.
TEST(DiffusionSolver, NumbersNextToNothingStayNumbers) {
    const CloudVolume volume = thick_block();
    const DiffusionCells wide = wide_cells(volume.field, volume.extinction, double(kCosine)),
                         cells = halved(wide, volume.extinction);
    for (const float light : {0.0f, 1e-30f, 1e-18f}) {
        std::vector<Octet> source = light_from_outside(cells, kSky);
        for (Octet& octet : source)
            for (float& value : octet.of) value *= light;
        for (const std::vector<Octet>& fluence : {solve(cells, wide, source, kAlbedo), solve(cells, source, kAlbedo)})
            for (const Octet& octet : fluence)
                for (const float value : octet.of) ASSERT_TRUE(value >= 0 && value <= 2 * light) << value;
    }
}

// Cells of the lattice have the extinction of wide ones, in octets where there is any.
TEST(DiffusionCells, HalvesHoldWhatWideCellsHold) {
    const CloudVolume volume = heaps(23);
    const DiffusionCells wide = wide_cells(volume.field, volume.extinction, double(kCosine)),
                         cells = halved(wide, volume.extinction);
    EXPECT_LT(cells.octets, kDiffusionCells * wide.octets);
    for (std::size_t brick = 0; brick < wide.octets; ++brick) {
        for (std::size_t n = 0; n < kDiffusionCells; ++n) {
            float sum = 0;
            for (const float thickness : cells.thickness[cells.octet_of(std::int32_t(brick), n)].of) sum += thickness;
            EXPECT_NEAR(wide.thickness[brick].of[n], 0.25f * sum, 1e-5f);
        }
    }
    EXPECT_EQ(cells.octet_of(std::int32_t(wide.octets), 0), cells.octets);
}

}  // namespace
}  // namespace nephos
