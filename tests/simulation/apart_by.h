// SPDX-License-Identifier: Apache-2.0
#pragma once

// How far two pictures of one frame are apart, for tests.

#include <algorithm>
#include <cmath>
#include <vector>

namespace nephos::test {

// Returns the largest difference, of what is brighter than 1 relative to it; not a number if any is not.
inline float apart_by(const std::vector<float>& expected, const std::vector<float>& other) {
    float apart = 0;
    for (std::size_t i = 0; i < expected.size(); ++i) {
        const float difference = std::abs(other[i] - expected[i]) / std::max(1.0f, expected[i]);
        if (std::isnan(difference)) return difference;
        apart = std::max(apart, difference);
    }
    return apart;
}

}  // namespace nephos::test
