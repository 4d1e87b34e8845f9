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

// From 5.5 km the horizon lies 2.4 degrees down: there the sun shines on clouds from below when it has set for the ground, and
// redder the lower it is.
TEST(Atmosphere, HighCloudsAreInTheSunAfterItHasSet) {
    double redness = 1;
    for (const double elevation : {0.0, -1.2, -2.0}) {
        const Rgb sun = earth().sunlight(5500, elevation);
        EXPECT_GT(sun[0], 0.05) << elevation;
        EXPECT_GT(sun[0] / sun[2], 1.5 * redness) << elevation;
        redness = sun[0] / sun[2];
    }
    for (const double after : {earth().sunlight(0, -1.2)[0], earth().sunlight(5500, -3.0)[0]}) EXPECT_EQ(after, 0);
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
Rgb sky_radiance(const SkyTable& table, double horizon, double sine, double cos_azimuth, double cos_to_sun,
                 double mie_g) {
    constexpr std::size_t kColumns = shader::kSkyColumns, kRows = shader::kSkyRows;
    const double x = double(shader::sky_across(float(cos_azimuth))) * double(kColumns - 1),
                 y = double(shader::air_row(float(sine), float(horizon))) * double(kRows - 1);
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
    const double altitude = 300;
    const double horizon = -std::sqrt(1 - std::pow(m.ground_radius_m / (m.ground_radius_m + altitude), 2));
    for (const double elevation : kSuns) {
        const SkyTable table = earth().sky(altitude, elevation);
        std::vector<std::pair<Rgb, Rgb>> pairs;
        double brightest = 0;
        for (int n = 0; n < 200; ++n) {
            const double up = n < 40 ? horizon + 0.03 * uniform() : uniform(), azimuth = kPi * uniform();
            const double cosine = reference::cosine_between(up, sine(elevation), azimuth);
            const Rgb found = sky_radiance(table, horizon, up, std::cos(azimuth), cosine, m.mie_g);
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
        // At -18 the sky has a thousandth of the night's radiance.
        EXPECT_LE(worst_here, elevation < -15 ? 0.05 : 0.02) << "sun at " << elevation;
        std::printf("sun at %g: largest relative error %.4f\n", elevation, worst_here);
        worst = std::max(worst, worst_here);
    }
    std::printf("sky against brute force: largest %.4f, mean %.5f\n", worst, sum / count);
}

// A texel of the layers of the air, with the interpolation of render/shading/air.glsl.
Rgb air_layer_at(const SkyLight& light, std::size_t layer, double sine, double horizon, double across,
                 double distance) {
    constexpr std::size_t kColumns = shader::kSkyColumns, kRows = shader::kAirRows;
    const double x = double(shader::air_distance(float(distance), float(sine), float(horizon), float(across))) *
                     double(kColumns - 1),
                 y = double(shader::air_row(float(sine), float(horizon))) * double(kRows - 1);
    const auto i = std::min(std::size_t(x), kColumns - 2), j = std::min(std::size_t(y), kRows - 2);
    const std::size_t row = j + (float(sine) < float(horizon) ? 0 : kRows);
    Rgb value{};
    for (std::size_t c = 0; c < 3; ++c) {
        const float* a = &light.texels[4 * (((shader::kAirLayer + layer) * shader::kSkyRows + row) * kColumns + i) + c];
        const float* b = a + 4 * kColumns;
        value[c] = std::lerp(std::lerp(double(a[0]), double(a[4]), x - double(i)),
                             std::lerp(double(b[0]), double(b[4]), x - double(i)), y - double(j));
    }
    return value;
}

// Aerial perspective from three heights, along rays from -30 to +5 degrees up to the ground or 300 km: within 3 %
// of naive integration, relative to the light of each channel or, where that is less, to a fiftieth of a white
// surface's in the sun; and transmittance within 0.01.
TEST(Atmosphere, AerialPerspectiveEqualsBruteForce) {
    std::mt19937 engine(5);
    const auto uniform = [&] { return engine() / 4294967296.0; };
    RenderOptions options;
    options.atmosphere.model = AirModel::physical;
    options.atmosphere.haze = 5;
    options.atmosphere.adaptation = 0;
    options.atmosphere.night = {};
    options.sun.colour = {1, 1, 1};
    options.ground.albedo = {0.3, 0.3, 0.3};
    const AtmosphereModel m = atmosphere_model(options.atmosphere, options.ground.albedo);
    const TwinPsi psi(m);
    SkyLights lights;
    for (const double altitude : {100.0, 3'000.0, 11'000.0})
        for (const double elevation : {4.0, 16.0, 50.0}) {  // nodes of the tables
            options.camera.position_m.z = altitude;
            options.sun.elevation_deg = elevation;
            const SkyLight& light = lights.at(options, {});
            const double radius = m.ground_radius_m + altitude;
            const double across = altitude * (2 * m.ground_radius_m + altitude) / radius;
            const double horizon = -std::sqrt(across / radius);
            double worst = 0, worst_left = 0;
            for (int n = 0; n < 60; ++n) {
                const double up = sine(n < 15 ? -6 + 8 * uniform() : -30 + 35 * uniform()), azimuth = kPi * uniform();
                bool ground = false;
                const double whole = reference::ray_length(m, radius, up, ground);
                const double distance = std::min(n % 3 == 0 ? whole : whole * uniform(), 300e3);
                const reference::AirUpTo expected = reference::air_up_to(
                    m, radius, up, azimuth, sine(elevation), distance, {400, 40}, psi);
                const double phase = double(shader::particle_phase(
                    float(reference::cosine_between(up, sine(elevation), azimuth)), float(m.mie_g)));
                const auto layer = [&](std::size_t number) {
                    return air_layer_at(light, number, up, horizon, across, distance);
                };
                const Rgb extinction = layer(0), to = layer(1), beside = layer(2), away = layer(3),
                          haze_to = layer(4), haze_beside = layer(5), haze_away = layer(6);
                const double cosine = std::cos(azimuth) / double(shader::kAirAzimuth), square = cosine * cosine;
                for (std::size_t c = 0; c < 3; ++c) {
                    const double left = std::exp(-extinction[c] * distance);
                    const double source = 0.5 * (square + cosine) * to[c] + (1 - square) * beside[c] +
                                          0.5 * (square - cosine) * away[c] +
                                          phase * (0.5 * (square + cosine) * haze_to[c] +
                                                   (1 - square) * haze_beside[c] +
                                                   0.5 * (square - cosine) * haze_away[c]);
                    const double seen = source * (1 - left);
                    const double true_light = kPi * kSunAboveAir * expected.light[c];
                    const double error = std::abs(seen - true_light) / std::max(true_light, 0.02);
                    if (error > worst) worst = error;
                    worst_left = std::max(worst_left, std::abs(left - expected.transmittance[c]));
                    EXPECT_LE(error, 0.03) << altitude << " m, sun " << elevation << ", ray "
                                           << std::asin(up) * 180 / kPi << ", azimuth " << azimuth * 180 / kPi
                                           << ", " << distance << " of " << whole << " m, channel " << c;
                    EXPECT_NEAR(left, expected.transmittance[c], 0.01) << altitude << ' ' << distance;
                }
            }
            std::printf("from %g m, sun at %g: light %.4f, transmittance %.4f\n", altitude, elevation, worst,
                        worst_left);
        }
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
    options.atmosphere.haze = 1;
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
