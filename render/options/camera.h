// SPDX-License-Identifier: Apache-2.0
#pragma once

// Geometry of the perspective camera. Pixel (x, y) has its centre at (x + 0.5, y + 0.5), row 0 at the top.
// The ray through a point (px, py) of the image, in pixels, has the direction
//
//     forward + (2 px / width - 1) * right * half_width + (1 - 2 py / height) * up * half_height

#include <cstddef>

#include <glm/mat4x4.hpp>

#include "render/options/options.h"

namespace nephos {

// The camera's axes as unit vectors in world space, and half the extent of the image plane at distance 1.
struct CameraFrame {
    Vec3 position_m{}, right{}, up{}, forward{};
    double half_width = 1, half_height = 1;  // tangents of half the fields of view
};

// Returns the axes of a camera; north is up in the image when it looks straight up or down. Throws
// Error(usage) when target and position coincide. Pure, as all functions here.
CameraFrame camera_frame(const Camera& camera);

// The view frustum: the inside of the four planes through the eye and the sides of the image, in front of the
// eye, without a far plane.
class Frustum {
  public:
    explicit Frustum(const CameraFrame& camera);
    // Tests a sphere, given by the offset of its centre from the eye. Conservative: false only if it is entirely
    // outside; near edges true for some spheres just outside.
    bool may_see(const Vec3& offset, double radius) const;
    // Returns the normal of one of the planes, pointing inwards.
    const Vec3& inward(std::size_t plane) const { return inward_[plane]; }

  private:
    Vec3 inward_[5]{};
};

// Returns the direction of the ray through a point of the image, in pixels; unit length.
Vec3 pixel_ray(const CameraFrame& frame, const Camera& camera, double px, double py);

// The projection of a world point, in pixels; `in_front` is false for points at or behind the eye's plane.
struct PixelPosition {
    double x = 0, y = 0;
    bool in_front = false;
};
PixelPosition project(const CameraFrame& frame, const Camera& camera, const Vec3& point_m);

// Maps world to camera space, as a matrix for column vectors (v' = M v): x right, y up, looking along -z. Its
// memory, column by column, is that of OpenEXR's worldToCamera, which is row-major and for row vectors.
glm::mat4 world_to_camera(const CameraFrame& frame);

// Returns the camera at a time, without its path; a camera without path unchanged. Position and target are
// interpolated by cubic Hermite curves with the slopes of Fritsch and Butland (1984): they and their
// velocities are continuous, and monotonic between two keys in each coordinate, so that a camera near the
// ground stays above it. Before the first key and after the last the camera is constant. Where position and
// target would coincide, it has the direction of view of the key before. Pure.
Camera camera_at(const Camera& camera, double time_s);

}  // namespace nephos
