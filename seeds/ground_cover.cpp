// SPDX-License-Identifier: Apache-2.0
#include "seeds/ground_cover.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "seeds/checks.h"

namespace nephos {
namespace {

constexpr double kPerHour = 1.0 / 3600.0;

// Returns a film after a duration of `input_mm_per_h`.
double wetted(double water_mm, double input_mm_per_h, double duration_s, const GroundCoverOptions& options) {
    const double input = input_mm_per_h * kPerHour;
    const double rate = input / options.capacity_mm + 1 / options.drying_s;
    if (rate == 0) return water_mm;
    const double balance = input / rate;
    return balance + (water_mm - balance) * std::exp(-rate * duration_s);
}

// Returns the mean of the rain on the outermost texels.
double mean_at_edge(const GroundCoverMap& map) {
    const auto columns = std::size_t(map.columns), rows = std::size_t(map.rows);
    double sum = 0;
    for (std::size_t row = 0; row < rows; ++row) {
        const bool whole = row == 0 || row == rows - 1;
        for (std::size_t column = 0; column < columns; column += whole ? 1 : columns - 1)
            sum += map.rain_mm_per_h[row * columns + column];
    }
    return sum / double(2 * (columns + rows) - 4);
}

void check_times(const GroundCoverOptions& options) {
    if (!(options.drying_s > 0)) {
        usage_error("ground cover: drying time (s) is " + text_of(options.drying_s) +
                    ", expected a number above 0 or inf");
    }
    if (!(options.fall_speed_m_per_s > 0)) {
        usage_error("ground cover: fall speed (m/s) is " + text_of(options.fall_speed_m_per_s) +
                    ", expected a number above 0 or inf");
    }
}

}  // namespace

void check(const GroundCoverOptions& options) {
    const std::string where = "ground cover";
    require_in(where + ": initial water (mm)", options.initial_water_mm, 0, 100);
    require_in(where + ": initial snow (mm)", options.initial_snow_mm, 0, 1000);
    require_in(where + ": capacity (mm)", options.capacity_mm, 0.01, 100);
    require_in(where + ": melting (mm/h)", options.melting_mm_per_h, 0, 100);
    require_in(where + ": edge", options.edge, 0, 1);
    require_in(where + ": texels", options.texels, 2, 1024);
    require_in(where + ": margin", options.margin, 0, 10);
    check_times(options);
}

GroundFilm advanced(const GroundFilm& film, double rain_mm_per_h, double snow_mm_per_h, double duration_s,
                    const GroundCoverOptions& options) {
    const double melting = options.melting_mm_per_h, growth = snow_mm_per_h - melting;
    // While snow lies it melts at its full rate; once it is gone, what falls melts as it falls.
    double snowy_s = duration_s;
    if (growth < 0) snowy_s = std::min(duration_s, film.snow_mm / (-growth * kPerHour));
    GroundFilm after = film;
    after.water_mm = wetted(film.water_mm, rain_mm_per_h + melting, snowy_s, options);
    after.snow_mm = std::max(0.0, film.snow_mm + growth * kPerHour * snowy_s);
    if (snowy_s == duration_s) return after;
    return {wetted(after.water_mm, rain_mm_per_h + snow_mm_per_h, duration_s - snowy_s, options), 0};
}

GroundCoverMap mix(const GroundCoverMap& from, const GroundCoverMap& to, double fraction) {
    GroundCoverMap map = from;
    const auto between = [&](std::vector<float>& values, const std::vector<float>& later) {
        const auto weight = float(fraction);
        for (std::size_t i = 0; i < values.size(); ++i) values[i] += weight * (later[i] - values[i]);
    };
    between(map.water_mm, to.water_mm);
    between(map.snow_mm, to.snow_mm);
    between(map.rain_mm_per_h, to.rain_mm_per_h);
    map.outside.water_mm += fraction * (to.outside.water_mm - from.outside.water_mm);
    map.outside.snow_mm += fraction * (to.outside.snow_mm - from.outside.snow_mm);
    map.outside_rain_mm_per_h += fraction * (to.outside_rain_mm_per_h - from.outside_rain_mm_per_h);
    return map;
}

Vec2 drift_m(const Wind& wind, double time_s, double base_m, double ground_m, double fall_speed_m_per_s) {
    constexpr int kSlices = 32;
    const double slice_m = (base_m - ground_m) / kSlices;
    if (!(slice_m > 0) || std::isinf(fall_speed_m_per_s)) return {};
    Vec2 drift{};
    for (int n = 0; n < kSlices; ++n) {
        const Velocity velocity = wind_at(wind, ground_m + (n + 0.5) * slice_m, time_s);
        drift.x += velocity.east_m_per_s;
        drift.y += velocity.north_m_per_s;
    }
    const double seconds = slice_m / fall_speed_m_per_s;
    return {drift.x * seconds, drift.y * seconds};
}

Vec2 lag_m(const Wind& wind, double time_s, double base_m, double ground_m, double fall_speed_m_per_s) {
    if (!(base_m > ground_m) || std::isinf(fall_speed_m_per_s)) return {};
    const Velocity cloud = wind_at(wind, base_m, time_s);
    const double seconds = (base_m - ground_m) / fall_speed_m_per_s;
    return drift_m(wind, time_s, base_m, ground_m, fall_speed_m_per_s) -
           Vec2(cloud.east_m_per_s * seconds, cloud.north_m_per_s * seconds);
}

GroundCover::GroundCover(const GroundCoverOptions& options, PrecipitationKind kind,
                         const WorldRectangle& world)
    : options_(options), kind_(kind) {
    check(options);
    const double wide_m = world.max_x_m - world.min_x_m, high_m = world.max_y_m - world.min_y_m;
    map_.x_m = world.min_x_m - options.margin * wide_m;
    map_.y_m = world.min_y_m - options.margin * high_m;
    map_.columns = map_.rows = options.texels;
    map_.texel_x_m = wide_m * (1 + 2 * options.margin) / options.texels;
    map_.texel_y_m = high_m * (1 + 2 * options.margin) / options.texels;
    const auto texels = std::size_t(options.texels) * std::size_t(options.texels);
    map_.water_mm.assign(texels, float(options.initial_water_mm));
    map_.snow_mm.assign(texels, float(options.initial_snow_mm));
    map_.rain_mm_per_h.assign(texels, 0.0f);
    map_.outside = {options.initial_water_mm, options.initial_snow_mm};
}

void GroundCover::expose(std::span<const FallingRain> falling) {
    std::ranges::fill(map_.rain_mm_per_h, 0.0f);
    for (const FallingRain& rain : falling)
        for (const RainArea& area : rain.areas) rain_on(area, rain.drift);
    map_.outside_rain_mm_per_h = mean_at_edge(map_);
}

// Adds the rain of an area to the texels in the rectangle around its ellipse.
void GroundCover::rain_on(const RainArea& area, const Vec2& drift) {
    const double a = area.semi_a_m, b = area.semi_b_m;
    const double reach_x = std::sqrt(a * a * area.axis_x * area.axis_x + b * b * area.axis_y * area.axis_y),
                 reach_y = std::sqrt(a * a * area.axis_y * area.axis_y + b * b * area.axis_x * area.axis_x);
    const auto texel = [](double from_corner_m, double size_m, int count) {
        return int(std::clamp(std::floor(from_corner_m / size_m), 0.0, double(count)));
    };
    const double x = area.x_m + drift.x - map_.x_m, y = area.y_m + drift.y - map_.y_m;
    const int first_column = texel(x - reach_x, map_.texel_x_m, map_.columns),
              end_column = texel(x + reach_x + map_.texel_x_m, map_.texel_x_m, map_.columns),
              first_row = texel(y - reach_y, map_.texel_y_m, map_.rows),
              end_row = texel(y + reach_y + map_.texel_y_m, map_.texel_y_m, map_.rows);
    for (int row = first_row; row < end_row; ++row) {
        const double from_y = map_.y_m + (row + 0.5) * map_.texel_y_m - drift.y;
        for (int column = first_column; column < end_column; ++column) {
            const double from_x = map_.x_m + (column + 0.5) * map_.texel_x_m - drift.x;
            float& rain =
                map_.rain_mm_per_h[std::size_t(row) * std::size_t(map_.columns) + std::size_t(column)];
            rain = std::max(rain, float(rain_at(area, from_x, from_y, options_.edge)));
        }
    }
}

void GroundCover::advance(double duration_s) {
    const bool snows = kind_ == PrecipitationKind::snow;
    const auto after = [&](const GroundFilm& film, double falls) {
        return advanced(film, snows ? 0 : falls, snows ? falls : 0, duration_s, options_);
    };
    const double dried = wetted(1, 0, duration_s, options_);
    for (std::size_t i = 0; i < map_.water_mm.size(); ++i) {
        float &water = map_.water_mm[i], &snow = map_.snow_mm[i];
        const double falls = map_.rain_mm_per_h[i];
        if (falls == 0 && snow == 0) {
            water = float(water * dried);
            continue;
        }
        const GroundFilm film = after({water, snow}, falls);
        water = float(film.water_mm);
        snow = float(film.snow_mm);
    }
    map_.outside = after(map_.outside, map_.outside_rain_mm_per_h);
}

void GroundCover::restore(GroundCoverMap map) {
    const std::size_t texels = map_.water_mm.size();
    if (map.columns != map_.columns || map.rows != map_.rows || map.water_mm.size() != texels ||
        map.snow_mm.size() != texels || map.rain_mm_per_h.size() != texels)
        throw Error(ErrorCode::io, "the saved ground has another size");
    map_ = std::move(map);
}

}  // namespace nephos
