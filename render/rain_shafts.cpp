// SPDX-License-Identifier: Apache-2.0
#include "render/rain_shafts.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include <tbb/parallel_for.h>

#include "automaton/random.h"
#include "automaton/vector_math.h"
#include "render/drop_sizes.h"
#include "render/frame_data.h"

namespace nephos {
namespace {

constexpr int kSteps = 12;
constexpr double kTopFade = 0.15;      // share of a curtain's height over which it begins in the cloud
constexpr double kSoftest = 0.6;       // least edge of a curtain that has one: it is seen from afar
constexpr double kFray = 0.4;          // share of the radius by which its outline varies
constexpr double kSlowFall = 6;        // m/s, of the texture
constexpr double kOpaque = 1.0 / 256;  // transmittance at which a ray ends

// Smooth noise 0..1 on a plane, from a table of random numbers that repeats every kSide cells.
class NoisePlane {
  public:
    explicit NoisePlane(std::uint64_t seed) {
        for (std::size_t i = 0; i < values_.size(); i += 4) {
            const PhiloxWords words =
                philox(seed, item_counter(Domain::particles, 1, std::uint32_t(i / 4), 0, 0));
            for (std::size_t w = 0; w < 4; ++w) values_[i + w] = float(unit_interval(words[w]));
        }
    }
    float at(double x, double y) const {
        const double floor_x = std::floor(x), floor_y = std::floor(y);
        const float sx = smooth(float(x - floor_x)), sy = smooth(float(y - floor_y));
        const auto column = std::int64_t(floor_x), row = std::int64_t(floor_y);
        const float low = between(value(column, row), value(column + 1, row), sx),
                    high = between(value(column, row + 1), value(column + 1, row + 1), sx);
        return between(low, high, sy);
    }

