// SPDX-License-Identifier: Apache-2.0
// Six wavelengths against integration with the CIE 1931 matching functions, and the colours of the sky.

#include "render/atmosphere/spectrum.h"

#include <cmath>
#include <cstdio>
#include <iterator>

#include <gtest/gtest.h>

#include "render/atmosphere/air_colours.h"
#include "render/shared/shared.h"

namespace nephos {
namespace {

// Printed by tests/reference/fit_spectrum.py, which integrates in steps of 1 nm.
struct Sample {
    double air, ozone, haze;  // columns, relative to the Earth's; haze relative to `air`
    int kind;  // sunlight behind that air; what a little of it scatters; what much of it scatters
    Rgb colour;
};
constexpr Sample kSamples[] = {
    {0, 0, 0, 0, {0.948422, 1.00237, 1.14834}},     {0, 5, 1, 2, {0.529378, 0.787171, 1.14749}},
    {1, 1, 0, 1, {0.550595, 1.20815, 2.83532}},     {1, 12, 10, 0, {0.539484, 0.618192, 0.84227}},
    {2, 5, 0, 2, {0.48679, 0.631848, 0.693722}},    {5, 0, 10, 1, {0.380324, 0.62349, 0.794468}},
    {5, 12, 1, 0, {0.45988, 0.404592, 0.316388}},   {10, 1, 10, 2, {0.224185, 0.165786, 0.050984}},
    {20, 0, 1, 1, {0.21363, 0.131855, 0.0162695}},  {20, 12, 0, 0, {0.202559, 0.0726614, 0.00218242}},
    {38, 1, 1, 2, {0.0525924, 0.00963787, -0.00181329}},
};

TEST(Spectrum, SixWavelengthsAreIntegrationInStepsOfOneNanometre) {
    for (const Sample& sample : kSamples) {
        Rgb found{};
        double largest = 0;
        for (const double value : sample.colour) largest = std::max(largest, std::abs(value));
        for (std::size_t w = 0; w < kWavelengths; ++w) {
            const double molecules = rayleigh_per_m(kWavelengths_nm[w]);
            double light = std::exp(-sample.air * (molecules * 8000 + sample.haze * 4.44e-6 * 1200) -
                                    sample.ozone * kOzone_per_m[w] * 15000);
            if (sample.kind == 1) light *= molecules * 1e5;
            if (sample.kind == 2) light *= 1 - std::exp(-molecules * 8000 * 20);
            for (std::size_t c = 0; c < 3; ++c) found[c] += kRgbOfWavelengths[c][w] * light;
        }
        for (std::size_t c = 0; c < 3; ++c)
            EXPECT_NEAR(found[c], sample.colour[c], 0.0015 * largest) << sample.air << ' ' << sample.kind;
    }
}

TEST(Spectrum, ColoursBeyondTheGamutKeepTheirLuminance) {
    const Rgb inside{0.2, 0.4, 0.1}, beyond{0.9, 0.02, -0.03};
    EXPECT_EQ(into_gamut(inside), inside);
    const Rgb moved = into_gamut(beyond);
    const auto luminance = [](const Rgb& c) { return 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2]; };
    EXPECT_NEAR(luminance(moved), luminance(beyond), 1e-12);
    EXPECT_NEAR(moved[2], 0, 1e-12);
    EXPECT_GT(moved[0], moved[1]);
    EXPECT_EQ(into_gamut({-1, -1, -1}), (Rgb{0, 0, 0}));
}

// CIELAB (D65) of linear sRGB, relative to a white.
struct Lab {
    double l, a, b;
};
Lab lab_of(const Rgb& c, double white) {
    const double x = (0.4124564 * c[0] + 0.3575761 * c[1] + 0.1804375 * c[2]) / (0.95047 * white),
                 y = (0.2126729 * c[0] + 0.7151522 * c[1] + 0.0721750 * c[2]) / white,
                 z = (0.0193339 * c[0] + 0.1191920 * c[1] + 0.9503041 * c[2]) / (1.08883 * white);
    const auto f = [](double t) { return t > 216.0 / 24389 ? std::cbrt(t) : (24389.0 / 27 * t + 16) / 116; };
    return {116 * f(y) - 16, 500 * (f(x) - f(y)), 200 * (f(y) - f(z))};
}

AirColours air_with(double haze, SkyColours colours) {
    AtmosphereOptions options;
    options.haze = haze;
    return AirColours(atmosphere_model(options, {0.12, 0.15, 0.07}), colours);
}

// Mean radiance around the horizon, in units of a white surface in the sun above the air.
Rgb horizon(const AirColours& air, double elevation_deg) {
    const SkyTable sky = air.sky(2, elevation_deg);
    Rgb mean{};
    constexpr double kPi = 3.14159265358979;
    for (std::size_t i = 0; i < 64; ++i)
        for (std::size_t c = 0; c < 3; ++c)
            mean[c] += kPi * (double(sky.scattered[4 * i + c]) + double(sky.haze[4 * i + c]) / (4 * kPi)) / 64;
    return mean;
}

// White paper in the noon sun is white, and the horizon at noon is not green: |a*| < 3 in air of 40 to 150 km
// visibility (in the clearest air, haze 1, it is -3.5). With the yellow of 680, 550 and 440 nm as primaries b* is +5.
TEST(Spectrum, NoonHasNoCast) {
    const AirColours air = air_with(1, SkyColours::spectral);
    const Rgb sun = air.sunlight(0, 60);
    for (const double value : sun) EXPECT_NEAR(value / sun[1], 1, 0.01);
    for (const double haze : {2.0, 5.0, 12.0})
        for (const double elevation : {40.0, 60.0, 75.0}) {
            const AirColours hazy = air_with(haze, SkyColours::spectral);
            const Lab lab = lab_of(horizon(hazy, elevation), 0.6);
            std::printf("haze %g, sun %g: horizon L* %.1f a* %.2f b* %.2f\n", haze, elevation, lab.l, lab.a, lab.b);
            EXPECT_LT(std::abs(lab.a), 3) << haze << ' ' << elevation;
        }
}

// A low sun reddens: the clouds opposite are in light whose red is twice its blue at 3 degrees, and more below.
TEST(Spectrum, LowSunsAreRed) {
    const AirColours air = air_with(2, SkyColours::spectral);
    double before = 1;
    for (const double elevation : {30.0, 10.0, 5.0, 3.0, 1.0, 0.0}) {
        const Rgb light = air.sunlight(1500, elevation);
        std::printf("sun %g at 1500 m: %.4f %.4f %.4f\n", elevation, light[0], light[1], light[2]);
        const double ratio = light[0] / std::max(light[2], 1e-6);
        EXPECT_GT(ratio, before);
        before = ratio;
        if (elevation <= 3) {
            EXPECT_GT(ratio, 2);
        }
    }
}

// A low sun glows: at its own height the sky 5 degrees beside it is more than twice as bright as at 40.
TEST(Spectrum, ALowSunGlows) {
    const SkyTable sky = air_with(5, SkyColours::spectral).sky(2, 3);
    const double up = std::sin(3 * M_PI / 180);
    const auto luminance = [&](double beside_deg) {
        const auto column = std::size_t(std::lround(
            63 * double(shader::sky_across(float(std::cos(beside_deg * M_PI / 180))))));
        const auto row = std::size_t(std::lround(95 * double(shader::sky_upwards(float(up)))));
        const double cosine = up * up + (1 - up * up) * std::cos(beside_deg * M_PI / 180);
        const double phase = double(shader::particle_phase(float(cosine), 0.8f));
        const std::size_t at = 4 * (64 * row + column);
        double sum = 0;
        for (std::size_t c = 0; c < 3; ++c)
            sum += Rgb{0.2126, 0.7152, 0.0722}[c] *
                   (double(sky.scattered[at + c]) + phase * double(sky.haze[at + c]));
        return sum;
    };
    std::printf("beside a sun at 3 degrees: 5 %.4f, 10 %.4f, 40 %.4f\n", luminance(5), luminance(10), luminance(40));
    EXPECT_GT(luminance(5), 2 * luminance(40));
    EXPECT_GT(luminance(5), luminance(10));
}

TEST(Spectrum, PrimariesAreTheAtmosphereItself) {
    const AirColours air = air_with(1, SkyColours::primaries);
    AtmosphereOptions options;
    options.haze = 1;
    const Atmosphere plain(atmosphere_model(options, {0.12, 0.15, 0.07}));
    EXPECT_EQ(air.above_air(), (Rgb{1, 1, 1}));
    EXPECT_EQ(air.sunlight(500, 12), plain.sunlight(500, 12));
    EXPECT_EQ(air.sky(500, 12).scattered, plain.sky(500, 12).scattered);
    EXPECT_EQ(air.irradiance(500, 12).sideways, plain.irradiance(500, 12).sideways);
}

}  // namespace
}  // namespace nephos
