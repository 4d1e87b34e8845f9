// SPDX-License-Identifier: Apache-2.0
#pragma once

// A camera that moves: key frames of position and target over simulated time.

#include <vector>

#include "core/vec.h"

namespace nephos {

struct Camera;

struct CameraKey {
    double time_s = 0;  // simulated; keys rise strictly
    Vec3 position_m{0, -4000, 300};
    Vec3 target_m{0, 0, 1200};  // differs from position_m
    bool operator==(const CameraKey&) const = default;
};

// The camera at a time: without a path as it is. Through the keys go cubic Hermite curves with the slopes of
// Fritsch and Butland (1984): position and velocity are continuous, and between two keys no coordinate leaves
// the range of the two, so that a camera near the ground stays above it. Before the first key and after the
// last it stands still. The result has no path. Where position and target would meet, the view of the key
// before is kept. Pure.
Camera camera_at(const Camera& camera, double time_s);

}  // namespace nephos
