// SPDX-License-Identifier: Apache-2.0
#include "apps/framing.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace nephos {
namespace {

constexpr double kEyeHeight_m = 2.0;

double radians(double degrees) { return degrees * std::numbers::pi / 180.0; }

// Half the angle of the widest cone around the view direction that lies within the picture.
double half_angle(const Camera& camera) {
    const double vertical = radians(camera.vertical_fov_deg) / 2;
    const double horizontal = std::atan(std::tan(vertical) * camera.width / camera.height);
    return std::min(vertical, horizontal);
}

}  // namespace

WorldBox cloud_box(const DensityGrid& grid) {
    const Placement& at = grid.placement();
    VoxelBox box = grid.bounding_box();
    if (box.empty()) {
        const Extent extent = grid.extent();
        box = {{0, 0, 0}, {std::max(0, extent.x - 1), std::max(0, extent.y - 1), std::max(0, extent.z - 1)}};
    }
    const double edge = at.cell_size_m;
    return {{at.origin_m.x + box.min[0] * edge, at.origin_m.y + box.min[1] * edge, at.origin_m.z + box.min[2] * edge},
            {at.origin_m.x + (box.max[0] + 1.0) * edge, at.origin_m.y + (box.max[1] + 1.0) * edge,
             at.origin_m.z + (box.max[2] + 1.0) * edge}};
}

double ground_below(const WorldBox& box) {
    if (box.min_m.z >= 0) return 0;
    return box.min_m.z - (box.max_m.z - box.min_m.z) / 2;
}

void frame(Camera& camera, const WorldBox& box, View view, double ground_m) {
    const Vec3 centre{(box.min_m.x + box.max_m.x) / 2, (box.min_m.y + box.max_m.y) / 2,
                      (box.min_m.z + box.max_m.z) / 2};
    const double dx = box.max_m.x - box.min_m.x, dy = box.max_m.y - box.min_m.y, dz = box.max_m.z - box.min_m.z;
    const double radius = std::sqrt(dx * dx + dy * dy + dz * dz) / 2;
    const double distance = radius / std::sin(half_angle(camera));
    camera.target_m = centre;
    switch (view) {
        case View::side: {
            const double elevation = radians(6);
            camera.position_m = {centre.x, centre.y - distance * std::cos(elevation),
                                 centre.z + distance * std::sin(elevation)};
            break;
        }
        case View::below:
            camera.position_m = {centre.x, box.min_m.y - 0.25 * dy, ground_m + kEyeHeight_m};
            break;
        case View::above: camera.position_m = {centre.x, centre.y, centre.z + distance}; break;
    }
    camera.position_m.z = std::max(camera.position_m.z, ground_m + kEyeHeight_m);
    // Only when the box is a point on the ground below the eye.
    if (camera.position_m == camera.target_m) camera.position_m.y -= 1;
}

double visible_extinction_per_m(const DensityGrid& grid) {
    const std::uint64_t voxels = grid.active_voxels();
    const double sum = grid.sum();
    if (voxels == 0 || !(sum > 0)) return 1;
    const WorldBox box = cloud_box(grid);
    const double edge = ((box.max_m.x - box.min_m.x) + (box.max_m.y - box.min_m.y) + (box.max_m.z - box.min_m.z)) / 3;
    constexpr double kOpticalDepth = 12;
    return kOpticalDepth / (sum / double(voxels) * edge);
}

}  // namespace nephos
