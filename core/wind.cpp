// SPDX-License-Identifier: Apache-2.0
#include "core/wind.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/math.h"
#include "core/text.h"

namespace nephos {
namespace {

Velocity mix(const Velocity& a, const Velocity& b, double fraction) {
    return {a.east_m_per_s + (b.east_m_per_s - a.east_m_per_s) * fraction,
            a.north_m_per_s + (b.north_m_per_s - a.north_m_per_s) * fraction};
}

Velocity at_height(const std::vector<WindLevel>& levels, double height_m) {
    if (levels.empty()) return {};
    const auto above =
        std::ranges::find_if(levels, [&](const WindLevel& l) { return l.height_m >= height_m; });
    if (above == levels.begin()) return levels.front().velocity;
    if (above == levels.end()) return levels.back().velocity;
    const WindLevel& below = *(above - 1);
    return mix(below.velocity, above->velocity,
               (height_m - below.height_m) / (above->height_m - below.height_m));
}

std::int64_t to_fixed(double cells) {
    constexpr double kMaxCells = 0x1p30;
    if (!(std::abs(cells) <= kMaxCells)) {
        throw Error(ErrorCode::usage, "wind moves the air by " + number_text(cells, 6) +
                                          " cells in one step; at most 2^30 cells are possible");
    }
    const double units = cells * 0x1p32;
    return std::abs(units) < 0.5 ? 0 : std::int64_t(std::ceil(units));
}

}  // namespace

Velocity velocity_from(double from_deg, double speed_m_per_s) {
    const Rotation from = sin_cos_deg(from_deg);
    return {0.0 - speed_m_per_s * from.sin, 0.0 - speed_m_per_s * from.cos};
}

Velocity wind_at(const Wind& wind, double height_m, double time_s) {
    const auto& keys = wind.keyframes;
    if (keys.empty()) return {};
    const auto after = std::ranges::find_if(keys, [&](const WindKeyframe& k) { return k.time_s >= time_s; });
    if (after == keys.begin()) return at_height(keys.front().levels, height_m);
    if (after == keys.end()) return at_height(keys.back().levels, height_m);
    const WindKeyframe& before = *(after - 1);
    return mix(at_height(before.levels, height_m), at_height(after->levels, height_m),
               (time_s - before.time_s) / (after->time_s - before.time_s));
}

Vec3 wind_at(const Wind& wind, const Vec3& place_m, double time_s) {
    const Velocity profile = wind_at(wind, place_m.z, time_s);
    const Vec3 horizontal(profile.east_m_per_s, profile.north_m_per_s, 0);
    return wind.fields.empty() ? horizontal : horizontal + velocity_of(wind.fields, place_m, time_s);
}

Vec3 mean_wind(const Wind& wind, const Vec3& from_m, double time_s, double duration_s) {
    const Vec3 a = wind_at(wind, from_m, time_s);
    if (wind.fields.empty()) return a;  // horizontal: it stays at its height
    const Vec3 b = wind_at(wind, from_m + 0.5 * duration_s * a, time_s);
    const Vec3 c = wind_at(wind, from_m + 0.5 * duration_s * b, time_s);
    const Vec3 d = wind_at(wind, from_m + duration_s * c, time_s);
    if (a == b && b == c && c == d) return a;
    return (a + 2.0 * b + 2.0 * c + d) / 6.0;
}

Displacement displacement_of_step(const Velocity& velocity, double time_step_s, double cell_size_m) {
    return {to_fixed(velocity.east_m_per_s * time_step_s / cell_size_m),
            to_fixed(velocity.north_m_per_s * time_step_s / cell_size_m)};
}

}  // namespace nephos
