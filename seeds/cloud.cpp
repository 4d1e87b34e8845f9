// SPDX-License-Identifier: Apache-2.0
#include "seeds/cloud.h"

#include <algorithm>
#include <cmath>

#include "core/trigonometry.h"
#include "core/vec.h"
#include "seeds/checks.h"

namespace nephos {
namespace {

Vec3 sum(const Vec3& a, double fa, const Vec3& b, double fb) {
    return {a.x * fa + b.x * fb, a.y * fa + b.y * fb, a.z * fa + b.z * fb};
}

Vec3 unit(const Vec3& v, const char* what) {
    const double length = std::sqrt(dot(v, v));
    if (!(length > 1e-12) || !std::isfinite(length)) {
        usage_error(std::string(what) + " of the view has no direction");
    }
    return {v.x / length, v.y / length, v.z / length};
}

Plane through(const Vec3& point, const Vec3& normal) { return {normal, -dot(normal, point)}; }

}  // namespace

void enclose(Cloud& cloud) {
    cloud.centre_m = cloud.low_m = cloud.high_m = {};
    cloud.radius_m = 0;
    if (cloud.boxes.empty()) return;
    Vec3 low{kForever, kForever, kForever}, high{-kForever, -kForever, -kForever};
    for (const SeedBox& b : cloud.boxes) {
        low = {std::min(low.x, b.centre_m.x - b.size_m.x / 2), std::min(low.y, b.centre_m.y - b.size_m.y / 2),
               std::min(low.z, b.centre_m.z - b.size_m.z / 2)};
        high = {std::max(high.x, b.centre_m.x + b.size_m.x / 2),
                std::max(high.y, b.centre_m.y + b.size_m.y / 2),
                std::max(high.z, b.centre_m.z + b.size_m.z / 2)};
    }
    cloud.low_m = low;
    cloud.high_m = high;
    const Vec3 c = cloud.centre_m = sum(low, 0.5, high, 0.5);
    double corner2 = 0, farthest = 0;
    for (SeedBox& b : cloud.boxes) {
        const Vec3 d{std::abs(b.centre_m.x - c.x), std::abs(b.centre_m.y - c.y),
                     std::abs(b.centre_m.z - c.z)};
        const Vec3 corner = sum(d, 1, b.size_m, 0.5);
        corner2 = std::max(corner2, dot(corner, corner));
        b.distance = std::sqrt(dot(d, d));
        farthest = std::max(farthest, b.distance);
    }
    cloud.radius_m = std::sqrt(corner2);
    for (SeedBox& b : cloud.boxes) b.distance = farthest > 0 ? b.distance / farthest : 0;
}

Frustum frustum_of(const FrustumView& view) {
    if (!(view.fov_y_deg > 0 && view.fov_y_deg < 180)) {
        usage_error("field of view is " + text_of(view.fov_y_deg) + " degrees, expected between 0 and 180");
    }
    require_positive("aspect ratio of the view", view.aspect);
    require_positive("near distance of the view", view.near_m);
    if (!(view.far_m > view.near_m) || !std::isfinite(view.far_m)) {
        usage_error("far distance of the view is " + text_of(view.far_m) +
                    ", expected more than the near distance " + text_of(view.near_m));
    }
    const Vec3 forward = unit(view.forward, "forward");
    const Vec3 right = unit(cross(forward, unit(view.up, "up")), "forward and up");
    const Vec3 up = cross(right, forward);
    const Rotation half = rotation_of_degrees(view.fov_y_deg / 2);
    const double tan_y = half.sin / half.cos, tan_x = tan_y * view.aspect;
    const double cos_x = 1 / std::sqrt(1 + tan_x * tan_x), sin_x = tan_x * cos_x;

    Frustum f;
    f.planes = {through(sum(view.eye_m, 1, forward, view.near_m), forward),
                through(sum(view.eye_m, 1, forward, view.far_m), sum(forward, -1, {}, 0)),
                through(view.eye_m, sum(forward, sin_x, right, cos_x)),
                through(view.eye_m, sum(forward, sin_x, right, -cos_x)),
                through(view.eye_m, sum(forward, half.sin, up, half.cos)),
                through(view.eye_m, sum(forward, half.sin, up, -half.cos))};
    // Equally far from near and far corners, unless that point lies beyond the far plane.
    const double k2 = tan_x * tan_x + tan_y * tan_y;
    const double along = std::min((view.near_m + view.far_m) * (1 + k2) / 2, view.far_m);
    const double beyond = view.far_m - along;
    f.sphere = {sum(view.eye_m, 1, forward, along),
                std::sqrt(beyond * beyond + view.far_m * view.far_m * k2)};
    return f;
}

bool may_see(const Frustum& frustum, const Sphere& sphere) {
    const Vec3 d = sum(sphere.centre_m, 1, frustum.sphere.centre_m, -1);
    const double reach = sphere.radius_m + frustum.sphere.radius_m;
    if (dot(d, d) > reach * reach) return false;
    return std::ranges::all_of(frustum.planes, [&](const Plane& plane) {
        return dot(plane.normal, sphere.centre_m) + plane.offset_m >= -sphere.radius_m;
    });
}

}  // namespace nephos
