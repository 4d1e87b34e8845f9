// SPDX-License-Identifier: Apache-2.0
#include "seeds/parcel_absorption.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "seeds/checks.h"

namespace nephos {
namespace {

constexpr double kReach = 1.5;         // in semi-axes, from where on a cloud has no part
constexpr double kWholeWeight = 4;     // 1 / the weight from which on an ellipsoid takes part as a whole
constexpr int kMostCells = 64;         // on a side
constexpr double kBeyondWorld = 0.25;  // of a period: how far beyond the world voxels may lie

double fade(double r) { return std::clamp((kReach - r) / (kReach - 1), 0.0, 1.0); }

bool has_part(const AbsorbingCloud& cloud) {
    return cloud.strength > 0 &&
           std::ranges::any_of(cloud.ellipsoids, [](const ActiveEllipsoid& e) { return e.weight > 0; });
}

// The box in which a cloud has a part.
void reach_of(const std::vector<ActiveEllipsoid>& ellipsoids, Vec3& low_m, Vec3& high_m) {
    low_m = Vec3(std::numeric_limits<double>::max());
    high_m = -low_m;
    for (const ActiveEllipsoid& each : ellipsoids) {
        const Vec3 reach = kReach * each.ellipsoid.semi_axes_m;
        low_m = glm::min(low_m, each.ellipsoid.centre_m - reach);
        high_m = glm::max(high_m, each.ellipsoid.centre_m + reach);
    }
}

// Appends a cloud and its images that reach the world.
void append_images(std::vector<AbsorbingCloud>& out, const AbsorbingCloud& cloud, const WorldRectangle& world,
                   const Vec2& period_m) {
    Vec3 low, high;
    reach_of(cloud.ellipsoids, low, high);
    const auto images = [](double period, double from, double to, double min, double max) {
        std::pair<int, int> range{0, 0};
        if (period > 0) {
            range.first = int(std::ceil((min - kBeyondWorld * period - to) / period));
            range.second = int(std::floor((max + kBeyondWorld * period - from) / period));
        }
        return range;
    };
    const auto [first_x, last_x] = images(period_m.x, low.x, high.x, world.min_x_m, world.max_x_m);
    const auto [first_y, last_y] = images(period_m.y, low.y, high.y, world.min_y_m, world.max_y_m);
    for (int y = first_y; y <= last_y; ++y) {
        for (int x = first_x; x <= last_x; ++x) {
            AbsorbingCloud& image = out.emplace_back(cloud);
            for (ActiveEllipsoid& each : image.ellipsoids)
                each.ellipsoid.centre_m += Vec3(x * period_m.x, y * period_m.y, 0);
        }
    }
}

}  // namespace

void append_absorbing(std::vector<AbsorbingCloud>& out, const SkySimulation& sky,
                      std::span<const SkyCloud> clouds, const CouplingOptions& coupling,
                      const ParcelLight& light, double time_s) {
    check(coupling);
    require_in("absorption of light: strength", light.strength, 0, 1);
    const double state = sky.state_at(time_s);
    for (const SkyCloud& cloud : clouds) {
        for (const CloudForm& form : sky.forms(cloud, state)) {
            AbsorbingCloud absorbing;
            absorbing.light_distance_m = sky.model(form).light_distance_m;
            absorbing.strength = light.strength;
            if (!std::isfinite(absorbing.light_distance_m)) continue;
            append_ellipsoids(absorbing.ellipsoids, sky.model(form), sky.shapes()[form.shape].cloud,
                              sky.position_m(cloud), form.phase, sky.options().formation_softness, coupling);
            if (has_part(absorbing)) append_images(out, absorbing, sky.options().world, light.period_m);
        }
    }
}

ParcelAbsorption::ParcelAbsorption(std::span<const AbsorbingCloud> clouds, const Vec3& to_sun)
    : to_sun_(to_sun) {
    const double distance = length(to_sun);
    if (!(distance > 0) || !std::isfinite(distance))
        usage_error("absorption of light: the direction to the sun has no length, expected any other");
    to_sun_ = (1 / distance) * to_sun;
    for (const AbsorbingCloud& cloud : clouds) {
        require_positive("absorption of light: light distance (m)", cloud.light_distance_m);
        require_in("absorption of light: strength", cloud.strength, 0, 1);
        if (!has_part(cloud)) continue;
        Group group;
        group.first = parcels_.size();
        group.light_distance_m = cloud.light_distance_m;
        group.strength = cloud.strength;
        reach_of(cloud.ellipsoids, group.low_m, group.high_m);
        for (const ActiveEllipsoid& each : cloud.ellipsoids) {
            if (each.weight <= 0) continue;
            Parcel parcel;
            parcel.centre_m = each.ellipsoid.centre_m;
            parcel.per_m = 1.0 / each.ellipsoid.semi_axes_m;
            parcel.way = to_sun_ * parcel.per_m;
            parcel.weight = each.weight;
            parcels_.push_back(parcel);
        }
        group.count = parcels_.size() - group.first;
        clouds_.push_back(group);
    }
    bin();
}

void ParcelAbsorption::bin() {
    if (clouds_.empty()) return;
    Vec2 high = clouds_.front().high_m;
    low_m_ = clouds_.front().low_m;
    for (const Group& cloud : clouds_) {
        low_m_ = glm::min(low_m_, Vec2(cloud.low_m));
        high = glm::max(high, Vec2(cloud.high_m));
    }
    const Vec2 edges = high - low_m_;
    const double cell_m = std::max(edges.x, edges.y) / kMostCells;
    for (int axis = 0; axis < 2; ++axis) {
        cells_[axis] = std::max(int(std::ceil(edges[axis] / cell_m)), 1);
        per_m_[axis] = cells_[axis] / edges[axis];
    }
    const auto cell = [&](const Vec3& place, int axis) {
        return std::clamp(int((place[axis] - low_m_[axis]) * per_m_[axis]), 0, cells_[axis] - 1);
    };
    const auto each_cell = [&](const Group& cloud, const auto& work) {
        for (int y = cell(cloud.low_m, 1); y <= cell(cloud.high_m, 1); ++y)
            for (int x = cell(cloud.low_m, 0); x <= cell(cloud.high_m, 0); ++x)
                work(std::size_t(y) * std::size_t(cells_[0]) + std::size_t(x));
    };
    first_.assign(std::size_t(cells_[0]) * std::size_t(cells_[1]) + 1, 0);
    for (const Group& cloud : clouds_) each_cell(cloud, [&](std::size_t at) { ++first_[at + 1]; });
    for (std::size_t at = 1; at < first_.size(); ++at) first_[at] += first_[at - 1];
    listed_.resize(first_.back());
    std::vector<std::uint32_t> next(first_.begin(), first_.end() - 1);
    for (std::size_t n = 0; n < clouds_.size(); ++n)
        each_cell(clouds_[n], [&](std::size_t at) { listed_[next[at]++] = std::uint32_t(n); });
}

// Part and absorption of one cloud, multiplied. In an ellipsoid's own space the ray q + t way meets the unit sphere at the roots
// of way^2 t^2 + 2 (q . way) t + q^2 - 1.
template <class WayOf>
double ParcelAbsorption::absorbed_part(const Group& cloud, const Vec3& place_m, double reach_m,
                                       const WayOf& way_of) const {
    double length_m = 0, part = 0;
    for (std::size_t i = cloud.first; i < cloud.first + cloud.count; ++i) {
        const Parcel& parcel = parcels_[i];
        const Vec3 q = (place_m - parcel.centre_m) * parcel.per_m, way = way_of(parcel);
        const double squared = dot(q, q), along = dot(q, way), way_squared = dot(way, way);
        if (squared < kReach * kReach)
            part = std::max(part, std::min(1.0, kWholeWeight * parcel.weight) * fade(std::sqrt(squared)));
        const double under_root = along * along - way_squared * (squared - 1);
        if (under_root <= 0) continue;
        const double root = std::sqrt(under_root), end = reach_m * way_squared;
        length_m +=
            parcel.weight * (std::clamp(root - along, 0.0, end) - std::clamp(-root - along, 0.0, end)) / way_squared;
    }
    return part * std::min(length_m / cloud.light_distance_m, 1.0);
}

template <class WayOf>
double ParcelAbsorption::left_at(const Vec3& place_m, double reach_m, const WayOf& way_of) const {
    if (clouds_.empty()) return 1;
    const Vec2 cell = (Vec2(place_m) - low_m_) * per_m_;
    if (!(cell.x >= 0 && cell.y >= 0 && cell.x <= cells_[0] && cell.y <= cells_[1])) return 1;
    const int x = std::min(int(cell.x), cells_[0] - 1), y = std::min(int(cell.y), cells_[1] - 1);
    const std::size_t at = std::size_t(y) * std::size_t(cells_[0]) + std::size_t(x);
    double left = 1;
    for (std::uint32_t i = first_[at]; i < first_[at + 1]; ++i) {
        const Group& cloud = clouds_[listed_[i]];
        if (place_m.x < cloud.low_m.x || place_m.y < cloud.low_m.y || place_m.z < cloud.low_m.z ||
            place_m.x > cloud.high_m.x || place_m.y > cloud.high_m.y || place_m.z > cloud.high_m.z)
            continue;
        left *= 1 - cloud.strength * absorbed_part(cloud, place_m, reach_m, way_of);
        if (left <= 0) return 0;
    }
    return left;
}

double ParcelAbsorption::sunlight_at(const Vec3& place_m) const {
    return left_at(place_m, std::numeric_limits<double>::infinity(), [](const Parcel& parcel) { return parcel.way; });
}

double ParcelAbsorption::lightning_at(const Vec3& place_m, const Vec3& flash_m) const {
    const Vec3 way = flash_m - place_m;
    const double reach_m = length(way);
    if (!(reach_m > 0)) return 1;
    return left_at(place_m, reach_m, [&](const Parcel& parcel) { return (1 / reach_m) * way * parcel.per_m; });
}

std::vector<double> ParcelAbsorption::content() const {
    std::vector<double> numbers{to_sun_.x, to_sun_.y, to_sun_.z};
    for (const Group& cloud : clouds_) {
        numbers.insert(numbers.end(), {double(cloud.count), cloud.light_distance_m, cloud.strength});
        for (std::size_t i = cloud.first; i < cloud.first + cloud.count; ++i) {
            const Parcel& p = parcels_[i];
            numbers.insert(numbers.end(), {p.centre_m.x, p.centre_m.y, p.centre_m.z, p.per_m.x, p.per_m.y,
                                           p.per_m.z, p.weight});
        }
    }
    return numbers;
}

}  // namespace nephos
