// SPDX-License-Identifier: Apache-2.0
#include "render/shell_options.h"

#include <cmath>
#include <string>

#include "automaton/error.h"
#include "render/shaders/shared.h"

namespace nephos {
namespace {

void require(bool good, const char* name, const char* expected) {
    if (!good) throw Error(ErrorCode::usage, std::string(name) + ": expected " + expected);
}

bool within(double value, double min, double max) { return value >= min && value <= max; }

}  // namespace

void check(const Shells& shells) {
    require(shells.count >= 1 && shells.count <= int(shader::kMaxShells), "shells.count", "1..128 shells");
    require(within(shells.spacing_m, 0.1, 1e5), "shells.spacing_m", "0.1..1e5 metres");
    require(within(shells.growth, 1, 2), "shells.growth", "1..2");
    require(reach_m(shells) <= 1e6, "shells.growth", "shells that end within 1000 km");
}

void check(const LightShafts& shafts) {
    require(within(shafts.strength, 0, 1), "light_shafts.strength", "0..1");
    require(within(shafts.g, -0.99, 0.99), "light_shafts.g", "-0.99..0.99");
    require(within(shafts.sun_share, 0, 1), "light_shafts.sun_share", "0..1");
}

}  // namespace nephos
