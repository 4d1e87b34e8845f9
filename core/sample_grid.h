// SPDX-License-Identifier: Apache-2.0
#pragma once

// Values at the points of a regular grid along the world's axes, as they are read from a file.

#include <array>
#include <memory>
#include <vector>

#include "core/vec.h"

namespace nephos {

struct SampleGrid {
    Vec3 first_m{};               // of the first point, world space
    Vec3 spacing_m{1, 1, 1};      // > 0
    std::array<int, 3> points{};  // each at least 1
    int parts = 1;                // numbers of each point: 1, or 3 of a vector
    std::vector<float> values;    // the parts of a point side by side, x fastest
};

// Returns part `part` at a place: linear between the eight points around it, exactly their value where they are equal;
// beyond the outermost points constant. Thread-safe; pure; the same bits on every machine.
double sample_at(const SampleGrid& grid, const Vec3& place_m, int part);

}  // namespace nephos
