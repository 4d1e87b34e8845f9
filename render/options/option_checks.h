// SPDX-License-Identifier: Apache-2.0
#pragma once

// Checks of options in this module; every message names the option's key and the expected value. Private to
// the module.

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "core/error.h"
#include "core/vec.h"

namespace nephos {

// Throws Error(usage) unless `good`.
inline void require(bool good, const char* key, const char* expected) {
    if (!good) throw Error(ErrorCode::usage, std::string(key) + ": expected " + expected);
}

// Returns true when min <= value <= max; false for NaN.
inline bool within(double value, double min, double max) { return value >= min && value <= max; }
inline bool within(const std::array<double, 3>& values, double min, double max) {
    return std::ranges::all_of(values, [&](double value) { return within(value, min, max); });
}

inline bool finite(const Vec3& v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

}  // namespace nephos
