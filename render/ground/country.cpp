// SPDX-License-Identifier: Apache-2.0
#include "render/ground/country.h"

namespace nephos {
namespace {

// Reflectances, red, green, blue: pasture, grass, young and ripe crops, stubble, soil (after the spectra of
// the USGS library, Kokaly et al. 2017, rounded).
constexpr float kCropAlbedos[kCrops][3] = {{0.070f, 0.120f, 0.045f}, {0.095f, 0.145f, 0.055f},
                                           {0.125f, 0.160f, 0.070f}, {0.080f, 0.125f, 0.050f},
                                           {0.230f, 0.200f, 0.105f}, {0.190f, 0.170f, 0.100f},
                                           {0.140f, 0.110f, 0.075f}, {0.105f, 0.150f, 0.060f}};
constexpr float kWoodAlbedo[3] = {0.036f, 0.055f, 0.024f};
constexpr float kHedgeAlbedo[3] = {0.045f, 0.068f, 0.028f};
constexpr float kWoods = 0.24f;     // share of the country, see kWoodLevel in country-inl.h
constexpr float kHedge_m = 4;       // half of the width
constexpr std::uint32_t kSeed = 0x636f756eu;

}  // namespace

Country country_of(const Ground& ground, const Vec3& eye_m) {
    Country country;
    country.enabled = ground.pattern == GroundPattern::country;
    if (!country.enabled) return country;
    for (std::size_t c = 0; c < 3; ++c) {
        float mean = kWoods * kWoodAlbedo[c];
        for (const float(&crop)[3] : kCropAlbedos) mean += (1 - kWoods) * crop[c] / float(kCrops);
        for (std::size_t n = 0; n < kCrops; ++n) country.crops[c][n] = kCropAlbedos[n][c] / mean;
        country.wood[c] = kWoodAlbedo[c] / mean;
        country.hedge[c] = kHedgeAlbedo[c] / mean;
    }
    country.fields = noise_octaves({ground.field_m, 1, 1, 1, kSeed}, eye_m).front();
    country.hedge_cells = float(kHedge_m / ground.field_m);
    country.bend_m = float(0.16 * ground.field_m);
    country.bends = noise_octaves({4 * ground.field_m, 0.61, 2, 1, kSeed + 101}, eye_m);
    country.woods = noise_octaves({9 * ground.field_m, 0.5, 9, 0.62, kSeed + 202}, eye_m);
    country.tones = noise_octaves({17 * ground.field_m, 0.37, 5, 0.8, kSeed + 303}, eye_m);
    country.tussocks = noise_octaves({40, 0.45, 8, 0.9, kSeed + 404}, eye_m);
    return country;
}

}  // namespace nephos
