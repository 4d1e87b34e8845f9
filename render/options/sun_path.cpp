// SPDX-License-Identifier: Apache-2.0
#include "render/options/sun_path.h"

#include <algorithm>
#include <cmath>
#include <iterator>

namespace nephos {

Sun sun_at(const Sun& sun, std::span<const SunKey> path, double time_s) {
    if (path.empty()) return sun_at(sun, time_s);
    const auto after = std::ranges::upper_bound(path, time_s, {}, &SunKey::time_s);
    const SunKey& key = after == path.begin() ? path.front() : *std::prev(after);
    Sun now = sun;
    now.date.clear();
    now.time.clear();
    now.elevation_deg = key.elevation_deg;
    now.azimuth_deg = key.azimuth_deg;
    now.colour = key.colour;
    if (after == path.begin() || after == path.end()) return now;
    const double s = (time_s - key.time_s) / (after->time_s - key.time_s);
    now.elevation_deg += s * (after->elevation_deg - key.elevation_deg);
    now.azimuth_deg += s * std::remainder(after->azimuth_deg - key.azimuth_deg, 360.0);
    if (std::abs(now.azimuth_deg) > 360) now.azimuth_deg = std::remainder(now.azimuth_deg, 360.0);
    for (std::size_t c = 0; c < 3; ++c) now.colour[c] += s * (after->colour[c] - key.colour[c]);
    return now;
}

}  // namespace nephos
