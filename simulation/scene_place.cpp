// SPDX-License-Identifier: Apache-2.0
#include "simulation/scene_place.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <set>

namespace nephos {
namespace {

const Wind& common_wind(const Scene& scene) {
    return scene.automaton.wind.keyframes.empty() && !scene.layers.empty() ? layer_wind(scene, 0)
                                                                           : scene.automaton.wind;
}

const Wind& wind_of_height(const Scene& scene, double height_m) {
    for (std::size_t n = 0; n < scene.layers.size(); ++n) {
        const LayerOptions& layer = scene.layers[n];
        const double low = layer.placement.origin_m.z;
        if (height_m >= low && height_m < low + layer.extent.z * layer.placement.cell_size_m)
            return layer_wind(scene, n);
    }
    return common_wind(scene);
}

double height_of_level(const Placement& box, int k) { return box.origin_m.z + (k + 0.5) * box.cell_size_m; }

bool have_one_wind(const Scene& scene) {
    const Wind& first = common_wind(scene);
    for (std::size_t n = 0; n < scene.layers.size(); ++n)
        if (!(layer_wind(scene, n) == first)) return false;
    return true;
}

// Of one axis of a box: where it begins, and how far it goes.
struct Stretch {
    double begin_m = 0, length_m = 0;
    bool operator==(const Stretch&) const = default;
};

std::optional<Stretch> period_of(const Placement& at, Extent extent, Boundaries boundaries, int axis) {
    const int cells = axis == 0 ? extent.x : axis == 1 ? extent.y : extent.z;
    const Boundary boundary = axis == 0 ? boundaries.x : axis == 1 ? boundaries.y : boundaries.z;
    if (boundary != Boundary::periodic) return {};
    return Stretch{at.origin_m[axis], cells * at.cell_size_m};
}

}  // namespace

std::vector<Velocity> wind_of_levels(const Scene& scene, std::optional<std::size_t> layer,
                                     const Placement& box, Extent size, double time_s) {
    std::vector<Velocity> velocities;
    for (int k = 0; k < size.z; ++k) {
        const double height = height_of_level(box, k);
        velocities.push_back(
            wind_at(layer ? layer_wind(scene, *layer) : wind_of_height(scene, height), height, time_s));
    }
    return velocities;
}

std::vector<WindLevel> wind_levels(const Scene& scene, std::optional<std::size_t> layer, const Placement& box,
                                   Extent size, double time_s) {
    if (layer) return profile_at(layer_wind(scene, *layer), time_s);
    if (have_one_wind(scene)) return profile_at(common_wind(scene), time_s);
    std::vector<WindLevel> levels;
    const std::vector<Velocity> velocities = wind_of_levels(scene, {}, box, size, time_s);
    for (int k = 0; k < size.z; ++k) levels.push_back({height_of_level(box, k), velocities[std::size_t(k)]});
    return levels;
}

Velocity wind_at_height(const Scene& scene, double height_m, double time_s) {
    return wind_at(wind_of_height(scene, height_m), height_m, time_s);
}

std::vector<WindLevel> wind_profile(const Scene& scene, double time_s) {
    if (have_one_wind(scene)) return profile_at(common_wind(scene), time_s);
    std::set<double> heights;
    const auto add = [&](const Wind& wind) {  // the levels that are of this wind
        for (const WindLevel& level : profile_at(wind, time_s))
            if (&wind_of_height(scene, level.height_m) == &wind) heights.insert(level.height_m);
    };
    add(common_wind(scene));
    for (std::size_t n = 0; n < scene.layers.size(); ++n) {
        const LayerOptions& layer = scene.layers[n];
        add(layer_wind(scene, n));
        for (const int k : {0, layer.extent.z - 1}) heights.insert(height_of_level(layer.placement, k));
        for (const int k : {-1, layer.extent.z}) {  // where another wind begins
            const double height = height_of_level(layer.placement, k);
            if (&wind_of_height(scene, height) != &layer_wind(scene, n)) heights.insert(height);
        }
    }
    std::vector<WindLevel> levels;
    for (const double height : heights) levels.push_back({height, wind_at_height(scene, height, time_s)});
    return levels;
}

// Bowring's formula of one step, exact to 1e-9 degrees near the surface: Survey Review 23 (1976), p. 323.
double msl_height_m(const Georeference& place) {
    if (!place.given) return 0;
    return place.height_m - (place.height_datum == HeightDatum::ellipsoid ? place.geoid_height_m : 0.0);
}

GeodeticPlace geodetic_place(const Georeference& place, const Vec3& world_m) {
    constexpr double kA = 6378137.0, kF = 1 / 298.257223563, kB = kA * (1 - kF), kE2 = kF * (2 - kF),
                     kSecond = kE2 / (1 - kE2), kDegrees = 180 / std::numbers::pi;
    const Matrix4 m = ecef_from_world(place);
    std::array<double, 3> p{};
    for (std::size_t row = 0; row < 3; ++row)
        p[row] =
            m[4 * row] * world_m.x + m[4 * row + 1] * world_m.y + m[4 * row + 2] * world_m.z + m[4 * row + 3];
    const double from_axis = std::hypot(p[0], p[1]), u = std::atan2(p[2] * kA, from_axis * kB);
    const double latitude = std::atan2(p[2] + kSecond * kB * std::pow(std::sin(u), 3),
                                       from_axis - kE2 * kA * std::pow(std::cos(u), 3));
    return {latitude * kDegrees, std::atan2(p[1], p[0]) * kDegrees};
}

Vec3 period_m(const Scene& scene, std::optional<std::size_t> layer) {
    Vec3 period{};
    for (int axis = 0; axis < 3; ++axis) {
        std::optional<Stretch> common;
        const auto of_layer = [&](const LayerOptions& l) {
            return period_of(l.placement, l.extent, l.boundaries, axis);
        };
        if (layer) {
            common = of_layer(scene.layers[*layer]);
        } else if (scene.layers.empty()) {
            common = period_of(scene.automaton.placement, scene.automaton.extent, scene.automaton.boundaries,
                               axis);
        } else {
            bool first = true;
            for (const LayerOptions& l : scene.layers) {
                if (!has_density(l)) continue;
                const std::optional<Stretch> own = of_layer(l);
                common = first || (own && common == own) ? own : std::nullopt;
                first = false;
                if (!common) break;
            }
        }
        if (common) period[axis] = common->length_m;
    }
    return period;
}

}  // namespace nephos
