// SPDX-License-Identifier: Apache-2.0
#include "core/wind.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "core/error.h"
#include "core/math.h"
#include "core/text.h"

namespace nephos {
namespace {

// Exactly `a` at 0 and `b` at 1.
double mix(double a, double b, double fraction) { return fraction == 1 ? b : a + (b - a) * fraction; }

Velocity mix(const Velocity& a, const Velocity& b, double fraction) {
    return {mix(a.east_m_per_s, b.east_m_per_s, fraction), mix(a.north_m_per_s, b.north_m_per_s, fraction)};
}

double fraction_between(double from, double to, double at) { return (at - from) / (to - from); }

Velocity at_height(const std::vector<WindLevel>& levels, double height_m) {
    if (levels.empty()) return {};
    const auto above =
        std::ranges::find_if(levels, [&](const WindLevel& l) { return l.height_m >= height_m; });
    if (above == levels.begin()) return levels.front().velocity;
    if (above == levels.end()) return levels.back().velocity;
    const WindLevel& below = *(above - 1);
    return mix(below.velocity, above->velocity, fraction_between(below.height_m, above->height_m, height_m));
}

// The key frames around a time; the same one twice where it holds alone.
struct KeysAround {
    const WindKeyframe *before, *after;
};

KeysAround keys_around(const std::vector<WindKeyframe>& keys, double time_s) {
    const auto after = std::ranges::find_if(keys, [&](const WindKeyframe& k) { return k.time_s >= time_s; });
    if (after == keys.end()) return {&keys.back(), &keys.back()};
    const bool alone = after == keys.begin() || after->time_s == time_s;
    return {alone ? &*after : &*(after - 1), &*after};
}

Velocity at_level(const KeysAround& keys, double level_m, double time_s) {
    return mix(at_height(keys.before->levels, level_m), at_height(keys.after->levels, level_m),
               fraction_between(keys.before->time_s, keys.after->time_s, time_s));
}

// As profile_at() and between its levels at_height(), without making the profile.
Velocity between(const KeysAround& keys, double height_m, double time_s) {
    constexpr double kNone = std::numeric_limits<double>::infinity();
    double below_m = -kNone, above_m = kNone;
    for (const WindKeyframe* key : {keys.before, keys.after}) {
        for (const WindLevel& level : key->levels) {
            if (level.height_m < height_m)
                below_m = std::max(below_m, level.height_m);
            else
                above_m = std::min(above_m, level.height_m);
        }
    }
    if (above_m == kNone) return at_level(keys, below_m, time_s);
    const Velocity above = at_level(keys, above_m, time_s);
    if (below_m == -kNone) return above;
    return mix(at_level(keys, below_m, time_s), above, fraction_between(below_m, above_m, height_m));
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

std::vector<WindLevel> profile_at(const Wind& wind, double time_s) {
    if (wind.keyframes.empty()) return {};
    const KeysAround keys = keys_around(wind.keyframes, time_s);
    if (keys.before == keys.after) return keys.after->levels;
    std::set<double> heights;
    for (const WindKeyframe* key : {keys.before, keys.after})
        for (const WindLevel& level : key->levels) heights.insert(level.height_m);
    std::vector<WindLevel> levels;
    for (const double height : heights) levels.push_back({height, at_level(keys, height, time_s)});
    return levels;
}

Velocity wind_at(const Wind& wind, double height_m, double time_s) {
    if (wind.keyframes.empty()) return {};
    const KeysAround keys = keys_around(wind.keyframes, time_s);
    if (keys.before == keys.after) return at_height(keys.after->levels, height_m);
    return between(keys, height_m, time_s);
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
