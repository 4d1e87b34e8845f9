// SPDX-License-Identifier: Apache-2.0
// The tables of the atmosphere against their naive twin, closed forms and the conservation of energy.

#include "render/atmosphere/atmosphere.h"

#include <cmath>
#include <cstdio>
#include <numbers>
#include <random>

#include <gtest/gtest.h>

#include "render/atmosphere/sky_light.h"
#include "render/shared/shared.h"
#include "tests/reference/with_threads.h"
#include "tests/render/reference_atmosphere.h"

namespace nephos {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kSuns[] = {-18, -12, -8, -6, -4, -2, 0, 2, 5, 15, 40, 90};

double sine(double degrees) { return std::sin(degrees * kPi / 180); }

const Atmosphere& earth() {
    static const Atmosphere air{AtmosphereModel{}};
    return air;
}

// Straight up the columns are H (1 - exp(-depth / H)) and half the ozone's width twice; on the horizon the
// air of a thin exponential layer is sqrt(pi R H / 2) (Chapman 1931, first term and its correction 3 H / 8
// R).
TEST(Atmosphere, TransmittanceHasItsClosedForms) {
    const AtmosphereModel m;
    const double depth = m.top_radius_m - m.ground_radius_m;
    for (const double altitude : {0.0, 300.0, 2'000.0, 12'000.0, 45'000.0}) {
        const auto above = [&](double height) {
            return height * (std::exp(-altitude / height) - std::exp(-depth / height));
        };
        const double below_centre =
            std::clamp(m.ozone_centre_m - altitude, -m.ozone_half_width_m, m.ozone_half_width_m);
        const double w = m.ozone_half_width_m, x = below_centre / w;
        const double ozone = w * (x >= 0 ? 0.5 + x - 0.5 * x * x : 0.5 * (1 + x) * (1 + x));
        const Rgb found = earth().transmittance(altitude, 1);
        for (std::size_t c = 0; c < 3; ++c) {
            const double expected =
                std::exp(-m.rayleigh_per_m[c] * above(m.rayleigh_height_m) -
                         m.mie_extinction_per_m * above(m.mie_height_m) - m.ozone_per_m[c] * ozone);
            EXPECT_NEAR(found[c], expected, 3e-4) << altitude;
        }
    }
    AtmosphereModel molecules = m;
    molecules.mie_extinction_per_m = molecules.mie_scattering_per_m = 0;
    molecules.ozone_per_m = {};
    const Rgb horizon = Atmosphere(molecules).transmittance(0, 0);
    const double r = m.ground_radius_m, h = m.rayleigh_height_m;
    const double column = std::sqrt(kPi * r * h / 2) * (1 + 3 * h / (8 * r));
    for (std::size_t c = 0; c < 3; ++c)
        EXPECT_NEAR(std::log(horizon[c]) / (-m.rayleigh_per_m[c] * column), 1, 0.003);
    EXPECT_EQ(earth().transmittance(0, -0.01), (Rgb{0, 0, 0}));  // meets the ground
}

// Between the nodes of the table, and down to the ray that grazes the ground.
TEST(Atmosphere, SunlightEqualsIntegration) {
    std::mt19937 engine(1);
    const auto uniform = [&] { return engine() / 4294967296.0; };
    for (int n = 0; n < 300; ++n) {
        const double altitude = 60'000 * uniform() * uniform(), elevation = -8 + 98 * uniform() * uniform();
        const Rgb found = earth().sunlight(altitude, elevation);
        const Rgb expected = reference::sunlight(earth().model(), earth().model().ground_radius_m + altitude,
                                                 sine(elevation), 400);
        for (std::size_t c = 0; c < 3; ++c)
            EXPECT_NEAR(found[c], expected[c], 0.01 * expected[c] + 1e-6) << altitude << ' ' << elevation;
    }
}

TEST(Atmosphere, MultipleScatteringEqualsQuadrature) {
    std::mt19937 engine(2);
    const auto uniform = [&] { return engine() / 4294967296.0; };
    double largest = 0;
    for (int n = 0; n < 12; ++n) {
        const double altitude = 40'000 * uniform() * uniform(),
                     elevation = n < 8 ? -10 + 2.5 * n : 90 * uniform();
        const Rgb found = earth().multiple_scattering(altitude, sine(elevation));
        const Rgb expected = reference::multiple_scattering(
            earth().model(), earth().model().ground_radius_m + altitude, sine(elevation), 24, {40, 24});
        for (std::size_t c = 0; c < 3; ++c) {
            largest = std::max(largest, std::abs(found[c] / expected[c] - 1));
            EXPECT_NEAR(found[c] / expected[c], 1, 0.02)
                << altitude << " m, sun at " << elevation << " " << expected[c];
        }
    }
    std::printf("multiple scattering: largest relative error %.4f\n", largest);
}

// The twin's own table of multiple scattering for one ray's surroundings, in logarithms.
class TwinPsi {
  public:
    explicit TwinPsi(const AtmosphereModel& m) : m_(m) {
        for (int j = 0; j < kHeights; ++j)
            for (int i = 0; i < kSines; ++i) {
                const Rgb psi =
                    reference::multiple_scattering(m, m.ground_radius_m + height(j), sun(i), 14, {24, 16});
                for (std::size_t c = 0; c < 3; ++c) logs_[c][j][i] = std::log(std::max(psi[c], 1e-30));
            }
    }
    Rgb operator()(double radius, double sun_sine) const {
        const double x = std::clamp((std::asin(std::clamp(sun_sine, -1.0, 1.0)) * 180 / kPi), -30.0, 90.0);
        const double u = std::clamp(x <= 20 ? 2 * (x + 30) : 100 + (x - 20) / 7, 0.0, kSines - 1.001);
        const double v =
            std::clamp(std::sqrt(std::max(0.0, radius - m_.ground_radius_m) / 100'000) * (kHeights - 1), 0.0,
                       kHeights - 1.001);
        const int i = int(u), j = int(v);
        Rgb psi{};
        for (std::size_t c = 0; c < 3; ++c) {
            const auto& l = logs_[c];
            psi[c] = std::exp((1 - v + j) * ((1 - u + i) * l[j][i] + (u - i) * l[j][i + 1]) +
                              (v - j) * ((1 - u + i) * l[j + 1][i] + (u - i) * l[j + 1][i + 1]));
        }
        return psi;
    }

  private:
    static constexpr int kHeights = 20, kSines = 111;
    static double height(int j) { return 99'999.0 * j * j / ((kHeights - 1) * (kHeights - 1)); }
    static double sun(int i) { return sine(i <= 100 ? 0.5 * i - 30 : 20 + 7 * (i - 100)); }
    AtmosphereModel m_;
    double logs_[3][kHeights][kSines] = {};
};

// Radiance along a ray: `sine` of its elevation (0..1), cosine of its azimuth from the sun's, cosine of the
// angle to the sun. The twin of sky_scattered() in render/shared/air.h.
Rgb sky_radiance(const SkyTable& table, double sine, double cos_azimuth, double cos_to_sun, double mie_g) {
    constexpr std::size_t kColumns = shader::kSkyColumns, kRows = shader::kSkyRows;
    const double x = double(shader::sky_across(float(cos_azimuth))) * double(kColumns - 1),
                 y = double(shader::sky_upwards(float(sine))) * double(kRows - 1);
    const auto i = std::min(std::size_t(x), kColumns - 2), j = std::min(std::size_t(y), kRows - 2);
    const auto at = [&](const std::vector<float>& texels, std::size_t c) {
        const float *a = &texels[4 * (j * kColumns + i) + c], *b = a + 4 * kColumns;
        return std::lerp(std::lerp(double(a[0]), double(a[4]), x - double(i)),
                         std::lerp(double(b[0]), double(b[4]), x - double(i)), y - double(j));
    };
    const double phase = double(shader::particle_phase(float(cos_to_sun), float(mie_g)));
    Rgb radiance{};
    for (std::size_t c = 0; c < 3; ++c) radiance[c] = at(table.scattered, c) + phase * at(table.haze, c);
    return radiance;
}

// 200 directions, a fifth of them near the horizon, and 12 heights of the sun. The error is relative to the
// radiance of each channel, or where that is less, to a hundredth of the brightest for that sun or to 3e-8 of
// the sun's irradiance, less than a thousandth of the default night sky.
TEST(Atmosphere, SkyEqualsBruteForce) {
    std::mt19937 engine(3);
    const auto uniform = [&] { return engine() / 4294967296.0; };
    const TwinPsi psi(earth().model());
    const AtmosphereModel& m = earth().model();
    double worst = 0, sum = 0;
    int count = 0;
    for (const double elevation : kSuns) {
        const double altitude = 300;
        const SkyTable table = earth().sky(altitude, elevation);
        std::vector<std::pair<Rgb, Rgb>> pairs;
        double brightest = 0;
        for (int n = 0; n < 200; ++n) {
            const double up = n < 40 ? 0.03 * uniform() : uniform(), azimuth = kPi * uniform();
            const double cosine = reference::cosine_between(up, sine(elevation), azimuth);
            const Rgb found = sky_radiance(table, up, std::cos(azimuth), cosine, m.mie_g);
            const Rgb expected =
                reference::sky_radiance(m, m.ground_radius_m + altitude, up, azimuth, sine(elevation),
                                        {elevation < -10 ? 300 : 120, 40}, psi);
            pairs.emplace_back(found, expected);
            for (const double value : expected) brightest = std::max(brightest, value);
        }
        double worst_here = 0;
        for (const auto& [found, expected] : pairs)
            for (std::size_t c = 0; c < 3; ++c) {
                const double error =
                    std::abs(found[c] - expected[c]) / std::max({expected[c], 0.01 * brightest, 3e-8});
                worst_here = std::max(worst_here, error);
                sum += error;
                ++count;
                EXPECT_TRUE(found[c] >= 0 && std::isfinite(found[c]));
            }
        EXPECT_LE(worst_here, 0.02) << "sun at " << elevation;
        std::printf("sun at %g: largest relative error %.4f\n", elevation, worst_here);
        worst = std::max(worst, worst_here);
    }
    std::printf("sky against brute force: largest %.4f, mean %.5f\n", worst, sum / count);
}

// What enters leaves: without absorption and over white ground the fluxes down and up are equal at every
// height. Light that is scattered twice and more is an approximation (isotropic, and the same all around), so
// the flux is only nearly closed.
TEST(Atmosphere, ConservesEnergy) {
    AtmosphereModel white;
    white.mie_extinction_per_m = white.mie_scattering_per_m;
    white.ozone_per_m = {};
    white.ground_albedo = {1, 1, 1};
    const Atmosphere air(white);
    double worst = 0;
    for (const double elevation : {10.0, 20.0, 40.0, 60.0, 90.0})
        for (const double altitude : {0.0, 2'000.0, 8'000.0, 16'000.0}) {
            const SkyIrradiance sky = air.irradiance(altitude, elevation);
            const Rgb sun = air.sunlight(altitude, elevation);
            for (std::size_t c = 0; c < 3; ++c) {
                const double down = sky.from_above[c] + sun[c] * sine(elevation);
                const double error = (sky.from_below[c] - down) / sine(elevation);
                worst = std::max(worst, std::abs(error));
                EXPECT_NEAR(error, 0, 0.13) << elevation << " deg, " << altitude << " m, channel " << c;
            }
        }
    std::printf("conservation: largest error %.4f of what enters\n", worst);
}

// Light is never negative, and of a black world without air nothing is left but the sun.
TEST(Atmosphere, FluxesAreNotNegative) {
    AtmosphereModel dark;
    dark.ground_albedo = {};
    dark.mie_scattering_per_m = dark.mie_extinction_per_m = 0;
    dark.rayleigh_per_m = dark.ozone_per_m = {};
    const Atmosphere none(dark);
    for (double elevation = -18; elevation <= 90; elevation += 1.7)
        for (const double altitude : {0.0, 700.0, 9'000.0, 16'000.0}) {
            const SkyIrradiance some = earth().irradiance(altitude, elevation),
                                nothing = none.irradiance(altitude, elevation);
            for (std::size_t c = 0; c < 3; ++c) {
                for (const double value : {some.from_above[c], some.from_below[c], some.sideways[c]})
                    EXPECT_TRUE(value >= 0 && value < 1) << elevation;
                EXPECT_LT(nothing.from_above[c] + nothing.from_below[c], 1e-20);
            }
        }
    EXPECT_EQ(none.sunlight(0, 30), (Rgb{1, 1, 1}));
}

TEST(Atmosphere, PhaseFunctionsIntegrateToOne) {
    double molecules = 0, particles = 0;
    constexpr int kSteps = 20000;
    for (int i = 0; i < kSteps; ++i) {
        const auto cosine = float(-1 + (i + 0.5) * 2.0 / kSteps);
        molecules += double(shader::molecule_phase(cosine)) * 4 * kPi / kSteps;
        particles += double(shader::particle_phase(cosine, 0.8f)) * 4 * kPi / kSteps;
    }
    EXPECT_NEAR(molecules, 1, 1e-4);
    EXPECT_NEAR(particles, 1, 1e-4);
}

// The same bits from any number of threads.
TEST(Atmosphere, DoesNotDependOnThreads) {
    const auto tables = [] {
        const Atmosphere air{AtmosphereModel{}};
        SkyTable sky = air.sky(1200, 3.3);
        for (const double value : air.irradiance(3000, -4).sideways) sky.haze.push_back(float(value));
        return sky;
    };
    const SkyTable one = test::with_threads(1, tables);
    for (std::size_t threads = 2; threads <= 4; ++threads) {
        const SkyTable more = test::with_threads(threads, tables);
        EXPECT_EQ(one.scattered, more.scattered) << threads;
        EXPECT_EQ(one.haze, more.haze) << threads;
    }
}

RenderOptions physical(double elevation_deg) {
    RenderOptions options;
    options.atmosphere.model = AirModel::physical;
    options.sun.elevation_deg = elevation_deg;
    return options;
}

TEST(SkyLight, NodesAreTheInverseOfElevations) {
    double before = -1;
    for (double elevation = -18; elevation <= 90; elevation += 0.13) {
        const double node = sun_node(elevation);
        EXPECT_NEAR(elevation_of_node(node), elevation, 1e-9);
        EXPECT_GT(node, before);
        before = node;
    }
}

// Across a node of the tables nothing jumps, and between two nodes the mixed sky is the sky of that sun.
TEST(SkyLight, ChangesSteadilyWithTheSun) {
    SkyLights lights;
    const auto texels = [&](double elevation) { return lights.at(physical(elevation), {}).texels; };
    double jump = 0, mixed = 0;
    for (const double near : {-12.0, -5.75, -0.5, 0.0, 3.25, 6.0, 16.0, 40.0}) {
        const double elevation = elevation_of_node(std::round(sun_node(near)));
        constexpr double kStep = 1e-6;
        const std::vector<float> before = texels(elevation - kStep), after = texels(elevation + kStep);
        const std::size_t sky = 4 * shader::kSkyColumns * shader::kSkyRows;
        for (std::size_t i = 0; i < 2 * sky; ++i) {
            const double scale = std::max(1e-3, double(before[i]));
            jump = std::max(jump, std::abs(double(after[i]) - double(before[i])) / scale);
        }
        const double between = elevation_of_node(sun_node(elevation) + 0.5);
        const SkyTable exact = earth().sky(300, between);
        RenderOptions options = physical(between);
        options.ground.albedo = earth().model().ground_albedo;
        options.camera.position_m.z = 300;
        options.sun.colour = {1, 1, 1};
        options.atmosphere.night = {};
        options.atmosphere.adaptation = 0;
        SkyLights own;
        const std::vector<float> found = own.at(options, {}).texels;
        double brightest = 0;
        for (const float value : exact.scattered) brightest = std::max(brightest, double(value));
        double here = 0;
        for (std::size_t i = 0; i < sky; ++i) {
            const double expected = kPi * kSunAboveAir * double(exact.scattered[i]);
            const double scale = std::max(expected, 0.01 * kPi * kSunAboveAir * brightest);
            here = std::max(here, std::abs(double(found[i]) - expected) / scale);
        }
        mixed = std::max(mixed, here);
        std::printf("half way at %g: %.4f\n", between, here);
    }
    EXPECT_LE(jump, 1e-4);
    EXPECT_LE(mixed, 0.02);
    std::printf("along the sun's path: largest jump across a node %.6f, error half way %.4f\n", jump, mixed);
}

}  // namespace
}  // namespace nephos