  private:
    static constexpr std::int64_t kSide = 128;
    static float smooth(float s) { return s * s * (3.0f - 2.0f * s); }
    static float between(float a, float b, float s) { return a + s * (b - a); }
    float value(std::int64_t x, std::int64_t y) const {
        return values_[std::size_t((y & (kSide - 1)) * kSide + (x & (kSide - 1)))];
    }
    std::array<float, std::size_t(kSide* kSide)> values_{};
};

// A curtain as a ray meets it: in units of its semi-axes, without its lean.
struct Curtain {
    const RainCurtain* what = nullptr;
    Vec3 eye;                                        // x, y in units, z metres above the ground
    double height_m = 1;                             // of the cloud above the ground
    double ax = 1, ay = 0, bx = 0, by = 1;           // from metres to units
    double reach_m = 0, centre_x = 0, centre_y = 0;  // circle around it, from the eye
    double extinction_per_m = 0;
    double grain_m = 100;  // of the texture
};

struct Interval {
    double begin = 1, end = 0;
    bool empty() const { return !(begin < end); }
};

Interval common(const Interval& a, const Interval& b) {
    return {std::max(a.begin, b.begin), std::min(a.end, b.end)};
}

// Everything that the rays of one picture share.
struct Shafts {
    const Picture& picture;
    const RenderOptions& options;
    const CameraFrame& camera;
    const PrecipitationLight& light;
    std::vector<Curtain> curtains;
    NoisePlane noise;
    double time_s = 0;
    double clear_m = 0;  // around the eye, where particles are drawn instead
    PictureAir air;
};

Curtain curtain_of(const RainCurtain& c, const PrecipitationOptions& p, const Vec3& eye) {
    Curtain out;
    out.what = &c;
    out.height_m = c.base_m - c.ground_m;
    const Ellipse at_eye = ellipse_at(c, eye.z);
    out.ax = c.axis_x / c.semi_a_m;
    out.ay = c.axis_y / c.semi_a_m;
    out.bx = -c.axis_y / c.semi_b_m;
    out.by = c.axis_x / c.semi_b_m;
    const double x = eye.x - at_eye.x_m, y = eye.y - at_eye.y_m;
    out.eye = {out.ax * x + out.ay * y, out.bx * x + out.by * y, eye.z - c.ground_m};
    const double up = 0.5 * out.height_m;  // the circle holds the curtain at all heights
    out.centre_x = c.x_m + c.lean_x * up - eye.x;
    out.centre_y = c.y_m + c.lean_y * up - eye.y;
    out.reach_m = std::max(c.semi_a_m, c.semi_b_m) + up * std::hypot(c.lean_x, c.lean_y);
    out.extinction_per_m = p.shafts * rain_extinction_per_m(p.kind, p.intensity_scale * c.rate_mm_per_h);
    out.grain_m = std::clamp(0.3 * std::min(c.semi_a_m, c.semi_b_m), 20.0, 400.0);
    return out;
}

// Where the ray runs in the curtain; `u` receives its direction in the curtain's units.
Interval meeting(const Curtain& c, const Vec3& ray, Point2& u) {
    // Past the circle around it?
    const double across = c.centre_x * ray.y - c.centre_y * ray.x, flat2 = ray.x * ray.x + ray.y * ray.y;
    if (across * across > c.reach_m * c.reach_m * flat2) return {};
    const double x = ray.x - c.what->lean_x * ray.z, y = ray.y - c.what->lean_y * ray.z;
    u = {c.ax * x + c.ay * y, c.bx * x + c.by * y};
    const double a = u.x * u.x + u.y * u.y, b = u.x * c.eye.x + u.y * c.eye.y,
                 rest = c.eye.x * c.eye.x + c.eye.y * c.eye.y - 1;
    const double infinity = std::numeric_limits<double>::infinity();
    Interval in{0, infinity};
    if (a > 0) {
        const double root = b * b - a * rest;
        if (!(root > 0)) return {};
        in = common(in, {(-b - std::sqrt(root)) / a, (-b + std::sqrt(root)) / a});
    } else if (rest >= 0) {
        return {};
    }
    if (ray.z != 0) {
        const double low = -c.eye.z / ray.z, high = (c.height_m - c.eye.z) / ray.z;
        in = common(in, {std::min(low, high), std::max(low, high)});
    } else if (c.eye.z < 0 || c.eye.z > c.height_m) {
        return {};
    }
    return in;
}

struct Met {
    const Curtain* curtain = nullptr;
    Interval in;
    Point2 u;
};

// Strands along the fall, 0..1.
double strands_at(const Shafts& s, const Curtain& c, const Vec3& place, double height_m) {
    const double x = (place.x - c.what->x_m - c.what->lean_x * height_m) / c.grain_m,
                 y = (place.y - c.what->y_m - c.what->lean_y * height_m) / c.grain_m;
    const double own = double(c.what->id % 61);
    return 0.6 * double(s.noise.at(x + own, y)) + 0.4 * double(s.noise.at(4 * x, 4 * y + own));
}

// Contrast of the rain: its strands, and denser falls on their way down. Mean about 1.
double texture(const Shafts& s, const Curtain& c, const Vec3& place, double height_m, double strands) {
    const double contrast = s.options.precipitation.shaft_texture;
    if (contrast <= 0) return 1;
    const double falls = double(s.noise.at(
        (place.x + place.y) / c.grain_m, (height_m + kSlowFall * s.time_s) / 700 + double(c.what->id % 61)));
    return std::exp(contrast * (4.5 * (strands - 0.5) + 1.5 * (falls - 0.5)) - 0.25 * contrast * contrast);
}

// Extinction at a distance along the ray: the densest curtain there.
double extinction(const Shafts& s, std::span<const Met> met, const Vec3& ray, double t) {
    const PrecipitationOptions& p = s.options.precipitation;
    double densest = 0;
    for (const Met& m : met) {
        if (t < m.in.begin || t > m.in.end) continue;
        const Curtain& c = *m.curtain;
        const double x = c.eye.x + t * m.u.x, y = c.eye.y + t * m.u.y, r = std::sqrt(x * x + y * y);
        const double height_m = c.eye.z + t * ray.z, h = height_m / c.height_m;
        const double top = std::clamp((1 - h) / kTopFade, 0.0, 1.0);
        const double most = c.extinction_per_m * top * left_of_rain(h, p.evaporation);
        if (most * 8 <= densest) continue;
        const Vec3 place = s.camera.position_m + t * ray;
        const double strands = strands_at(s, c, place, height_m);
        // The outline frays with the strands, inwards.
        const double inside = 1 - r - kFray * p.shaft_texture * strands * r;
        const double inner =
            p.edge > 0 ? std::clamp(inside / std::max(p.edge, kSoftest), 0.0, 1.0) : double(inside > 0);
        if (inner > 0)
            densest = std::max(
                densest, most * inner * inner * (3 - 2 * inner) * texture(s, c, place, height_m, strands));
    }
    if (s.clear_m > 0) {
        const double clear = std::clamp(2 * t / s.clear_m - 1, 0.0, 1.0);
        densest *= clear * clear * (3 - 2 * clear);
    }
    return densest;
}

// A run of steps in front of the pixel's cloud or behind it.
struct Through {
    double transmittance = 1;
    Rgb radiance{};
};

// Radiance of the curtain at a distance, as it arrives at the eye.
Rgb arriving(const Shafts& s, const Vec3& ray, double t) {
    const Vec3 place = s.camera.position_m + t * ray;
    const Rgb own = particle_radiance(s.light, ray, place, double(sunlight_at(s.picture, place)));
    Rgb seen;
    for (std::size_t c = 0; c < 3; ++c) {
        const double beta = std::exp(-s.air.extinction_per_m[c] * t);
        seen[c] = beta * own[c] + (1 - beta) * s.air.horizon[c];
    }
    return seen;
}

// A number 0..1 for each pixel that hides the steps (Jimenez 2014, interleaved gradient noise).
double jitter(int x, int y) {
    const double v = 52.9829189 * std::fmod(0.06711056 * x + 0.00583715 * y, 1.0);
    return 0.25 + 0.5 * (v - std::floor(v));
}

// What the curtains' intervals cover, as runs that do not touch, the nearest first.
void runs_of(std::span<const Met> met, std::vector<Interval>& runs) {
    runs.clear();
    for (const Met& m : met) runs.push_back(m.in);
    std::sort(runs.begin(), runs.end(),
              [](const Interval& a, const Interval& b) { return a.begin < b.begin; });
    std::size_t last = 0;
    for (std::size_t i = 1; i < runs.size(); ++i) {
        if (runs[i].begin > runs[last].end) {
            runs[++last] = runs[i];
        } else {
            runs[last].end = std::max(runs[last].end, runs[i].end);
        }
    }
    runs.resize(last + 1);
}

// False when nothing behind shows any more.
bool march(const Shafts& s, std::span<const Met> met, const Vec3& ray, const Interval& in, double offset,
           double cloud_m, Through& before, Through& behind) {
    const double step = (in.end - in.begin) / kSteps;
    for (int i = 0; i < kSteps; ++i) {
        const double t = in.begin + (i + offset) * step;
        const double per_m = extinction(s, met, ray, t);
        if (per_m <= 0) continue;
        Through& run = t < cloud_m ? before : behind;
        const double kept = std::exp(-per_m * step), share = run.transmittance * (1 - kept);
        const Rgb light = arriving(s, ray, t);
        for (std::size_t c = 0; c < 3; ++c) run.radiance[c] += share * light[c];
        run.transmittance *= kept;
        if (before.transmittance < kOpaque) return false;
    }
    return true;
}

// Of one row, to save memory: the curtains that a ray meets, and where.
struct Scratch {
    std::vector<Met> met;
    std::vector<Interval> runs;
};

void draw_pixel(const Shafts& s, Scratch& scratch, Picture& picture, int x, int y) {
    const Vec3 ray = pixel_ray(s.camera, s.options.camera, x + 0.5, y + 0.5);
    scratch.met.clear();
    for (const Curtain& c : s.curtains) {
        Point2 u;
        const Interval in = meeting(c, ray, u);
        if (!in.empty()) scratch.met.push_back({&c, in, u});
    }
    if (scratch.met.empty()) return;
    const std::size_t i = std::size_t(y) * std::size_t(picture.width) + std::size_t(x);
    runs_of(scratch.met, scratch.runs);
    Through before, behind;
    for (const Interval& run : scratch.runs)
        if (!march(s, scratch.met, ray, run, jitter(x, y), double(picture.depth_m[i]), before, behind)) break;
    // The air before a curtain is in both its terms: what the curtain sends has it from arriving(), and what
    // it lets through keeps the rest.
    float* pixel = &picture.beauty[3 * i];
    const double seen = double(picture.transmittance[i]);
    for (std::size_t c = 0; c < 3; ++c) {
        double value = double(pixel[c]);
        value += seen * ((behind.transmittance - 1) * value + behind.radiance[c]);
        pixel[c] = float(before.transmittance * value + before.radiance[c]);
    }
}

}  // namespace

double rain_extinction_per_m(PrecipitationKind kind, double rate_mm_per_h) {
    return rate_mm_per_h > 0 ? 2 * shadow_per_m(size_law(kind, rate_mm_per_h)) : 0;
}

double left_of_rain(double height, double evaporation) {
    if (evaporation <= 0) return 1;
    const double s = std::clamp((height - evaporation) / std::max(1 - evaporation, 1e-3), 0.0, 1.0);
    return s * (2 - s);
}

void draw_shafts(Picture& picture, const RenderOptions& options, const CameraFrame& camera,
                 std::span<const RainCurtain> curtains, const PrecipitationLight& light, double time_s,
                 std::uint64_t seed) {
    const PrecipitationOptions& p = options.precipitation;
    Shafts shafts{picture, options, camera, light, {}, NoisePlane(seed), time_s, 0, {}};
    for (const RainCurtain& c : curtains)
        if (c.base_m > c.ground_m && c.rate_mm_per_h > 0)
            shafts.curtains.push_back(curtain_of(c, p, camera.position_m));
    if (shafts.curtains.empty() || p.shafts <= 0) return;
    shafts.clear_m = p.particles > 0 ? p.depth_m : 0;
    shafts.air = air_of(picture, options);
    tbb::parallel_for(0, picture.height, [&](int y) {
        Scratch scratch;
        for (int x = 0; x < picture.width; ++x) draw_pixel(shafts, scratch, picture, x, y);
    });
}

}  // namespace nephos
