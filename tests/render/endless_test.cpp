// SPDX-License-Identifier: Apache-2.0
// Clouds of periodic lattices, which go on to the horizon: their light, their shade and their pictures.

#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "density/density_grid.h"
#include "density/metaballs.h"
#include "render/cloud/cloud_volume.h"
#include "render/options/sun_position.h"
#include "render/renderer.h"
#include "tests/render/picture_checks.h"
#include "tests/render/voxel_cloud.h"

namespace nephos {
namespace {

constexpr Extent kExtent{16, 20, 12};
constexpr double kCell = 40, kExtinction = 0.02;
constexpr Vec3 kOrigin{-300, 200, 1000};

// Cloud of noise in half of the cells, or everywhere the same; `copies` of it beside each other on both axes.
DensityGrid layer(bool even, int copies = 1) {
    const Extent extent{kExtent.x * copies, kExtent.y * copies, kExtent.z};
    std::vector<float> values(extent.cells(), 0.0f);
    for (int z = 3; z < 9; ++z)
        for (int y = 0; y < extent.y; ++y)
            for (int x = 0; x < extent.x; ++x) {
                const auto noise = float(test::voxel_noise(x % kExtent.x / 3, y % kExtent.y / 3, z / 2, 5));
                values[linear_index(extent, x, y, z)] = even ? 0.5f : std::max(noise - 0.4f, 0.0f);
            }
    const Vec3 before = double(copies / 2) * kCell * Vec3(kExtent.x, kExtent.y, 0);
    return DensityGrid::from_dense(values, extent, {kOrigin - before, kCell});
}

// Its metaballs as they are, without erosion.
DetailedVoxels plain(DensityGrid grid, bool periodic) {
    DetailedVoxels part{.density = std::move(grid)};
    part.setting.extinction_per_m = kExtinction;
    part.setting.metaball_radius_cells = 1.5;
    part.setting.options.strength = part.setting.options.thermals = 0;
    part.setting.options.apron_cells = 0;
    if (periodic) part.setting.boundaries.x = part.setting.boundaries.y = Boundary::periodic;
    return part;
}

std::vector<CloudVolume> lit(const DetailedVoxels& part, const Vec3& to_sun, const CloudLight& light = {}) {
    std::vector<CloudVolume> volumes;
    volumes.emplace_back(part);
    light_volumes(volumes, to_sun, light, true);
    return volumes;
}

Vec3 sun(double azimuth_deg, double elevation_deg) {
    Sun at;
    at.azimuth_deg = azimuth_deg;
    at.elevation_deg = elevation_deg;
    return direction_to_sun(at);
}

TEST(EndlessCloud, EvenLayerIsAsDeepAsItsSlantIsLong) {
    for (const double elevation : {90.0, 40.0, 12.0, 3.0}) {
        const std::vector<CloudVolume> volumes = lit(plain(layer(true), true), sun(117, elevation));
        const double slant = 6 * kCell * 0.5 * kExtinction / std::sin(elevation * 3.14159265358979 / 180);
        for (int n = 0; n < 200; ++n) {
            const Vec3 below = kOrigin + Vec3(n * 977 % 20000 - 10000, n * 691 % 20000 - 10000, -500);
            EXPECT_NEAR(sun_depth_at(volumes[0], below), slant, 0.02 * slant);
            EXPECT_EQ(sun_depth_at(volumes[0], below + Vec3(0, 0, 2000)), 0.0f);
        }
    }
}

// The naive twin: so many copies beside each other that no light comes past them.
TEST(EndlessCloud, DepthsAreThoseBetweenManyCopies) {
    for (const double elevation : {60.0, 25.0}) {
        const Vec3 to_sun = sun(205, elevation);
        const std::vector<CloudVolume> endless = lit(plain(layer(false), true), to_sun),
                                       many = lit(plain(layer(false, 5), false), to_sun);
        double largest = 0, squares = 0;
        for (int n = 0; n < 2000; ++n) {
            const Vec3 place = kOrigin + Vec3(n * 37 % 640, n * 53 % 800, n * 29 % 480);
            const float depth = sun_depth_at(endless[0], place), expected = sun_depth_at(many[0], place);
            largest = std::max(largest, double(expected));
            // A low sun sweeps the copies along another axis.
            const double most = elevation > 45 ? 0.03 * double(expected) + 0.03 : 0.25;
            EXPECT_NEAR(depth, expected, most) << n << ' ' << elevation;
            squares += std::pow(depth - expected, 2);
            const Vec3 image = place + kCell * Vec3(3 * kExtent.x, -7 * kExtent.y, 0);
            EXPECT_NEAR(sun_depth_at(endless[0], image), depth, 1e-3);
        }
        EXPECT_GT(largest, 1);
        EXPECT_LT(std::sqrt(squares / 2000), 0.08);
    }
}

TEST(EndlessCloud, DiffuseLightHasNoSides) {
    const auto range = [](const CloudVolume& volume, const std::vector<std::uint16_t>& of) {
        // Of nodes in the middle of the layer, whichever brick they are in.
        int least = 255, most = 0;
        for (std::size_t brick = 0; brick < volume.field.places().size(); ++brick) {
            const int layers = volume.field.bricks()[0] * volume.field.bricks()[1];
            const double base = volume.field.corner_m().z + 4 * kCell * (volume.field.places()[brick] / layers);
            const int node = int(std::lround((kOrigin.z + 6 * kCell - base) / kCell));
            if (node < 0 || node >= kLightNodes) continue;
            const int value = of[brick * kLightNodesOfBrick + std::size_t(node * kLightNodes * kLightNodes + 12)] & 255;
            least = std::min(least, value);
            most = std::max(most, value);
        }
        return most - least;
    };
    // On wide cells, and on those of the lattice.
    for (const double extinction_per_m : {kExtinction, 6 * kExtinction}) {
        const auto lit_layer = [&](bool to_horizon) {
            DetailedVoxels part = plain(layer(true), to_horizon);
            part.setting.extinction_per_m = extinction_per_m;
            return lit(part, sun(205, 40));
        };
        const std::vector<CloudVolume> endless = lit_layer(true), open = lit_layer(false);
        EXPECT_EQ(is_thick(wide_cells(open[0].field, open[0].extinction, open[0].mean_cosine), extinction_per_m),
                  extinction_per_m > kExtinction);
        EXPECT_LE(range(endless[0], endless[0].diffuse.upwards), 1);
        EXPECT_LE(range(endless[0], endless[0].surroundings), 1);
        EXPECT_GT(range(open[0], open[0].diffuse.upwards), 4);
    }
}

class EndlessPicture : public ::testing::Test {
  protected:
    Picture draw(const DetailedVoxels& part, const RenderOptions& options) {
        const std::vector<DetailedVoxels> parts{part};
        std::vector<DetailedVoxels> all = parts;
        const std::vector<Metaball> balls = metaballs(part.density, 1.5);
        all[0].count = balls.size();
        Splats splats;
        splats.metaballs = {balls, kExtinction, metaball_normalisation(1.5), all};
        return renderer_.draw_splats(splats, options);
    }
    static double covered(const Picture& picture) {
        double sum = 0;
        for (const float each : picture.transmittance) sum += 1 - double(each);
        return sum / double(picture.pixels());
    }
    Renderer renderer_{test::validated(Splatting::cpu)};
};

TEST_F(EndlessPicture, GoesOnWhereTheLatticeEnds) {
    // From 3 km beside the lattice, which lies behind the eye.
    const RenderOptions options = test::view({3000, 3000, 300}, {9000, 9000, 1500}, 40, 64, 48);
    DetailedVoxels part = plain(layer(true), true);
    EXPECT_GT(covered(draw(part, options)), 0.5);
    part.setting.options.to_horizon = false;
    EXPECT_EQ(covered(draw(part, options)), 0);
}

TEST_F(EndlessPicture, ShadesTheGroundBeyondTheLattice) {
    RenderOptions options = test::view({8000, 8000, 600}, {8400, 8000, 0}, 30, 32, 24);
    options.sun.elevation_deg = 50;
    const auto brightness = [&](bool endless) {
        DetailedVoxels part = plain(layer(true), true);
        part.setting.options.to_horizon = endless;
        const Picture picture = draw(part, options);
        double sum = 0;
        for (const float each : picture.beauty) sum += double(each);
        return sum;
    };
    EXPECT_LT(brightness(true), 0.8 * brightness(false));
}

// In images clouds are larger and smaller; all together there is about as much.
TEST_F(EndlessPicture, PatchesKeepTheMean) {
    double sum = 0;
    int count = 0;
    for (int n = 0; n < 24; ++n) {
        const Vec3 from(20000 + 3100 * n, -30000 + 4700 * n, 4000);
        sum += covered(draw(plain(layer(false), true), test::view(from, from + Vec3(1, 0, -3000), 40, 24, 18)));
        ++count;
    }
    const Vec3 home = kOrigin + Vec3(320, 400, 3000);
    const double within = covered(draw(plain(layer(false), true), test::view(home, home + Vec3(1, 0, -3000), 9, 24, 18)));
    EXPECT_NEAR(sum / count, within, 0.25);  // half of the images are thinner, and let more light through
    EXPECT_GT(within, 0.1);
}

}  // namespace
}  // namespace nephos
