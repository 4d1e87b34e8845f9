// SPDX-License-Identifier: Apache-2.0
#include "render/options/camera.h"

#include <cmath>
#include <numbers>

#include "core/error.h"
#include "core/vec.h"

namespace nephos {

CameraFrame camera_frame(const Camera& camera) {
    const Vec3 view = camera.target_m - camera.position_m;
    const double distance = length(view);
    if (!(distance > 0) || !std::isfinite(distance))
        throw Error(ErrorCode::usage, "camera: target_m must differ from position_m");
    CameraFrame frame;
    frame.position_m = camera.position_m;
    frame.forward = (1.0 / distance) * view;
    // Within 1e-6 rad of the vertical, "up" cannot be told from the view: north takes its place.
    const bool vertical = std::hypot(frame.forward.x, frame.forward.y) < 1e-6;
    frame.right = glm::normalize(cross(frame.forward, vertical ? Vec3{0, 1, 0} : Vec3{0, 0, 1}));
    frame.up = cross(frame.right, frame.forward);
    frame.half_height = std::tan(camera.vertical_fov_deg * std::numbers::pi / 360.0);
    frame.half_width = frame.half_height * camera.width / camera.height;
    return frame;
}

Vec3 pixel_ray(const CameraFrame& frame, const Camera& camera, double px, double py) {
    const double x = (2.0 * px / camera.width - 1.0) * frame.half_width;
    const double y = (1.0 - 2.0 * py / camera.height) * frame.half_height;
    return glm::normalize(frame.forward + x * frame.right + y * frame.up);
}

PixelPosition project(const CameraFrame& frame, const Camera& camera, const Vec3& point_m) {
    const Vec3 offset = point_m - frame.position_m;
    const double depth = dot(offset, frame.forward);
    if (!(depth > 0)) return {};
    const double x = dot(offset, frame.right) / (depth * frame.half_width);
    const double y = dot(offset, frame.up) / (depth * frame.half_height);
    return {0.5 * (x + 1.0) * camera.width, 0.5 * (1.0 - y) * camera.height, true};
}

glm::mat4 world_to_camera(const CameraFrame& frame) {
    const glm::dmat3 turn = glm::transpose(glm::dmat3(frame.right, frame.up, -frame.forward));
    glm::dmat4 matrix(turn);
    matrix[3] = glm::dvec4(-(turn * frame.position_m), 1.0);
    return glm::mat4(matrix);
}

}  // namespace nephos
