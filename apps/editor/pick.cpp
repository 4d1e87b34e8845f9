// SPDX-License-Identifier: Apache-2.0
// Finds what the picture shows under the mouse: the point of the nearest cloud, to go to or to let lightning strike.

#include <algorithm>
#include <cmath>
#include <limits>

#include "apps/editor/state.h"
#include "render/options/camera.h"

namespace nephos {
namespace {

constexpr double kNowhere = std::numeric_limits<double>::infinity();

struct Ray {
    Vec3 from{}, way{};  // way: unit length
};

// Holds the distances at which a ray enters and leaves a box; `enter` is kNowhere when it misses the box.
struct Crossing {
    double enter = kNowhere, leave = -kNowhere;
};

Crossing crossing_of(const Ray& ray, const Vec3& min, const Vec3& max) {
    double enter = 0, leave = kNowhere;
    for (int axis = 0; axis < 3; ++axis) {
        const double way = ray.way[axis], from = ray.from[axis];
        if (std::abs(way) < 1e-12) {
            if (from < min[axis] || from > max[axis]) return {};
            continue;
        }
        const double a = (min[axis] - from) / way, b = (max[axis] - from) / way;
        enter = std::max(enter, std::min(a, b));
        leave = std::min(leave, std::max(a, b));
    }
    return enter <= leave ? Crossing{enter, leave} : Crossing{};
}

// Distance to the first voxel that is at least a tenth cloud.
double first_voxel(const Ray& ray, const DensityGrid& grid) {
    const VoxelBox box = grid.bounding_box();
    if (box.empty()) return kNowhere;
    const double edge = grid.placement().cell_size_m;
    const Vec3& origin = grid.placement().origin_m;
    const auto corner = [&](const std::array<int, 3>& voxel, int more) {
        return origin + edge * Vec3{double(voxel[0] + more), double(voxel[1] + more), double(voxel[2] + more)};
    };
    const Crossing inside = crossing_of(ray, corner(box.min, 0), corner(box.max, 1));
    for (double t = inside.enter; t <= inside.leave; t += 0.5 * edge) {
        const Vec3 at = (1 / edge) * (ray.from + t * ray.way - origin);
        if (grid.value(int(std::floor(at.x)), int(std::floor(at.y)), int(std::floor(at.z))) > 0.1f) return t;
    }
    return kNowhere;
}

// Distance to the first box of a cloud that is drawn directly.
double first_box(const Ray& ray, const LayerFrame& layer) {
    double nearest = kNowhere;
    for (const SkyCloud& cloud : layer.clouds) {
        const Vec3 place = layer.sky->position_m(cloud);
        for (const SeedBox& box : layer.sky->shape(cloud).boxes) {
            const Vec3 centre = place + box.centre_m, half = 0.5 * box.size_m;
            nearest = std::min(nearest, crossing_of(ray, centre - half, centre + half).enter);
        }
    }
    return nearest;
}

}  // namespace

std::optional<Vec3> cloud_under(const Editor& editor, const ImVec2& mouse) {
    const std::shared_ptr<const LiveFrame> frame = editor.live->frame();
    if (!frame) return std::nullopt;
    const Camera camera = camera_of_view(editor);
    const CameraFrame axes = camera_frame(camera);
    const Ray ray{camera.position_m, pixel_ray(axes, camera, double(mouse.x - editor.view_min.x),
                                               double(mouse.y - editor.view_min.y))};
    double nearest = first_voxel(ray, frame->frame.density);
    for (const LayerFrame& layer : frame->frame.layers) {
        if (layer.direct && layer.sky != nullptr) nearest = std::min(nearest, first_box(ray, layer));
    }
    if (nearest == kNowhere) return std::nullopt;
    return ray.from + nearest * ray.way;
}

Vec3 point_under(const Editor& editor, const ImVec2& mouse) {
    if (const std::optional<Vec3> cloud = cloud_under(editor, mouse)) return *cloud;
    const Camera camera = camera_of_view(editor);
    const Vec3 way = pixel_ray(camera_frame(camera), camera, double(mouse.x - editor.view_min.x),
                               double(mouse.y - editor.view_min.y));
    return camera.position_m + length(camera.target_m - camera.position_m) * way;
}

bool go_to_cloud(Editor& editor, const ImVec2& mouse) {
    const std::optional<Vec3> cloud = cloud_under(editor, mouse);
    if (!cloud) {
        say(editor, "There is no cloud under the mouse", true);
        return false;
    }
    Camera& camera = editor.camera.camera;
    // Half of the way, and not nearer than what still looks like a cloud.
    const Vec3 way = *cloud - camera.position_m;
    const double distance = length(way), rest = std::min(distance, std::max(0.5 * distance, 250.0));
    camera.position_m = *cloud - (rest / std::max(distance, 1e-6)) * way;
    camera.target_m = *cloud;
    editor.camera.moved = true;
    say(editor, "The view turns round this cloud now; double-click again to go nearer");
    return true;
}

}  // namespace nephos
