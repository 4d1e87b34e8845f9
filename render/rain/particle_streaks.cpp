// SPDX-License-Identifier: Apache-2.0
#include "render/rain/particle_streaks.h"

#include <algorithm>
#include <cmath>

#include <tbb/parallel_for.h>

#include "core/vec.h"
#include "render/frame/frame_data.h"
#include "render/rain/rain_shafts.h"

namespace nephos {
namespace {

constexpr std::size_t kChunk = 4096;
constexpr double kGrowth[2] = {shader::kRainGrowth, shader::kSnowGrowth};
constexpr double kMostSize[2] = {1e6, 1.5};  // s0; flakes are large enough as they are
constexpr double kOpacityAtEye = 0.5;

// Far from overflow, which std::hypot() takes its time to rule out.
double flat_length(double x, double y) { return std::sqrt(x * x + y * y); }

// The state shared by all particles of a pass.
struct Pass {
    const Particles& particles;
    const ParticlePass& pass;
    const StreakView& view;
    double pixels_per_unit = 1;
    double size = 1;      // s0
    double sunlight = 1;  // transmitted fraction of sunlight at the container
    bool snow = false;
    Vec2 ahead{1, 0};  // far: from the eye to the container, unit
};

// Simple, and the same everywhere: where a flake sways. Angles by index and time.
struct Sway {
    double x = 0, y = 0, vx = 0, vy = 0, cover = 1;
};

Sway sway_of(std::size_t i, double diameter_mm, double time_s) {
    const double start = double(i % shader::kSwayStarts) * shader::kSwayStart, turn = (i & 1) != 0 ? 1.0 : -1.0;
    const double per_s = turn * sway_per_s(i);  // a turn in 1.6 to 4 s
    const double radius_m =
        shader::kSwayLeast_m + shader::kSwayMore_m * double(i % shader::kSwayRadii) / (0.5 + diameter_mm);
    const double angle = start + per_s * time_s;
    const double c = std::cos(angle), s = std::sin(angle);
    return {radius_m * c, radius_m * s, -radius_m * per_s * s, radius_m * per_s * c,
            0.7 + 0.3 * std::cos(shader::kSwayHarmonic * angle + start)};
}

// Returns the ratio of real to drawn particles per m^3 at a point: of the strongest rain there, less the part
// that another pass draws.
double real_particles(const ParticlePass& pass, const PrecipitationOptions& p, const Vec3& place,
                      double d_mm) {
    const auto strongest = [&](const std::vector<CurtainTerm>& terms) {
        double most = 0;
        for (const CurtainTerm& term : terms) {
            const RainCurtain& c = *term.curtain;
            if (place.z < c.ground_m || place.z > c.base_m) continue;
            const CloudBases::Column cloud = cloud_above(c, place);
            if (place.z > cloud.base_m) continue;
            const double height = (place.z - c.ground_m) / (cloud.base_m - c.ground_m);
            const double fraction =
                cloud.water * rain_fraction(ellipse_at(c, place.z), place.x, place.y, p.edge);
            if (fraction <= 0) continue;
            most = std::max(most,
                            fraction * left_of_rain(height, p.evaporation) * real_per_drawn(term.law, d_mm));
        }
        return most;
    };
    const double here = strongest(pass.rain);
    return here > 0 ? std::max(0.0, here - strongest(pass.less)) : 0.0;
}

double linear(double low, double high, double x) { return std::clamp((x - low) / (high - low), 0.0, 1.0); }

// Returns the fade weight of a particle: by its reach, the container's top and bottom, the eye, the number.
double presence(const Pass& p, std::size_t i, double d, double z, double distance_m) {
    const double reach = double(p.particles.reach[i]);
    double fraction = p.pass.fraction * std::min(1.0, (reach - d) / (shader::kReachFade * reach));
    fraction *= linear(shader::kNearestDrop_m, shader::kNearDropFade_m, distance_m);
    if (!p.pass.far) fraction *= linear(1, 1 - shader::kVerticalFade, std::abs(z) / (0.5 * p.pass.boxes.height_m));
    if (p.pass.number < 1) {
        const double order = double(i) / double(p.particles.size());
        fraction *= linear(0, shader::kNumberFade, p.pass.number * (1 + shader::kNumberFade) - order);
    }
    return fraction;
}

struct Ends {
    PixelPosition from, to;
};

// Returns the projections of a particle at the opening and closing of the shutter, with the camera's motion.
Ends ends_of(const Pass& p, const Vec3& place, const Vec3& velocity) {
    const Vec3 half = (0.5 * p.view.options.precipitation.exposure_s) * velocity;
    const Camera& camera = p.view.options.camera;
    return {project(p.view.opening, camera, place - half), project(p.view.closing, camera, place + half)};
}

// Extends a streak about its middle to a least length in pixels; vertical where its ends coincide.
Ends at_least(const Ends& e, double length) {
    double dx = e.to.x - e.from.x, dy = e.to.y - e.from.y;
    const double span = flat_length(dx, dy);
    if (span >= length) return e;
    const double x = 0.5 * (e.from.x + e.to.x), y = 0.5 * (e.from.y + e.to.y);
    const double factor = span > 1e-3 ? 0.5 * length / span : 0;
    dx *= factor;
    dy = span > 1e-3 ? dy * factor : 0.5 * length;
    return {{x - dx, y - dy, true}, {x + dx, y + dy, true}};
}

bool beside_picture(const Ends& e, double margin, const Camera& camera) {
    return std::max(e.from.x, e.to.x) < -margin || std::min(e.from.x, e.to.x) > camera.width + margin ||
           std::max(e.from.y, e.to.y) < -margin || std::min(e.from.y, e.to.y) > camera.height + margin;
}

// Returns the velocity of a particle for motion blur; flakes have no streaks (S).
Vec3 velocity_of(const Pass& p, std::size_t i, const Sway& sway, double width_m) {
    Vec3 v{p.view.wind_x_m_per_s, p.view.wind_y_m_per_s, -double(p.particles.speed[i])};
    if (!p.snow) return p.size * v;
    v = v + Vec3{sway.vx, sway.vy, 0};
    const double longest = width_m / std::max(p.view.options.precipitation.exposure_s, 1e-6);
    return std::min(1.0, longest / length(v)) * v;
}

// Returns the place of a particle in the container: 0 at its point, 1 at the rim of its base, which is a circle for near
// rain and an ellipse across the way to it for far rain.
double within_container(const Pass& p, const Vec3& place) {
    const RainContainer& container = p.pass.container;
    const double x = place.x - container.nearest.x, y = place.y - container.nearest.y;
    if (!p.pass.far) return flat_length(x, y) / p.pass.boxes.depth_m;
    return flat_length((x * p.ahead.x + y * p.ahead.y) / p.pass.ahead_m,
                       (x * p.ahead.y - y * p.ahead.x) / p.pass.boxes.depth_m);
}

// Adds the streak of particle i, which is at (x, y, z) from the centre of the container.
void add(const Pass& p, std::size_t i, float x, float y, float z, std::vector<Streak>& out) {
    const ParticleBoxes& boxes = p.pass.boxes;
    const RainContainer& container = p.pass.container;
    const Vec3& eye = p.view.camera.position_m;
    Vec3 place{boxes.centre_x_m + double(x), boxes.centre_y_m + double(y), boxes.centre_z_m + double(z)};
    const double d = within_container(p, place);
    if (d >= double(p.particles.reach[i])) return;
    const Vec3 way = place - eye;
    if (!container.whole && way.x * container.axis.x + way.y * container.axis.y < 0) return;
    const double distance = length(way);
    if (dot(way, p.view.camera.forward) < shader::kNearestDrop_m) return;
    const double present = presence(p, i, d, double(z), distance);
    if (present <= 0) return;

    const double d_mm = double(p.particles.diameter_mm[i]);
    const PrecipitationOptions& options = p.view.options.precipitation;
    const Sway sway = p.snow ? sway_of(i, d_mm, p.view.time_s) : Sway{};
    place = place + Vec3{sway.x, sway.y, 0};
    const double growth = kGrowth[int(p.particles.kind)];
    const double width_m = p.size * (1 + growth * lod_size(d)) * 1e-3 * width_mm(p.particles.kind, d_mm);
    Ends ends = ends_of(p, place, velocity_of(p, i, sway, width_m));
    if (!ends.from.in_front || !ends.to.in_front) return;
    const double scale = p.pixels_per_unit / distance;
    double width = std::max(1.0, width_m * scale);
    if (p.pass.far) width = std::min(width, shader::kMostFarPixels);
    if (beside_picture(ends, width, p.view.options.camera)) return;

    const double real = real_particles(p.pass, options, place, d_mm);
    if (real <= 0) return;
    const double stands_for = real / drawn_per_m3(p.particles.size(), boxes, d);
    const double shadow =
        stands_for * 1e-6 * shadow_mm2(p.particles.kind, d_mm) * scale * scale * sway.cover;  // pixels
    ends = at_least(ends, p.snow ? width : 1.0);
    const double span = flat_length(ends.to.x - ends.from.x, ends.to.y - ends.from.y);
    const double opacity = present * std::min(shader::kMostDropOpaque, options.visibility * shadow / (width * span));
    if (opacity < shader::kLeastDropOpaque) return;
    Rgb light = particle_radiance(p.view.light, (1 / distance) * way, place, p.sunlight);
    // Drops oscillate and show now more of the sky, now more of the ground.
    const double turns = shader::kDropFlickers * double(p.particles.z[i]);
    const double turn = 1 + shader::kDropFlicker * (2 * std::fmod(turns, 1.0) - 1);
    for (double& value : light) value *= turn;
    Streak streak{float(ends.from.x), float(ends.from.y), float(ends.to.x), float(ends.to.y),
                  float(width),       float(opacity),     float(distance),  float(light[0]),
                  float(light[1]),    float(light[2])};
    if (p.pass.far) {
        const double kept = std::exp(-p.view.light.air_extinction_per_m[1] * distance);
        streak.opacity *= float(kept);
    }
    out.push_back(streak);
}

}  // namespace

double sway_per_s(std::size_t i) {
    return shader::kSwaySlowest + shader::kSwayFaster * double(i % shader::kSwaySpeeds);
}

double drawn_per_m3(std::size_t count, const ParticleBoxes& boxes, double d) {
    // The integral of 3 e^2 / (4 e^2) from d to 1, with the fade weights of particles near their reach.
    const double left = d <= 1 - shader::kReachFade
                            ? 1 - d - 0.5 * shader::kReachFade / (1 - shader::kReachFade) * d
                            : (1 - d) * (1 - d) * (1 - shader::kReachFade) / (2 * shader::kReachFade * d);
    return 0.75 * double(count) * std::max(left, 0.01) / (boxes.depth_m * boxes.depth_m * boxes.height_m);
}

namespace {

// Returns s0 (see the header), for a particle of the size with the greatest extinction, at the eye.
double size_at_eye(std::size_t count, const ParticlePass& pass, const PrecipitationOptions& p) {
    double largest = 1;
    for (const CurtainTerm& term : pass.rain) {
        const double d_mm = std::clamp(2 / term.law.slope, kSmallest_mm, kLargest_mm);
        const double w = 1e-3 * width_mm(p.kind, d_mm);
        const double streak = p.kind == PrecipitationKind::snow
                                  ? w
                                  : std::max(w, fall_speed_m_per_s(p.kind, d_mm) * p.exposure_s);
        const double stands_for =
            real_per_drawn(term.law, d_mm) / drawn_per_m3(count, pass.boxes, 0);
        const double shadow = p.visibility * stands_for * 1e-6 * shadow_mm2(p.kind, d_mm);
        largest = std::max(largest, std::sqrt(shadow / (kOpacityAtEye * w * streak)));
    }
    return std::min(largest, kMostSize[int(p.kind)]);
}

}  // namespace

PassShape pass_shape(std::size_t count, const ParticlePass& pass, const PrecipitationOptions& p, const Vec3& eye_m) {
    PassShape shape;
    if (pass.far) {
        const Vec2 way{pass.container.nearest.x - eye_m.x, pass.container.nearest.y - eye_m.y};
        const double length = flat_length(way.x, way.y);
        if (length > 0) shape.ahead = way / length;
    }
    shape.size = size_at_eye(count, pass, p);
    shape.lit_m = {pass.container.nearest.x, pass.container.nearest.y, pass.boxes.centre_z_m};
    return shape;
}

std::vector<Streak> streaks_of(const Particles& particles, const ParticlePass& pass, const StreakView& view,
                               const Picture& picture) {
    const PassShape shape =
        pass_shape(particles.size(), pass, view.options.precipitation, view.camera.position_m);
    const Pass shared{particles,
                      pass,
                      view,
                      pixels_per_unit(view.options.camera, view.camera),
                      shape.size,
                      double(sunlight_at(picture, shape.lit_m)),
                      particles.kind == PrecipitationKind::snow,
                      shape.ahead};
    const std::size_t chunks = (particles.size() + kChunk - 1) / kChunk;
    std::vector<std::vector<Streak>> parts(chunks);
    tbb::parallel_for(std::size_t(0), chunks, [&](std::size_t chunk) {
        const std::size_t begin = chunk * kChunk, end = std::min(particles.size(), begin + kChunk);
        std::vector<float> places(3 * kChunk);
        float *x = places.data(), *y = x + kChunk, *z = y + kChunk;
        place_particles(particles, pass.boxes, begin, end, x, y, z);
        for (std::size_t i = begin; i < end; ++i)
            add(shared, i, x[i - begin], y[i - begin], z[i - begin], parts[chunk]);
    });
    std::vector<Streak> all;
    for (const std::vector<Streak>& part : parts) all.insert(all.end(), part.begin(), part.end());
    return all;
}

}  // namespace nephos
