// SPDX-License-Identifier: Apache-2.0
#include "render/rain/splashes.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/math.h"
#include "core/random.h"
#include "core/vec.h"
#include "render/frame/frame_data.h"
#include "render/rain/rain_shafts.h"

namespace nephos {
namespace {

constexpr double kGravity = 9.81;
constexpr int kLevels = 3;
constexpr std::uint32_t kFirstGroup = 16;  // of random numbers: those before it are of drops and flakes
constexpr double kFinestSlot_m = 0.25;
constexpr double kHighestEye_m = 40;
constexpr int kDroplets = 7;          // thrown by a crown
constexpr double kDropletSize = 2.5;  // drawn over true width
constexpr double kCrownLife_s = 0.06, kCrownRadius_m = 0.012, kCrownHeight_m = 0.014;
constexpr double kCrownOpacity = 0.35;  // of a sheet of water, at the beginning
constexpr double kMostStoodFor = 6;     // whose droplets a splash has at most

// The rain of a curtain at the ground: what falls of throwing drops, and where.
struct GroundRain {
    const RainCurtain* curtain = nullptr;
    double flux = 0;  // per m^2 and s in the middle
};

// The strongest rain at a place, as a flux.
double flux_at(const std::vector<GroundRain>& rain, const PrecipitationOptions& p, const Vec3& place) {
    double most = 0;
    for (const GroundRain& each : rain) {
        const RainCurtain& curtain = *each.curtain;
        const CloudBases::Column cloud = cloud_above(curtain, place);
        if (place.z > cloud.base_m) continue;
        const double height = (place.z - curtain.ground_m) / (cloud.base_m - curtain.ground_m);
        const double falls = cloud.water * left_of_rain(height, p.evaporation) *
                             rain_fraction(ellipse_at(curtain, place.z), place.x, place.y, p.edge);
        most = std::max(most, falls * each.flux);
    }
    return most;
}

// How much of the splashes at a distance a level has; the sum over the levels is 1, and falls to 0 at the reach.
double share_of_level(int level, double distance_m) {
    const auto outside = [](int of, double at_m) {
        const double reach_m = kSplashReach_m * std::exp2(of + 1 - kLevels);
        return smoothstep(0.75 * reach_m, reach_m, at_m);
    };
    return (level == 0 ? 1.0 : outside(level - 1, distance_m)) * (1 - outside(level, distance_m));
}

// The ground at a place: the weather's relief, or level.
GroundSurface ground_at(const RainFrame& frame, const Weather& weather, double x_m, double y_m) {
    return weather.relief ? weather.relief(x_m, y_m) : GroundSurface{frame.options.ground.height_m};
}

// Adds the splashes of one level, row by row.
void add_level(const RainFrame& frame, const Weather& weather, const std::vector<GroundRain>& rain, int level,
               std::vector<Splash>& out) {
    const PrecipitationOptions& p = frame.options.precipitation;
    const Vec3& eye = frame.camera.position_m;
    const double slot_m = kFinestSlot_m * std::exp2(level),
                 reach_m = kSplashReach_m * std::exp2(level + 1 - kLevels);
    const double chance_per_flux = slot_m * slot_m * kSplashPeriod_s * p.splashes;
    const auto first = [&](double at) { return std::int64_t(std::floor((at - reach_m) / slot_m)); };
    const auto last = [&](double at) { return std::int64_t(std::floor((at + reach_m) / slot_m)); };
    for (std::int64_t row = first(eye.y); row <= last(eye.y); ++row) {
        for (std::int64_t column = first(eye.x); column <= last(eye.x); ++column) {
            const double x_m = (double(column) + 0.5) * slot_m, y_m = (double(row) + 0.5) * slot_m;
            const Vec3 way = Vec3{x_m, y_m, ground_at(frame, weather, x_m, y_m).z_m} - eye;
            const double share = share_of_level(level, std::sqrt(way.x * way.x + way.y * way.y));
            if (share <= 0 || dot(way, frame.camera.forward) < -slot_m) continue;
            // When the slot's periods begin is its own; what happens in one is drawn anew each time.
            const auto slot = std::uint32_t(column & 0xffff) | std::uint32_t(row & 0xffff) << 16;
            const auto words = [&](std::int64_t of, std::uint32_t sub) {
                return philox(weather.seed,
                              item_counter(Domain::particles, kFirstGroup + std::uint32_t(level), slot,
                                           std::uint32_t(of), sub));
            };
            const double begun = frame.time_s / kSplashPeriod_s + unit_interval(words(0, 2)[0]);
            const double period = std::floor(begun);
            const PhiloxWords drawn = words(std::int64_t(period), 0), more = words(std::int64_t(period), 1);
            Vec3 place{(double(column) + unit_interval(drawn[0])) * slot_m,
                       (double(row) + unit_interval(drawn[1])) * slot_m, 0};
            const GroundSurface ground = ground_at(frame, weather, place.x, place.y);
            if (std::hypot(ground.slope_x, ground.slope_y) > kSteepestSplash) continue;
            place.z = ground.z_m;
            const double chance = chance_per_flux * flux_at(rain, p, place);
            if (unit_interval(drawn[2]) >= chance) continue;
            const double weight = share * std::max(chance, 1.0);
            out.push_back({place.x, place.y, ground, (begun - period) * kSplashPeriod_s, weight,
                           unit_interval(drawn[3]), unit_interval(more[0])});
        }
    }
}

struct SplashView {
    const RainFrame& frame;
    double pixels_per_unit = 1;
};

// Adds a streak between two places of the world, at the opening and the closing of the shutter.
void add_streak(const SplashView& view, const Vec3& from_m, const Vec3& to_m, double width_m,
                double shadow_m2, double most_opaque, const Rgb& light, std::vector<Streak>& out) {
    const RainFrame& frame = view.frame;
    const Camera& camera = frame.options.camera;
    const Vec3 way = 0.5 * (from_m + to_m) - frame.camera.position_m;
    const double distance = length(way);
    if (dot(way, frame.camera.forward) < shader::kNearestDrop_m) return;
    PixelPosition from = project(frame.opening, camera, from_m), to = project(frame.closing, camera, to_m);
    if (!from.in_front || !to.in_front) return;
    const double scale = view.pixels_per_unit / distance, width = std::max(1.0, width_m * scale);
    const double span = std::max(1.0, std::hypot(to.x - from.x, to.y - from.y));
    if (std::max(from.x, to.x) < -width || std::min(from.x, to.x) > camera.width + width ||
        std::max(from.y, to.y) < -width || std::min(from.y, to.y) > camera.height + width)
        return;
    const double near = std::clamp(
        (distance - shader::kNearestDrop_m) / (shader::kNearDropFade_m - shader::kNearestDrop_m), 0.0, 1.0);
    const double opacity = near * std::min(most_opaque, shadow_m2 * scale * scale / (width * span));
    if (opacity < shader::kLeastDropOpaque) return;
    out.push_back({float(from.x), float(from.y), float(to.x), float(to.y), float(width), float(opacity),
                   float(distance), float(light[0]), float(light[1]), float(light[2])});
}

// The sheet of water around the place of the impact: its rim rises and widens, and it falls back.
void add_crown(const SplashView& view, const Splash& splash, const Vec3& place, const Rgb& light,
               std::vector<Streak>& out) {
    if (splash.age_s >= kCrownLife_s) return;
    const double part = splash.age_s / kCrownLife_s, size = 0.7 + 0.6 * splash.strength;
    const double radius = size * kCrownRadius_m * std::sqrt(part),
                 height = 4 * size * kCrownHeight_m * part * (1 - part);
    const double opacity = kCrownOpacity * (1 - part) * std::min(1.0, splash.weight);
    add_streak(view, place, place + Vec3{0, 0, height}, 2 * radius, opacity * 2 * radius * height, opacity,
               light, out);
}

void add_droplets(const SplashView& view, const Splash& splash, const Vec3& place, const Rgb& light,
                  std::vector<Streak>& out) {
    const PrecipitationOptions& p = view.frame.options.precipitation;
    for (int n = 0; n < kDroplets; ++n) {
        // Two draws make all of a crown's: they need not be independent.
        const double other = splash.strength * (n + 3) + 0.618 * n, draw = other - std::floor(other);
        const double azimuth = 2 * std::numbers::pi * (splash.turn + (n + 0.5 * draw) / kDroplets);
        const double slope = (50 + 25 * draw) * std::numbers::pi / 180,
                     speed = 0.7 + 0.6 * splash.strength * (0.4 + 0.6 * draw);
        const auto at = [&](double age_s) {
            const double t = std::max(age_s, 0.0), along = speed * std::cos(slope) * t;
            const double x = along * std::cos(azimuth), y = along * std::sin(azimuth);
            const double surface = splash.ground.slope_x * x + splash.ground.slope_y * y;
            return place + Vec3{x, y, std::max(surface, speed * std::sin(slope) * t - 0.5 * kGravity * t * t)};
        };
        const double lands_s = 2 * speed * std::sin(slope) / kGravity;
        if (splash.age_s >= lands_s) continue;
        const double diameter_m = kDropletSize * (0.5e-3 + 0.5e-3 * (1 - draw));
        const double shadow_m2 = p.visibility * std::min(splash.weight, kMostStoodFor) * 0.25 *
                                 std::numbers::pi * diameter_m * diameter_m;
        const double half_s = 0.5 * p.exposure_s;
        add_streak(view, at(splash.age_s - half_s), at(splash.age_s + half_s), diameter_m, shadow_m2,
                   shader::kMostDropOpaque * std::min(1.0, splash.weight), light, out);
    }
}

}  // namespace

double throwing_drops(const SizeLaw& law) {
    constexpr int kSteps = 60;
    if (law.kind != PrecipitationKind::rain || law.n0 <= 0) return 0;
    double flux = 0;
    for (int n = 0; n < kSteps; ++n) {
        const double step = (kLargest_mm - kThrowing_mm) / kSteps, d_mm = kThrowing_mm + (n + 0.5) * step;
        flux += step * law.n0 * std::exp(-law.slope * d_mm) * fall_speed_m_per_s(law.kind, d_mm);
    }
    return flux;
}

std::vector<Splash> splashes_at(const RainFrame& frame, const Weather& weather) {
    const PrecipitationOptions& p = frame.options.precipitation;
    const Vec3& eye = frame.camera.position_m;
    if (p.splashes <= 0 || p.kind != PrecipitationKind::rain || (frame.options.terrain.any() && !weather.relief)) return {};
    const double above_m = eye.z - ground_at(frame, weather, eye.x, eye.y).z_m;
    if (above_m <= 0 || above_m > kHighestEye_m) return {};
    std::vector<GroundRain> rain;
    for (const RainCurtain& curtain : weather.curtains) {
        if (!falls(curtain)) continue;
        rain.push_back(
            {&curtain, throwing_drops(size_law(p.kind, p.intensity_scale * curtain.rate_mm_per_h))});
    }
    std::vector<Splash> splashes;
    if (rain.empty()) return splashes;
    for (int level = 0; level < kLevels; ++level) add_level(frame, weather, rain, level, splashes);
    return splashes;
}

std::vector<Streak> streaks_of_splashes(const RainFrame& frame, const std::vector<Splash>& splashes) {
    const SplashView view{frame, pixels_per_unit(frame.options.camera, frame.camera)};
    std::vector<Streak> streaks;
    for (const Splash& splash : splashes) {
        const Vec3 place{splash.x_m, splash.y_m, splash.ground.z_m}, way = place - frame.camera.position_m;
        const Rgb light = particle_radiance(frame.light, (1 / length(way)) * way, place, 0);
        add_crown(view, splash, place, light, streaks);
        add_droplets(view, splash, place, light, streaks);
    }
    return streaks;
}

}  // namespace nephos
