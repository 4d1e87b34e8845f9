// SPDX-License-Identifier: Apache-2.0
#include "render/options/camera.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/error.h"
#include "core/vec.h"

namespace nephos {
namespace {

using Member = Vec3 CameraKey::*;

Vec3 chord(const std::vector<CameraKey>& path, std::size_t n, Member member) {
    return (1.0 / (path[n + 1].time_s - path[n].time_s)) * (path[n + 1].*member - path[n].*member);
}

// Velocity at a key along one axis: the harmonic mean of the velocities before and after, weighted by their
// times; 0 where the way turns.
double slope(double before, double after, double time_before, double time_after) {
    if (!(before * after > 0)) return 0;
    const double sum = 3 * (time_before + time_after);
    return sum / ((2 * time_after + time_before) / before + (time_after + 2 * time_before) / after);
}

Vec3 slope(const std::vector<CameraKey>& path, std::size_t n, Member member) {
    if (n == 0 || n + 1 == path.size()) return {0, 0, 0};  // at the ends it rests
    const double before_s = path[n].time_s - path[n - 1].time_s,
                 after_s = path[n + 1].time_s - path[n].time_s;
    const Vec3 before = chord(path, n - 1, member), after = chord(path, n, member);
    return {slope(before.x, after.x, before_s, after_s), slope(before.y, after.y, before_s, after_s),
            slope(before.z, after.z, before_s, after_s)};
}

Vec3 between(const std::vector<CameraKey>& path, std::size_t n, double s, Member member) {
    const double duration = path[n + 1].time_s - path[n].time_s;
    const double s2 = s * s, s3 = s2 * s;
    return (2 * s3 - 3 * s2 + 1) * (path[n].*member) + (3 * s2 - 2 * s3) * (path[n + 1].*member) +
           duration * ((s3 - 2 * s2 + s) * slope(path, n, member) + (s3 - s2) * slope(path, n + 1, member));
}

}  // namespace

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

Frustum::Frustum(const CameraFrame& camera)
    : inward_{camera.forward, glm::normalize(camera.half_width * camera.forward + camera.right),
              glm::normalize(camera.half_width * camera.forward - camera.right),
              glm::normalize(camera.half_height * camera.forward + camera.up),
              glm::normalize(camera.half_height * camera.forward - camera.up)} {}

bool Frustum::may_see(const Vec3& offset, double radius) const {
    for (const Vec3& inward : inward_)
        if (dot(offset, inward) < -radius) return false;
    return true;
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

Camera camera_at(const Camera& camera, double time_s) {
    if (camera.path.empty()) return camera;
    const std::vector<CameraKey>& path = camera.path;
    const auto after = std::upper_bound(path.begin(), path.end(), time_s,
                                        [](double t, const CameraKey& key) { return t < key.time_s; });
    Camera result = camera;
    result.path.clear();
    const std::size_t n = after == path.begin() ? 0 : std::size_t(after - path.begin()) - 1;
    result.position_m = path[n].position_m;
    result.target_m = path[n].target_m;
    if (after == path.begin() || after == path.end()) return result;
    const double s = (time_s - path[n].time_s) / (path[n + 1].time_s - path[n].time_s);
    result.position_m = between(path, n, s, &CameraKey::position_m);
    result.target_m = between(path, n, s, &CameraKey::target_m);
    if (result.position_m == result.target_m)
        result.target_m = result.position_m + (path[n].target_m - path[n].position_m);
    return result;
}

}  // namespace nephos
