// SPDX-License-Identifier: Apache-2.0
#include "simulation/framing.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/vec.h"

namespace nephos {
namespace {

constexpr double kEyeHeight_m = 2.0;

double radians(double degrees) { return degrees * std::numbers::pi / 180.0; }

// How far in front of the box's middle the eye must be for every corner to be within the picture, looking
// along `forward` with `right` and `up` as the picture's axes (all unit).
double fitting_distance(const Camera& camera, const WorldBox& box, const Vec3& forward, const Vec3& right,
                        const Vec3& up) {
    const double vertical = std::tan(radians(camera.vertical_fov_deg) / 2);
    const double horizontal = vertical * camera.width / camera.height;
    const Vec3 half{(box.max_m.x - box.min_m.x) / 2, (box.max_m.y - box.min_m.y) / 2,
                    (box.max_m.z - box.min_m.z) / 2};
    constexpr double kMargin = 1.05;
    double distance = 0;
    for (int corner = 0; corner < 8; ++corner) {
        const Vec3 p{corner & 1 ? half.x : -half.x, corner & 2 ? half.y : -half.y,
                     corner & 4 ? half.z : -half.z};
        const double across = std::max(std::abs(dot(p, right)) / horizontal, std::abs(dot(p, up)) / vertical);
        distance = std::max(distance, kMargin * across - dot(p, forward));
    }
    return distance;
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
    return {{at.origin_m.x + box.min[0] * edge, at.origin_m.y + box.min[1] * edge,
             at.origin_m.z + box.min[2] * edge},
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
    camera.target_m = centre;
    switch (view) {
        case View::side: {
            const double sine = std::sin(radians(6)), cosine = std::cos(radians(6));
            const double distance =
                fitting_distance(camera, box, {0, cosine, -sine}, {1, 0, 0}, {0, sine, cosine});
            camera.position_m = {centre.x, centre.y - distance * cosine, centre.z + distance * sine};
            break;
        }
        case View::below:
            camera.position_m = {centre.x, box.min_m.y - (box.max_m.y - box.min_m.y) / 4,
                                 ground_m + kEyeHeight_m};
            break;
        case View::above: {
            const double distance = fitting_distance(camera, box, {0, 0, -1}, {1, 0, 0}, {0, 1, 0});
            camera.position_m = {centre.x, centre.y, centre.z + distance};
            break;
        }
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
    const double edge =
        ((box.max_m.x - box.min_m.x) + (box.max_m.y - box.min_m.y) + (box.max_m.z - box.min_m.z)) / 3;
    constexpr double kOpticalDepth = 12;
    return kOpticalDepth / (sum / double(voxels) * edge);
}

}  // namespace nephos
