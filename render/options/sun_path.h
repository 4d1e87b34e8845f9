// SPDX-License-Identifier: Apache-2.0
#pragma once

// Key frames of a sun that moves.

#include <span>

#include "render/options/options.h"

namespace nephos {

struct SunKey {
    double time_s = 0;            // simulated; keys rise strictly
    double elevation_deg = 40.0;  // as in Sun: -18..90
    double azimuth_deg = 135.0;   // -360..360
    Rgb colour{1.0, 0.96, 0.9};   // >= 0
    bool operator==(const SunKey&) const = default;
};

// Returns the sun at a simulated time as its key frames say, without its date; without key frames sun_at(). Between two
// of them elevation and colour go linearly with time, the azimuth too, the shorter way round; before the first and after
// the last the sun stands still. At the time of a key it is exactly that of the key. Throws as sun_at(). Pure.
Sun sun_at(const Sun& sun, std::span<const SunKey> path, double time_s);

}  // namespace nephos
