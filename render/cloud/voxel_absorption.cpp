// SPDX-License-Identifier: Apache-2.0
#include "render/cloud/voxel_absorption.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/vec.h"

namespace nephos {
namespace {

constexpr double kMostCubes = 1 << 24;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Integral of the metaball field over its ball, in units of radius^3.
constexpr double kContent = 4 * std::numbers::pi * 184.0 / 2835.0;

double coordinate(const Vec3& v, int axis) { return axis == 0 ? v.x : axis == 1 ? v.y : v.z; }

struct Bounds {
    double low[3] = {kInfinity, kInfinity, kInfinity};
    double high[3] = {-kInfinity, -kInfinity, -kInfinity};
};

}  // namespace

DensityBlocks::DensityBlocks(const PreparedCloud& cloud, double extinction_per_m) {
    if (cloud.visible.empty()) return;
    Bounds bounds;
    double radii = 0;
    for (const std::uint32_t index : cloud.visible) {
        const Metaball& ball = cloud.metaballs[index];
        const double centre[3] = {ball.x, ball.y, ball.z};
        for (int axis = 0; axis < 3; ++axis) {
            bounds.low[axis] = std::min(bounds.low[axis], centre[axis]);
            bounds.high[axis] = std::max(bounds.high[axis], centre[axis]);
        }
        radii += ball.radius;
    }
    edge_m_ = 0.5 * radii / double(cloud.visible.size());
    const auto cubes = [&](int axis) {
        return std::floor((bounds.high[axis] - bounds.low[axis]) / edge_m_) + 3;
    };
    while (cubes(0) * cubes(1) * cubes(2) > kMostCubes) edge_m_ *= 1.25;
    for (int axis = 0; axis < 3; ++axis) {
        size_[axis] = int(cubes(axis));
        // One cube more on each side: contents are shared with neighbours.
        origin_m_[axis] = 0.5 * (bounds.low[axis] + bounds.high[axis] - size_[axis] * edge_m_);
    }
    densities_.resize(std::size_t(size_[0]) * std::size_t(size_[1]) * std::size_t(size_[2]));

    const double scale = kContent / (extinction_per_m * edge_m_ * edge_m_ * edge_m_);
    for (std::size_t i = 0; i < cloud.visible.size(); ++i) {
        const Metaball& ball = cloud.metaballs[cloud.visible[i]];
        const double content = scale * double(cloud.depth_scale[i]) * ball.radius * ball.radius;
        const double centre[3] = {ball.x, ball.y, ball.z};
        int low[3];
        double above[3];
        for (int axis = 0; axis < 3; ++axis) {
            const double place = (centre[axis] - origin_m_[axis]) / edge_m_ - 0.5;  // in middles of cubes
            low[axis] = std::clamp(int(std::floor(place)), 0, size_[axis] - 2);
            above[axis] = std::clamp(place - low[axis], 0.0, 1.0);
        }
        for (int corner = 0; corner < 8; ++corner) {
            double fraction = content;
            std::size_t at[3];
            for (int axis = 0; axis < 3; ++axis) {
                const int up = corner >> axis & 1;
                fraction *= up != 0 ? above[axis] : 1 - above[axis];
                at[axis] = std::size_t(low[axis] + up);
            }
            densities_[(at[2] * std::size_t(size_[1]) + at[1]) * std::size_t(size_[0]) + at[0]] +=
                float(fraction);
        }
    }
}

float DensityBlocks::density(const int (&cell)[3]) const {
    return densities_[(std::size_t(cell[2]) * std::size_t(size_[1]) + std::size_t(cell[1])) *
                          std::size_t(size_[0]) +
                      std::size_t(cell[0])];
}

// Traverses the grid cube by cube with the distance to the next face on each axis (3-D DDA, Amanatides and
// Woo 1987).
double DensityBlocks::column_m(const Vec3& from_m, const Vec3& way, double length_m, double enough_m) const {
    if (densities_.empty()) return 0;
    double enter = 0, leave = length_m;
    for (int axis = 0; axis < 3; ++axis) {
        const double start = coordinate(from_m, axis) - origin_m_[axis], direction = coordinate(way, axis);
        const double extent = size_[axis] * edge_m_;
        if (direction == 0) {
            if (start < 0 || start > extent) return 0;
            continue;
        }
        const double a = -start / direction, b = (extent - start) / direction;
        enter = std::max(enter, std::min(a, b));
        leave = std::min(leave, std::max(a, b));
    }
    if (!(enter < leave)) return 0;

    int cell[3], step[3];
    double next[3], between[3];
    for (int axis = 0; axis < 3; ++axis) {
        const double direction = coordinate(way, axis);
        const double place = (coordinate(from_m, axis) + enter * direction - origin_m_[axis]) / edge_m_;
        cell[axis] = std::clamp(int(std::floor(place)), 0, size_[axis] - 1);
        step[axis] = direction > 0 ? 1 : -1;
        between[axis] = direction == 0 ? kInfinity : edge_m_ / std::abs(direction);
        const double face = cell[axis] + (direction > 0 ? 1 : 0);
        next[axis] = direction == 0 ? kInfinity : enter + (face - place) * edge_m_ / direction;
    }
    double sum = 0, at = enter;
    while (at < leave && sum < enough_m) {
        const int axis = next[0] < next[1] ? (next[0] < next[2] ? 0 : 2) : (next[1] < next[2] ? 1 : 2);
        const double end = std::min(next[axis], leave);
        sum += double(density(cell)) * std::max(end - at, 0.0);
        at = std::max(at, end);
        cell[axis] += step[axis];
        next[axis] += between[axis];
        if (cell[axis] < 0 || cell[axis] >= size_[axis]) break;
    }
    return sum;
}

double DensityBlocks::absorbed_towards(const Vec3& from_m, const Vec3& to_light,
                                       double light_distance_m) const {
    return std::clamp(column_m(from_m, to_light, kInfinity, light_distance_m) / light_distance_m, 0.0, 1.0);
}

double DensityBlocks::absorbed_from(const Vec3& from_m, const Vec3& light_m, double light_distance_m) const {
    const Vec3 way = light_m - from_m;
    const double distance = length(way);
    if (!(distance > 0)) return 0;
    return std::clamp(column_m(from_m, (1 / distance) * way, distance, light_distance_m) / light_distance_m,
                      0.0, 1.0);
}

namespace {

// 1 - absorbed(centre) of each visible metaball.
template <class Absorbed>
std::vector<float> light_at_centres(const PreparedCloud& cloud, const Absorbed& absorbed) {
    std::vector<float> light;
    light.reserve(cloud.visible.size());
    for (const std::uint32_t index : cloud.visible) {
        const Metaball& ball = cloud.metaballs[index];
        light.push_back(float(1 - absorbed(Vec3{ball.x, ball.y, ball.z})));
    }
    return light;
}

}  // namespace

std::vector<float> light_by_absorption(const PreparedCloud& cloud, const DensityBlocks& blocks,
                                       const Vec3& to_sun, double light_distance_m) {
    return light_at_centres(
        cloud, [&](const Vec3& from) { return blocks.absorbed_towards(from, to_sun, light_distance_m); });
}

std::vector<float> flash_by_absorption(const PreparedCloud& cloud, const DensityBlocks& blocks,
                                       const Vec3& flash_m, double light_distance_m) {
    return light_at_centres(
        cloud, [&](const Vec3& from) { return blocks.absorbed_from(from, flash_m, light_distance_m); });
}

std::vector<float> shadow_by_absorption(const DensityBlocks& blocks, const ShadowFrame& frame,
                                        int shadow_size, double light_distance_m) {
    std::vector<float> shadow;
    shadow.reserve(std::size_t(shadow_size) * std::size_t(shadow_size));
    for (int v = 0; v < shadow_size; ++v) {
        for (int u = 0; u < shadow_size; ++u) {
            const Vec3 start = frame.origin_m + ((u + 0.5) / shadow_size) * frame.u_axis_m +
                               ((v + 0.5) / shadow_size) * frame.v_axis_m;
            shadow.push_back(float(1 - blocks.absorbed_towards(start, frame.direction, light_distance_m)));
        }
    }
    return shadow;
}

}  // namespace nephos
