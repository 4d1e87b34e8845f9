// SPDX-License-Identifier: Apache-2.0
#include "render/precipitation_options.h"

#include <string>

#include "automaton/error.h"

namespace nephos {
namespace {

// NaN fails every comparison, so it is out of every range.
void require_within(double value, double min, double max, const char* name, const char* expected) {
    if (value >= min && value <= max) return;
    throw Error(ErrorCode::usage, std::string("precipitation.") + name + ": expected " + expected);
}

}  // namespace

void check(const PrecipitationOptions& p) {
    require_within(p.particles, 0, 2e6, "particles", "0..2,000,000");
    require_within(p.exposure_s, 0, 1, "exposure_s", "0..1 seconds");
    require_within(p.visibility, 0, 1000, "visibility", "0..1000");
    require_within(p.intensity_scale, 0, 100, "intensity_scale", "0..100");
    require_within(p.wind_drift, 0, 10, "wind_drift", "0..10");
    require_within(p.depth_m, 1, 1000, "depth_m", "1..1000 metres");
    require_within(p.margin_m, 0, 100, "margin_m", "0..100 metres");
    require_within(p.reach_m, 1, 1e5, "reach_m", "1..100,000 metres");
    require_within(p.edge, 0, 1, "edge", "0..1");
    require_within(p.shafts, 0, 100, "shafts", "0..100");
    require_within(p.shaft_texture, 0, 1, "shaft_texture", "0..1");
    require_within(p.evaporation, 0, 1, "evaporation", "0..1");
}

}  // namespace nephos
