// SPDX-License-Identifier: Apache-2.0
#include "render/options/precipitation_options.h"

#include "render/options/option_checks.h"

namespace nephos {

void check(const PrecipitationOptions& p) {
    require(within(p.particles, 0, 2e6), "precipitation.particles", "0..2,000,000");
    require(within(p.exposure_s, 0, 1), "precipitation.exposure_s", "0..1 seconds");
    require(within(p.visibility, 0, 1000), "precipitation.visibility", "0..1000");
    require(within(p.intensity_scale, 0, 100), "precipitation.intensity_scale", "0..100");
    require(within(p.wind_drift, 0, 10), "precipitation.wind_drift", "0..10");
    require(within(p.depth_m, 1, 1000), "precipitation.depth_m", "1..1000 metres");
    require(within(p.margin_m, 0, 100), "precipitation.margin_m", "0..100 metres");
    require(within(p.reach_m, 1, 1e5), "precipitation.reach_m", "1..100,000 metres");
    require(within(p.edge, 0, 1), "precipitation.edge", "0..1");
    require(within(p.shafts, 0, 100), "precipitation.shafts", "0..100");
    require(within(p.shaft_texture, 0, 1), "precipitation.shaft_texture", "0..1");
    require(within(p.evaporation, 0, 1), "precipitation.evaporation", "0..1");
}

}  // namespace nephos
