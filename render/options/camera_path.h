// SPDX-License-Identifier: Apache-2.0
#pragma once

// Animation of the camera: key frames of position and target over simulated time.

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

// Returns the camera at a time, without its path; a camera without path unchanged. Position and target are
// interpolated by cubic Hermite curves with the slopes of Fritsch and Butland (1984): they and their
// velocities are continuous, and monotonic between two keys in each coordinate, so that a camera near the
// ground stays above it. Before the first key and after the last the camera is constant. Where position and
// target would coincide, it has the direction of view of the key before. Pure.
Camera camera_at(const Camera& camera, double time_s);

}  // namespace nephos
