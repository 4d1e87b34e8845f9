// SPDX-License-Identifier: Apache-2.0
#include "render/ground/water.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/noise_hash.h"

namespace nephos {
namespace {

constexpr double kGravity = 9.81;               // m/s^2
constexpr double kTension = 7.3e-5;             // surface tension / density of water, m^3/s^2
constexpr double kShortest_m = 0.01;            // waves that slopes are shared among
constexpr double kShortestDrawn_m = 0.12;
constexpr int kWavesPerOctave = 16;
constexpr std::uint32_t kSeed = 0x73656120u;

// Returns the length of the waves with the most energy, omega = 0.855 g / U. Pierson and Moskowitz 1964.
double peak_wavelength_m(double wind) {
    constexpr double kPeak = 0.855;
    return 2 * std::numbers::pi * wind * wind / (kPeak * kPeak * kGravity);
}

// Returns the share of an octave's slopes that are there: none of waves much longer than the peak's.
double grown(double wavelength_m, double peak_m) {
    const double ratio = wavelength_m / peak_m;
    return std::exp(-1.25 * ratio * ratio);
}

double random_part(std::uint32_t number, std::uint32_t which) {
    return mix_bits(mix_bits(kSeed + number) + which) * 0x1p-32;
}

std::vector<WaterWave> waves_of(const WaterOptions& options, const Vec3& eye_m, double time_s) {
    const double peak_m = peak_wavelength_m(options.wind_m_per_s);
    const double longest_m = 1.8 * peak_m;
    std::vector<WaterWave> waves;
    if (longest_m <= kShortestDrawn_m) return waves;
    const double step = std::exp2(-1.0 / kWavesPerOctave);
    double shares = 0;
    for (double length_m = longest_m; length_m > kShortest_m; length_m *= step) shares += grown(length_m, peak_m);
    const double along = (270 - options.from_deg) * std::numbers::pi / 180;  // of the wind, from x
    double length_m = longest_m;
    for (std::uint32_t n = 0; length_m > kShortestDrawn_m; ++n, length_m *= step) {
        // Lengths, directions and phases are random, so that no pattern repeats: cos^2 of the angle to the wind.
        const double own_m = length_m * std::exp2((random_part(n, 0) - 0.5) / kWavesPerOctave);
        const double even = 2 * random_part(n, 1) - 1;
        const double angle = along + 0.5 * std::numbers::pi * (0.6 * even + 0.4 * even * even * even);
        const double k = 2 * std::numbers::pi / own_m;
        const double x = k * std::cos(angle), y = k * std::sin(angle);
        const double omega = std::sqrt(kGravity * k + kTension * k * k * k);
        const double turns = (x * eye_m.x + y * eye_m.y - omega * time_s) / (2 * std::numbers::pi) + random_part(n, 2);
        const double variance = slope_variance_of_sea(options.wind_m_per_s) * grown(length_m, peak_m) / shares;
        const double slope = std::sqrt(2 * variance);
        waves.push_back({float(x), float(y), float(2 * std::numbers::pi * (turns - std::floor(turns))),
                         float(slope * std::cos(angle)), float(slope * std::sin(angle)), float(own_m),
                         float(variance / 2)});
    }
    return waves;
}

}  // namespace

double slope_variance_of_sea(double wind) { return wind > 0 ? 0.003 + 0.00512 * wind : 0; }

double whitecaps_of_sea(double wind) { return 2.95e-6 * std::pow(wind, 3.52); }

Water water_of(const RenderOptions& options, const Vec3& eye_m, double time_s) {
    Water water;
    water.enabled = options.ground.pattern == GroundPattern::water;
    if (!water.enabled) return water;
    const WaterOptions& sea = options.water;
    water.slope_variance = float(slope_variance_of_sea(sea.wind_m_per_s) / 2);
    water.waves = waves_of(sea, eye_m, time_s);
    water.gusts = noise_octaves({2600, 0.45, 6, 0.75, kSeed + 1000}, eye_m);
    // Foam that is 44 % white in the mean of a whitecap's life.
    constexpr double kFoamAlbedo = 0.5, kMeanReflectance = 0.22;
    const double cover = sea.whitecaps * whitecaps_of_sea(sea.wind_m_per_s) * kMeanReflectance / kFoamAlbedo;
    if (cover <= 0) return water;
    water.foam_albedo = float(kFoamAlbedo);
    const double part = std::min(cover, 0.5);
    water.foam_level = float(std::log(1 / part - 1) / 1.702);  // part_above() of country-inl.h
    // Foam drifts with the surface, at a thirtieth of the wind's speed.
    const double along = (270 - sea.from_deg) * std::numbers::pi / 180, way_m = sea.wind_m_per_s / 30 * time_s;
    const Vec3 drifted{eye_m.x - way_m * std::cos(along), eye_m.y - way_m * std::sin(along), eye_m.z};
    water.foam = noise_octaves({14, 0.45, 7, 0.8, kSeed + 2000}, drifted);
    return water;
}

}  // namespace nephos
