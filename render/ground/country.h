// SPDX-License-Identifier: Apache-2.0
#pragma once

// Open country as albedo of the ground (GroundPattern::country): fields in rows, with hedges between, of an age
// and a crop each; woods; tussocks near the eye. A function of place alone, anchored in the world, and filtered
// to the footprint of a pixel: fields by a box, whose sides are those of the footprint along the rows and across
// them, noise by leaving out wavelengths that the longer side of the footprint does not resolve, with what is
// left out as a part of the cover. So nothing shimmers when the eye moves, and there is no moire.
//
// The mean over the country is Ground::albedo. Evaluated in render/ground/country-inl.h. Private to the module.

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "render/ground/ground_noise.h"
#include "render/options/options.h"

namespace nephos {

inline constexpr std::size_t kCrops = 8;

struct Country {
    bool enabled = false;
    // Factors of the albedo of plain ground: crops, woods, hedges.
    alignas(64) std::array<std::array<float, kCrops>, 3> crops{};
    std::array<float, 3> wood{}, hedge{};
    NoiseOctave fields;  // its lattice: a cell is a field, rows along x
    float hedge_cells = 0;  // half width of a hedge
    float bend_m = 0;       // by which `bends` displace fields
    std::vector<NoiseOctave> bends, woods, tones, tussocks;
};

// Returns the country of the options as an eye sees it; not enabled with GroundPattern::plain.
Country country_of(const Ground& ground, const Vec3& eye_m);

}  // namespace nephos
