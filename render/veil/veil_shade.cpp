// SPDX-License-Identifier: Apache-2.0
#include "render/veil/veil_shade.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <tbb/parallel_for.h>

namespace nephos {
namespace {

constexpr double kLeastSunSine = 0.02;  // as in veil_pass.cpp: lower light is taken to be this high

// Nodes and weights of Simpson's rule over a slab, from its base to its top.
constexpr std::array<double, 5> kAt{0.02, 0.25, 0.5, 0.75, 0.98};
constexpr std::array<double, 5> kWeight{1.0 / 12, 4.0 / 12, 2.0 / 12, 4.0 / 12, 1.0 / 12};

}  // namespace

VeilShade::VeilShade(std::span<const DrawnVeil> veils, const PlaceBox& places, const Vec3& to_sun) {
    const double sine = std::max(to_sun.z, kLeastSunSine), level = std::hypot(to_sun.x, to_sun.y);
    slant_ = 1 / sine;
    if (level > 0) per_rise_ = std::sqrt(1 - sine * sine) / sine / level * Vec2(to_sun);
    if (!places.any()) return;
    for (const DrawnVeil& veil : veils)
        if (veil.slab->top_m() > places.low_m.z) maps_.push_back(map_of(veil, places));
}

VeilShade::Map VeilShade::map_of(const DrawnVeil& veil, const PlaceBox& places) const {
    Map map{.base_m = veil.slab->base_m(),
            .top_m = veil.slab->top_m(),
            .corner_m = {},
            .node_m = {},
            .depth = {}};
    const double middle = 0.5 * (map.base_m + map.top_m), thick = map.top_m - map.base_m;
    Vec2 low(1e300), high(-1e300);
    for (const double z : {places.low_m.z, std::min(places.high_m.z, map.top_m)}) {
        const Vec2 across = (middle - z) * per_rise_;
        low = glm::min(low, Vec2(places.low_m) + across);
        high = glm::max(high, Vec2(places.high_m) + across);
    }
    map.corner_m = low;
    map.node_m = glm::max((high - low) / double(kNodes - 1), 1.0);
    map.depth.resize(std::size_t{kNodes} * kNodes);
    const VeilView& view = veil.view;
    const double forwards = view.light == VeilLighting::physical ? 1 - view.g : 1,
                 per_density = forwards * veil.extinction_per_m * slant_ * thick;
    const double footprint = 0.7 * std::max(map.node_m.x, map.node_m.y);
    tbb::parallel_for(0, kNodes, [&](int row) {
        constexpr std::size_t kPoints = std::size_t{kNodes} * kAt.size();
        static_assert(kPoints % VeilSlab::kPointLanes == 0);
        std::vector<float> x(kPoints), y(kPoints), z(kPoints), size(kPoints, float(footprint)),
            density(kPoints);
        for (std::size_t n = 0; n < kPoints; ++n) {
            const double up = (kAt[n % kAt.size()] - 0.5) * thick;
            x[n] = float(double(n / kAt.size()) * map.node_m.x + up * per_rise_.x);
            y[n] = float(row * map.node_m.y + up * per_rise_.y);
            z[n] = float(up);
        }
        veil.slab->densities(
            {{map.corner_m.x, map.corner_m.y, middle}, x.data(), y.data(), z.data(), size.data(), kPoints},
            density.data());
        for (std::size_t column = 0; column < kNodes; ++column) {
            double sum = 0;
            for (std::size_t n = 0; n < kAt.size(); ++n) {
                const double factor = std::max(0.0, view.height_slope * (kAt[n] - 0.5) + view.height_offset);
                sum += kWeight[n] * factor * double(density[column * kAt.size() + n]);
            }
            map.depth[std::size_t(row) * kNodes + column] = float(per_density * sum);
        }
    });
    return map;
}

float VeilShade::Map::at(const Vec2& place_m) const {
    const Vec2 node = glm::clamp((place_m - corner_m) / node_m, 0.0, double(kNodes - 1));
    const Vec2 low = glm::min(glm::floor(node), double(kNodes - 2));
    const auto part_x = float(node.x - low.x), part_y = float(node.y - low.y);
    const float* const first = &depth[std::size_t(low.y) * kNodes + std::size_t(low.x)];
    const float near = first[0] + part_x * (first[1] - first[0]),
                far = first[kNodes] + part_x * (first[kNodes + 1] - first[kNodes]);
    return near + part_y * (far - near);
}

float VeilShade::depth_at(const Vec3& place_m) const {
    float sum = 0;
    for (const Map& map : maps_) {
        const double above = std::clamp((map.top_m - place_m.z) / (map.top_m - map.base_m), 0.0, 1.0);
        if (above <= 0) continue;
        const double middle = 0.5 * (map.base_m + map.top_m);
        sum += float(above) * map.at(Vec2(place_m) + (middle - place_m.z) * per_rise_);
    }
    return sum;
}

std::vector<float> VeilShade::content() const {
    std::vector<float> all{float(per_rise_.x), float(per_rise_.y), float(slant_)};
    for (const Map& map : maps_) {
        all.insert(all.end(), {float(map.base_m), float(map.top_m), float(map.corner_m.x),
                               float(map.corner_m.y), float(map.node_m.x), float(map.node_m.y)});
        all.insert(all.end(), map.depth.begin(), map.depth.end());
    }
    return all;
}

}  // namespace nephos
