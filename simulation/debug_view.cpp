// SPDX-License-Identifier: Apache-2.0
#include "simulation/debug_view.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/vec.h"
#include "render/options/camera.h"

namespace nephos {
namespace {

constexpr Rgb kBoxes{0.05, 0.15, 0.9}, kRoots{0.1, 0.35, 1}, kOutside{1, 0.85, 0.05}, kInside{0.9, 0.02, 0.02};
constexpr Rgb kAxes[3] = {{0.8, 0.1, 0.1}, {0.1, 0.6, 0.1}, {0.1, 0.3, 0.9}};

// The lines of one cloud; everything below is in its model space.
class CloudLines {
  public:
    CloudLines(const Cloud& cloud, const BaseModel& model, const Vec3& place, std::vector<WorldLine>& out)
        : cloud_(cloud), model_(model), place_(place), out_(out) {}

    void boxes() {
        for (const SeedBox& box : cloud_.boxes) {
            const auto corner = [&](int bits) {
                return Vec3{box.centre_m.x + ((bits & 1) != 0 ? 0.5 : -0.5) * box.size_m.x,
                            box.centre_m.y + ((bits & 2) != 0 ? 0.5 : -0.5) * box.size_m.y,
                            box.centre_m.z + ((bits & 4) != 0 ? 0.5 : -0.5) * box.size_m.z};
            };
            for (int bits = 0; bits < 8; ++bits)
                for (const int axis : {1, 2, 4})
                    if ((bits & axis) == 0) add(corner(bits), corner(bits | axis), kBoxes);
        }
    }

    void axes() {
        const Vec3 ends[3] = {{cloud_.radius_m, 0, 0}, {0, cloud_.radius_m, 0}, {0, 0, cloud_.radius_m}};
        for (int axis = 0; axis < 3; ++axis)
            add(cloud_.centre_m, cloud_.centre_m + ends[axis], kAxes[axis], 1.75);
    }

    void roots() {
        for (const SeedBox& box : cloud_.boxes) {
            if (box.level != 0) continue;
            for (const Root& root : model_.seeds[box.seed].roots) arrow(box, root);
        }
    }

    void rays(const Light& light) {
        for (const SeedBox& box : cloud_.boxes) ray(box.centre_m, light);
    }

  private:
    void add(const Vec3& from, const Vec3& to, const Rgb& colour, double width = 1.25) {
        out_.push_back({from + place_, to + place_, colour, width});
    }

    // One and a half radii long: its head lies beyond where the first children are.
    void arrow(const SeedBox& box, const Root& root) {
        const RootAxes axes = axes_of(root);
        const double size = 0.75 * length(box.size_m);
        const auto towards = [&](double along, double side, double up) {
            return box.centre_m + size * (along * axes.ahead + (side * axes.side + up * axes.up));
        };
        const Vec3 tip = towards(1, 0, 0);
        add(box.centre_m, tip, kRoots, 1.75);
        for (const double side : {-0.12, 0.12}) {
            add(towards(0.8, side, 0), tip, kRoots, 1.75);
            add(towards(0.8, 0, side), tip, kRoots, 1.75);
        }
    }

    // From a box's centre towards the light until a little beyond the cloud.
    void ray(const Vec3& from, const Light& light) {
        Vec3 way = light.towards;
        if (!light.at_infinity) way = way - (from + place_);
        const double distance = length(way);
        if (!(distance > 0)) return;
        way = (1 / distance) * way;
        const Vec3 offset = from - cloud_.centre_m;
        const double middle = dot(offset, way);
        const double beyond = length(offset) * length(offset) - 1.2 * 1.2 * cloud_.radius_m * cloud_.radius_m;
        double end = -middle + std::sqrt(std::max(middle * middle - beyond, 0.0));
        if (!light.at_infinity) end = std::min(end, distance);
        add(from, from + end * way, kOutside, 1);
        for (const auto& [enter, leave] : inside(from, way, end))
            add(from + enter * way, from + leave * way, kInside, 1.75);
    }

    // Where a ray is inside of boxes, as intervals that do not touch; the slab test of Kay and Kajiya.
    std::vector<std::pair<double, double>> inside(const Vec3& from, const Vec3& way, double end) const {
        std::vector<std::pair<double, double>> all, joined;
        for (const SeedBox& box : cloud_.boxes) {
            double enter = 0, leave = end;
            const auto slab = [&](double origin, double direction, double centre, double size) {
                const double low = centre - 0.5 * size - origin, high = centre + 0.5 * size - origin;
                if (direction == 0) {
                    if (low > 0 || high < 0) leave = -1;
                    return;
                }
                enter = std::max(enter, std::min(low / direction, high / direction));
                leave = std::min(leave, std::max(low / direction, high / direction));
            };
            slab(from.x, way.x, box.centre_m.x, box.size_m.x);
            slab(from.y, way.y, box.centre_m.y, box.size_m.y);
            slab(from.z, way.z, box.centre_m.z, box.size_m.z);
            if (enter < leave) all.emplace_back(enter, leave);
        }
        std::ranges::sort(all);
        for (const auto& interval : all) {
            if (joined.empty() || interval.first > joined.back().second)
                joined.push_back(interval);
            else
                joined.back().second = std::max(joined.back().second, interval.second);
        }
        return joined;
    }

    const Cloud& cloud_;
    const BaseModel& model_;
    Vec3 place_{};
    std::vector<WorldLine>& out_;
};

}  // namespace

std::vector<WorldLine> debug_lines(const SkySimulation& sky, std::span<const SkyCloud> clouds,
                                   const RenderOptions& options, const Light& light) {
    const DebugView& view = options.debug_view;
    std::vector<WorldLine> out;
    if (!view.any()) return out;
    const CameraFrame camera = camera_frame(options.camera);
    const Frustum frustum(camera);
    for (const SkyCloud& cloud : clouds) {
        const Sphere sphere = sky.sphere(cloud);
        if (!frustum.may_see(sphere.centre_m - camera.position_m, sphere.radius_m)) continue;
        CloudLines lines(sky.shape(cloud), sky.model(cloud), sky.position_m(cloud), out);
        if (view.boxes) lines.boxes();
        if (view.rays) lines.rays(light);
        if (view.axes) lines.axes();
        if (view.roots) lines.roots();
    }
    return out;
}

}  // namespace nephos
