// SPDX-License-Identifier: Apache-2.0
#include "render/level_of_detail_options.h"

#include <string>

#include "automaton/error.h"

namespace nephos {
namespace {

// NaN fails every comparison, so it is out of every range.
void require_within(double value, double min, double max, const char* name, const char* expected) {
    if (value >= min && value <= max) return;
    throw Error(ErrorCode::usage, std::string("level_of_detail.") + name + ": expected " + expected);
}

}  // namespace

void check(const LevelOfDetailOptions& options) {
    require_within(options.pixels, 0, 1000, "pixels", "0..1000 pixels");
}

}  // namespace nephos
