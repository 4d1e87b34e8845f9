// SPDX-License-Identifier: Apache-2.0
#include "seeds/rain_area.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "core/math.h"
#include "seeds/checks.h"

namespace nephos {
namespace {

constexpr double kMaxIntensity = 500;  // mm/h; the heaviest minutes on record are above, no hour is

double edge_falloff(double radius, double edge) {
    if (radius >= 1) return 0;
    if (radius <= 1 - edge) return 1;
    return smooth_blend((1 - radius) / edge);
}

}  // namespace

double ellipse_value(const RainArea& area, double x_m, double y_m) {
    const double dx = x_m - area.x_m, dy = y_m - area.y_m;
    const double along = (dx * area.axis_x + dy * area.axis_y) / area.semi_a_m;
    const double across = (dy * area.axis_x - dx * area.axis_y) / area.semi_b_m;
    return along * along + across * across;
}

double rain_at(const RainArea& area, double x_m, double y_m, double edge) {
    return area.intensity_mm_per_h * edge_falloff(std::sqrt(ellipse_value(area, x_m, y_m)), edge);
}

double rain_at(std::span<const RainArea> areas, double x_m, double y_m, double edge) {
    double strongest = 0;
    for (const RainArea& area : areas) strongest = std::max(strongest, rain_at(area, x_m, y_m, edge));
    return strongest;
}

void check(const PlacedRain& rain) {
    const std::string where = "rain area";
    require_in(where + ": centre x (m)", rain.x_m, -1e8, 1e8);
    require_in(where + ": centre y (m)", rain.y_m, -1e8, 1e8);
    require_positive(where + ": semi-axis a (m)", rain.semi_a_m);
    require_positive(where + ": semi-axis b (m)", rain.semi_b_m);
    require_in(where + ": yaw (degrees)", rain.yaw_deg, -360, 360);
    require_in(where + ": intensity (mm/h)", rain.intensity_mm_per_h, 0, kMaxIntensity);
    if (!std::isfinite(rain.start_s) || !(rain.end_s > rain.start_s)) {
        usage_error(where + ": it ends at " + text_of(rain.end_s) + " s, expected later than its start at " +
                    text_of(rain.start_s) + " s");
    }
    require_in(where + ": fade (s)", rain.fade_s, 0, 1e9);
}

void check(const AttachedRain& rain) {
    const std::string where = "rain attached to clouds";
    require_range(where + ": state", rain.state.min, rain.state.max, 0, 1);
    require_positive(where + ": size scale", rain.size_scale);
    require_in(where + ": intensity (mm/h)", rain.intensity_mm_per_h, 0, kMaxIntensity);
}

void check(const HumidColumn& column) {
    const std::string where = "humid column";
    if (!std::isfinite(column.bottom_m) || !std::isfinite(column.top_m) ||
        !(column.bottom_m < column.top_m)) {
        usage_error(where + ": bottom " + text_of(column.bottom_m) + " m must lie below top " +
                    text_of(column.top_m) + " m");
    }
    require_in(where + ": strength", column.strength, 0, 1);
    require_positive(where + ": full intensity (mm/h)", column.full_intensity_mm_per_h);
    require_probabilities(where, column.centre);
    require_probabilities(where, column.rim);
}

std::vector<RainArea> placed_areas(std::span<const PlacedRain> rains, double time_s,
                                   const Displacement& carried, std::uint32_t layer) {
    std::vector<RainArea> areas;
    for (std::size_t i = 0; i < rains.size(); ++i) {
        const PlacedRain& rain = rains[i];
        check(rain);
        double weight = time_s >= rain.start_s && time_s < rain.end_s ? 1 : 0;
        if (rain.fade_s > 0) {
            weight = std::min(
                {weight, (time_s - rain.start_s) / rain.fade_s, (rain.end_s - time_s) / rain.fade_s});
        }
        if (weight <= 0) continue;
        const Rotation turn = rotation_of_degrees(rain.yaw_deg);
        const double moved_x = rain.carried ? double(carried.x) * 0x1p-32 : 0;
        const double moved_y = rain.carried ? double(carried.y) * 0x1p-32 : 0;
        areas.push_back({rain_id(RainSource::placed, layer, 0, std::uint32_t(i)), rain.x_m + moved_x,
                         rain.y_m + moved_y, rain.semi_a_m, rain.semi_b_m, turn.cos, turn.sin,
                         rain.intensity_mm_per_h * weight});
    }
    return areas;
}

std::vector<RainArea> attached_areas(std::span<const AttachedRain> rains, const SkySimulation& sky) {
    if (rains.size() > kMaxRainRules) {
        usage_error(std::to_string(rains.size()) + " rules attach rain to clouds, at most " +
                    std::to_string(kMaxRainRules) + " are possible");
    }
    std::vector<RainArea> areas;
    for (std::size_t r = 0; r < rains.size(); ++r) {
        const AttachedRain& rain = rains[r];
        check(rain);
        for (const SkyCloud& cloud : sky.clouds()) {
            const double state = sky.options().skies[cloud.sky].state;
            if (state < rain.state.min || state > rain.state.max) continue;
            const CloudForm form = sky.forms(cloud).main();
            if (rain.model && sky.shapes()[form.shape].model != *rain.model) continue;
            if (rain.genus && sky.model(form).genus != rain.genus) continue;
            const double intensity = rain.intensity_mm_per_h * form.phase;
            if (intensity <= 0) continue;
            const Cloud& shape = sky.shapes()[form.shape].cloud;
            const Vec3 p = sky.position_m(cloud);
            areas.push_back(
                {rain_id(RainSource::attached, sky.options().layer, std::uint32_t(r), cloud.serial),
                 p.x + shape.centre_m.x, p.y + shape.centre_m.y,
                 (shape.high_m.x - shape.low_m.x) / 2 * rain.size_scale,
                 (shape.high_m.y - shape.low_m.y) / 2 * rain.size_scale, 1, 0, intensity});
        }
    }
    return areas;
}

namespace {

// Interpolates one area between two times; the axis rotates by the smaller angle (an axis has no direction).
RainArea between(const RainArea& a, const RainArea& b, double fraction) {
    const auto lerp = [&](double from, double to) { return from + (to - from) * fraction; };
    const double dx = b.x_m - a.x_m, dy = b.y_m - a.y_m, reach = a.semi_a_m + b.semi_a_m;
    if (dx * dx + dy * dy > reach * reach) return a;
    RainArea area = a;
    area.x_m = lerp(a.x_m, b.x_m);
    area.y_m = lerp(a.y_m, b.y_m);
    area.semi_a_m = lerp(a.semi_a_m, b.semi_a_m);
    area.semi_b_m = lerp(a.semi_b_m, b.semi_b_m);
    area.intensity_mm_per_h = lerp(a.intensity_mm_per_h, b.intensity_mm_per_h);
    const double sign = a.axis_x * b.axis_x + a.axis_y * b.axis_y < 0 ? -1 : 1;
    const double x = lerp(a.axis_x, sign * b.axis_x), y = lerp(a.axis_y, sign * b.axis_y);
    const double length =
        std::sqrt(x * x + y * y);  // at least sqrt(1/2): the axes differ by at most 90 degrees
    area.axis_x = x / length;
    area.axis_y = y / length;
    return area;
}

}  // namespace

std::vector<RainArea> mix(std::span<const RainArea> from, std::span<const RainArea> to, double fraction) {
    std::vector<RainArea> areas;
    const auto add = [&](RainArea area, double weight) {
        area.intensity_mm_per_h *= weight;
        if (area.intensity_mm_per_h > 0) areas.push_back(area);
    };
    std::map<std::uint64_t, const RainArea*> later;
    for (const RainArea& b : to) later.emplace(b.id, &b);
    for (const RainArea& a : from) {
        const auto b = later.find(a.id);
        if (b == later.end()) {
            add(a, 1 - fraction);
            continue;
        }
        add(between(a, *b->second, fraction), 1);
        later.erase(b);
    }
    for (const RainArea& b : to) {
        if (later.contains(b.id)) add(b, fraction);
    }
    return areas;
}

void append_columns(std::vector<ActiveEllipsoid>& out, std::span<const RainArea> areas,
                    const HumidColumn& column) {
    check(column);
    for (const RainArea& area : areas) {
        const double weight =
            column.strength * std::min(1.0, area.intensity_mm_per_h / column.full_intensity_mm_per_h);
        if (weight <= 0) continue;
        ActiveEllipsoid& active = out.emplace_back();
        active.weight = weight;
        active.ellipsoid.centre_m = {area.x_m, area.y_m, (column.bottom_m + column.top_m) / 2};
        active.ellipsoid.semi_axes_m = {area.semi_a_m, area.semi_b_m, (column.top_m - column.bottom_m) / 2};
        active.ellipsoid.yaw_deg = degrees_of_vector(area.axis_x, area.axis_y);
        active.ellipsoid.centre = column.centre;
        active.ellipsoid.rim = column.rim;
    }
}

}  // namespace nephos
