// SPDX-License-Identifier: Apache-2.0
// Sunlight that diffuses through clouds with detail (render/cloud/diffusion.h), against closed forms.

#include <cmath>
#include <cstdio>
#include <numbers>
#include <utility>
#include <vector>

#include <glm/trigonometric.hpp>
#include <gtest/gtest.h>

#include "density/density_grid.h"
#include "density/metaballs.h"
#include "render/cloud/cloud_volume.h"
#include "render/renderer.h"

namespace nephos {
namespace {

constexpr double kCell_m = 20;
constexpr Extent kSlab{160, 160, 40};
constexpr double kThickness_m = kSlab.z * kCell_m;

// A slab without detail, lit from the zenith, in the dark.
DetailedVoxels slab(double depth) {
    DetailedVoxels part;
    part.density = DensityGrid::from_dense(std::vector<float>(kSlab.cells(), 1.0f), kSlab, {{0, 0, 1000}, kCell_m});
    part.setting.options.strength = 0;
    part.setting.options.thermals = 0;
    part.setting.options.apron_cells = 0;
    part.setting.extinction_per_m = depth / kThickness_m;
    return part;
}

RenderOptions lit_from(double sun_elevation_deg, double g) {
    RenderOptions options;
    options.sun.elevation_deg = sun_elevation_deg;
    options.sun.azimuth_deg = 0;
    options.sun.colour = {1, 1, 1};
    options.light.phase = {.kind = Phase::henyey_greenstein, .g = g};
    options.light.ambient_top = options.light.ambient_base = {0, 0, 0};
    options.air = {.extinction_per_m = {0, 0, 0}, .horizon = {0, 0, 0}, .zenith = {0, 0, 0}};
    options.ground.albedo = {0, 0, 0};
    options.level_of_detail.pixels = 0;
    return options;
}

// Radiance of the middle of the slab towards an eye above it, whose direction has the cosine `mu` from the zenith.
double radiance(Renderer& renderer, const DetailedVoxels& part, RenderOptions options, double mu, double azimuth) {
    const std::vector<Metaball> balls = metaballs(part.density, part.setting.metaball_radius_cells);
    std::vector<DetailedVoxels> parts{part};
    parts[0].count = balls.size();
    const Vec3 middle(0.5 * kSlab.x * kCell_m, 0.5 * kSlab.y * kCell_m, 1000 + kThickness_m);
    options.camera.target_m = middle;
    options.camera.position_m = middle + 3000.0 * Vec3(std::sqrt(1 - mu * mu) * std::sin(azimuth),
                                                        std::sqrt(1 - mu * mu) * std::cos(azimuth), mu);
    options.camera.vertical_fov_deg = 2;
    options.camera.width = options.camera.height = 16;
    Splats splats;
    splats.metaballs = {balls, part.setting.extinction_per_m, metaball_normalisation(2), parts};
    const Picture picture = renderer.draw_splats(splats, options);
    double sum = 0;
    for (const float each : picture.beauty) sum += double(each);
    return sum / double(picture.beauty.size());
}

// The two-stream solution for a slab without absorption, `mu` the cosine of the sun's zenith angle: Eddington's approximation (W. E.
// Meador and W. R. Weaver 1980, "Two-Stream Approximations to Radiative Transfer in Planetary Atmospheres", equation 24),
// with the forward peak g^2 cut off (J. H. Joseph, W. J. Wiscombe and J. A. Weinman 1976).
double two_stream_albedo(double depth, double g, double mu = 1) {
    const double cut = g * g, scaled = (1 - cut) * depth, rest = (g - cut) / (1 - cut);
    const double gamma1 = 0.75 * (1 - rest), gamma3 = (2 - 3 * rest * mu) / 4;
    return (gamma1 * scaled + (gamma3 - gamma1 * mu) * (1 - std::exp(-scaled / mu))) / (1 + gamma1 * scaled);
}

// Radiance is per irradiance pi: the integral of radiance * cosine over the hemisphere is the albedo.
TEST(DiffuseLight, SlabsHaveTheAlbedoOfTheTwoStreamSolution) {
    Renderer renderer{DeviceOptions{.splatting = Splatting::cpu}};
    // Gauss and Legendre's nodes and weights from 0 to 1; the lowest would look past the slab, and counts 1 %.
    constexpr double kNodes[5] = {0.2308, 0.2308, 0.5, 0.7692, 0.9531}, kCosines[5] = {0.0469, 0.2308, 0.5, 0.7692, 0.9531},
                     kWeights[5] = {0.1185, 0.2393, 0.2844, 0.2393, 0.1185};
    // With wide cells of an optical depth of up to 3, or cells of the lattice of 8. What is left is the error of first-order spherical harmonics where light
    // is scattered little forwards.
    const std::pair<double, double> limits[] = {{0.85, 0.04}, {0.7, 0.04}, {0.5, 0.06}};
    for (const auto& [g, limit] : limits) {
        for (const double depth : {5.0, 20.0, 60.0, 320.0}) {  // the last in cells of the lattice, else in wide ones
            const DetailedVoxels part = slab(depth);
            double albedo = 0;
            for (int n = 0; n < 5; ++n)
                albedo += 2 * kWeights[n] * kCosines[n] * radiance(renderer, part, lit_from(90, g), kNodes[n], 0);
            const double expected = two_stream_albedo(depth, g);
            std::printf("g %.2f, optical depth %2.0f: albedo %.3f, two-stream %.3f (%+.1f %%)\n", g, depth, albedo,
                        expected, 100 * (albedo / expected - 1));
            EXPECT_NEAR(albedo, expected, limit * expected) << "g " << g << ", depth " << depth;
        }
    }
}

// From the side the albedo is larger: less light gets deep. Irradiance is pi times the cosine of the sun's angle.
TEST(DiffuseLight, SlabsAreBrighterUnderALowSun) {
    Renderer renderer{DeviceOptions{.splatting = Splatting::cpu}};
    constexpr double kCosines[4] = {0.2308, 0.5, 0.7692, 0.9531}, kWeights[4] = {0.3578, 0.2844, 0.2393, 0.1185};
    const double mu = std::sin(glm::radians(35.0));
    for (const double g : {0.5, 0.85}) {
        for (const double depth : {5.0, 20.0}) {
            const DetailedVoxels part = slab(depth);
            double albedo = 0;
            for (int n = 0; n < 4; ++n)
                for (int side = 0; side < 4; ++side)
                    albedo += 0.25 * 2 * kWeights[n] * kCosines[n] / mu *
                              radiance(renderer, part, lit_from(35, g), kCosines[n], 0.25 * std::numbers::pi * (1 + 2 * side));
            const double expected = two_stream_albedo(depth, g, mu);
            std::printf("g %.2f, optical depth %2.0f, sun at 35 degrees: albedo %.3f, two-stream %.3f (%+.1f %%)\n", g,
                        depth, albedo, expected, 100 * (albedo / expected - 1));
            EXPECT_NEAR(albedo, expected, 0.08 * expected) << "g " << g << ", depth " << depth;
            EXPECT_GT(albedo, two_stream_albedo(depth, g)) << "g " << g << ", depth " << depth;
        }
    }
}

}  // namespace
}  // namespace nephos
