// SPDX-License-Identifier: Apache-2.0
#include "render/wet_ground_options.h"

#include <string>

#include "automaton/error.h"

namespace nephos {
namespace {

// NaN fails every comparison, so it is out of every range.
void require_within(double value, double min, double max, const char* name, const char* expected) {
    if (value >= min && value <= max) return;
    throw Error(ErrorCode::usage, std::string("wet_ground.") + name + ": expected " + expected);
}

}  // namespace

void check(const WetGroundOptions& options) {
    require_within(options.soaking_mm, 1e-3, 100, "soaking_mm", "0.001..100 mm");
    require_within(options.puddle_film_mm, 1e-3, 100, "puddle_film_mm", "0.001..100 mm");
    require_within(options.puddle_size_m, 0.1, 1000, "puddle_size_m", "0.1..1000 metres");
    require_within(options.reflection, 0, 1, "reflection", "0..1");
    require_within(options.reflection_scale, 0.1, 1, "reflection_scale", "0.1..1");
    require_within(options.sheen, 0, 1, "sheen", "0..1");
    require_within(options.ripples, 0, 10, "ripples", "0..10");
    require_within(options.snow_cover_mm, 1e-3, 1000, "snow_cover_mm", "0.001..1000 mm");
    for (const double albedo : options.snow_albedo)
        require_within(albedo, 0, 1, "snow_albedo", "three numbers from 0 to 1");
}

}  // namespace nephos
