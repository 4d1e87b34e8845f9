// SPDX-License-Identifier: Apache-2.0
#include "core/wind_field.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "core/error.h"
#include "core/math.h"
#include "core/text.h"

namespace nephos {
namespace {

constexpr double kPi = 3.14159265358979323846;

// The height within a field, 0..1; the rise Z = 4 s (1 - s) and its slope.
struct Rise {
    double z = 0, slope_per_m = 0;
};

Rise rise_at(const WindField& f, double height_m) {
    const double depth = f.top_m - f.bottom_m, s = (height_m - f.bottom_m) / depth;
    return {4 * s * (1 - s), 4 * (1 - 2 * s) / depth};
}

Vec3 vortex(const WindField& f, const Vec3& at) {
    const double x = at.x - f.x_m, y = at.y - f.y_m, square = x * x + y * y, core = f.radius_m * f.radius_m;
    const double turn = f.speed_m_per_s / f.radius_m * (square <= core ? 1 : core / square);
    return {-turn * y, turn * x, 0};
}

Vec3 shear_line(const WindField& f, const Vec3& at) {
    const Rotation along = sin_cos_deg(f.direction_deg);
    const double left = (at.y - f.y_m) * along.cos - (at.x - f.x_m) * along.sin;
    const double t = std::clamp(left / f.radius_m, -1.0, 1.0), speed = f.speed_m_per_s * (0.5 * t * (3 - t * t));
    return {speed * along.cos, speed * along.sin, 0};
}

Vec3 roll(const WindField& f, const Vec3& at) {
    const Rotation along = sin_cos_deg(f.direction_deg);
    const double left = (at.y - f.y_m) * along.cos - (at.x - f.x_m) * along.sin;
    const Rotation phase = sin_cos_deg(180 * (left / f.radius_m));
    const Rise rise = rise_at(f, at.z);
    const double across = -f.speed_m_per_s * (f.radius_m / kPi) * phase.sin * rise.slope_per_m;
    return {-across * along.sin, across * along.cos, f.speed_m_per_s * phase.cos * rise.z};
}

Vec3 thermal(const WindField& f, const Vec3& at) {
    const double x = at.x - f.x_m, y = at.y - f.y_m, q = (x * x + y * y) / (f.radius_m * f.radius_m);
    if (q >= 1) return {};
    const Rise rise = rise_at(f, at.z);
    const double out = -0.5 * f.speed_m_per_s * (1 - q) * (1 - q) * rise.slope_per_m;
    return {out * x, out * y, f.speed_m_per_s * (1 - q) * (1 - 3 * q) * rise.z};
}

double mix(double a, double b, double fraction) { return a + (b - a) * fraction; }

Vec3 sample(const SampleGrid& grid, const Vec3& at) {
    return {sample_at(grid, at, 0), sample_at(grid, at, 1), sample_at(grid, at, 2)};
}

Vec3 of_samples(const WindField& f, const Vec3& at, double time_s) {
    const auto& all = f.samples;
    if (all.empty()) return {};
    const auto after = std::ranges::find_if(all, [&](const VelocitySamples& s) { return s.time_s >= time_s; });
    if (after == all.begin()) return sample(*all.front().grid, at);
    if (after == all.end()) return sample(*all.back().grid, at);
    const VelocitySamples &before = *(after - 1), &next = *after;
    const double fraction = (time_s - before.time_s) / (next.time_s - before.time_s);
    const Vec3 a = sample(*before.grid, at), b = sample(*next.grid, at);
    return {mix(a.x, b.x, fraction), mix(a.y, b.y, fraction), mix(a.z, b.z, fraction)};
}

Vec3 velocity_of(const WindField& f, const Vec3& at, double time_s) {
    if (f.kind == WindFieldKind::grid) return of_samples(f, at, time_s);
    if (at.z < f.bottom_m || at.z > f.top_m) return {};
    switch (f.kind) {
        case WindFieldKind::thermal:
            return thermal(f, at);
        case WindFieldKind::roll:
            return roll(f, at);
        case WindFieldKind::shear_line:
            return shear_line(f, at);
        default:
            return vortex(f, at);
    }
}

bool is_profile(const SampleGrid& grid) {
    const std::size_t level = 3 * std::size_t(grid.points[0]) * std::size_t(grid.points[1]);
    for (std::size_t n = 0; n < grid.values.size(); ++n) {
        const float first = grid.values[n / level * level + n % 3];
        if (grid.values[n] != first || (n % 3 == 2 && first != 0)) return false;
    }
    return true;
}

}  // namespace

Vec3 velocity_of(std::span<const WindField> fields, const Vec3& place_m, double time_s) {
    Vec3 sum{};
    for (const WindField& f : fields) sum += velocity_of(f, place_m, time_s);
    return sum;
}

bool is_profile(std::span<const WindField> fields) {
    return std::ranges::all_of(fields, [](const WindField& f) {
        return f.kind == WindFieldKind::grid && !f.samples.empty() &&
               std::ranges::all_of(f.samples, [](const VelocitySamples& s) { return is_profile(*s.grid); });
    });
}

void check(std::span<const WindField> fields) {
    for (std::size_t n = 0; n < fields.size(); ++n) {
        const WindField& f = fields[n];
        const auto require = [&](bool good, const char* what, double value, const char* expected) {
            if (good) return;
            throw Error(ErrorCode::usage, "wind_field[" + std::to_string(n) + "]." + what + " = " +
                                              number_text(value, 6) + ": expected " + expected);
        };
        if (f.kind == WindFieldKind::grid) {
            require(f.interval_s > 0 && std::isfinite(f.interval_s), "interval_s", f.interval_s, "> 0 s");
            require(std::isfinite(f.start_s), "start_s", f.start_s, "a finite number");
            continue;
        }
        for (const double place : {f.x_m, f.y_m, f.direction_deg, f.speed_m_per_s})
            require(std::isfinite(place), "x_m, y_m, direction_deg, speed_m_per_s", place, "finite numbers");
        require(std::abs(f.speed_m_per_s) <= 1000, "speed_m_per_s", f.speed_m_per_s, "-1000 to 1000 m/s");
        require(f.radius_m > 0 && std::isfinite(f.radius_m), "radius_m", f.radius_m, "> 0 m");
        require(std::isfinite(f.bottom_m) && std::isfinite(f.top_m) && f.bottom_m < f.top_m, "bottom_m", f.bottom_m,
                "a height below top_m");
    }
}

}  // namespace nephos
