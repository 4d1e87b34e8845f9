// SPDX-License-Identifier: Apache-2.0
#include "render/options/wet_ground_options.h"

#include "render/options/option_checks.h"

namespace nephos {

void check(const WetGroundOptions& options) {
    require(within(options.soaking_mm, 1e-3, 100), "wet_ground.soaking_mm", "0.001..100 mm");
    require(within(options.puddle_film_mm, 1e-3, 100), "wet_ground.puddle_film_mm", "0.001..100 mm");
    require(within(options.puddle_size_m, 0.1, 1000), "wet_ground.puddle_size_m", "0.1..1000 metres");
    require(within(options.reflection, 0, 1), "wet_ground.reflection", "0..1");
    require(within(options.reflection_scale, 0.1, 1), "wet_ground.reflection_scale", "0.1..1");
    require(within(options.sheen, 0, 1), "wet_ground.sheen", "0..1");
    require(within(options.ripples, 0, 10), "wet_ground.ripples", "0..10");
    require(within(options.snow_cover_mm, 1e-3, 1000), "wet_ground.snow_cover_mm", "0.001..1000 mm");
    require(within(options.snow_albedo, 0, 1), "wet_ground.snow_albedo", "three numbers from 0 to 1");
}

}  // namespace nephos
