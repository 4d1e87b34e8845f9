// SPDX-License-Identifier: Apache-2.0
#pragma once

// The renderer's naive twin: extinction summed over all metaballs and integrated numerically along one ray,
// in double precision, with the formulas as D states them. Slow and obvious; shares no code with what it
// checks.

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include "render/renderer.h"

namespace nephos::reference {

struct Ray {
    Vec3 origin_m{};
    Vec3 direction{};  // unit
    double end_m = std::numeric_limits<double>::infinity();
};

// D, stage 2.
inline double field(double a) {
    if (a >= 1) return 0;
    const double s = a * a;
    return 1 - 22.0 / 9.0 * s + 17.0 / 9.0 * s * s - 4.0 / 9.0 * s * s * s;
}

// Integral of the field of one metaball along the ray from 0 to ray.end_m, in metres: Simpson's rule on the
// part that lies inside the ball.
inline double column_m(const Metaball& ball, const Ray& ray) {
    const double x = ball.x - ray.origin_m.x, y = ball.y - ray.origin_m.y, z = ball.z - ray.origin_m.z;
    const double middle = x * ray.direction.x + y * ray.direction.y + z * ray.direction.z;
    const double radius = ball.radius;
    const double offset2 = x * x + y * y + z * z - middle * middle;
    if (offset2 >= radius * radius) return 0;
    const double half = std::sqrt(radius * radius - offset2);
    const double begin = std::max(0.0, middle - half), end = std::min(ray.end_m, middle + half);
    if (end <= begin) return 0;
    constexpr int kSteps = 64;
    const double step = (end - begin) / kSteps;
    double sum = 0;
    for (int i = 0; i <= kSteps; ++i) {
        const double s = begin + i * step - middle;
        const double weight = i == 0 || i == kSteps ? 1 : i % 2 == 1 ? 4 : 2;
        sum += weight * field(std::sqrt(offset2 + s * s) / radius);
    }
    return sum * step / 3;
}

inline double transmittance(const MetaballCloud& cloud, const Ray& ray) {
    double sum = 0;
    for (const Metaball& ball : cloud.metaballs) sum += ball.density * column_m(ball, ray);
    return std::exp(-cloud.extinction_per_m * cloud.normalisation * sum);
}

// The ray through the middle of a pixel, straight from the definition of a perspective camera: x to the
// right, rows downwards, z up in the picture.
inline Ray pixel_ray(const Camera& camera, int column, int row) {
    const Vec3 view{camera.target_m.x - camera.position_m.x, camera.target_m.y - camera.position_m.y,
                    camera.target_m.z - camera.position_m.z};
    const auto cross = [](const Vec3& a, const Vec3& b) {
        return Vec3{a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
    };
    const auto unit = [](const Vec3& a) {
        const double l = std::sqrt(a.x * a.x + a.y * a.y + a.z * a.z);
        return Vec3{a.x / l, a.y / l, a.z / l};
    };
    const Vec3 forward = unit(view);
    const bool vertical = forward.x == 0 && forward.y == 0;
    const Vec3 right = unit(cross(forward, vertical ? Vec3{0, 1, 0} : Vec3{0, 0, 1}));
    const Vec3 up = cross(right, forward);
    const double pixel = 2 * std::tan(camera.vertical_fov_deg * std::numbers::pi / 360) / camera.height;
    const double a = (column + 0.5 - 0.5 * camera.width) * pixel,
                 b = (0.5 * camera.height - row - 0.5) * pixel;
    return {camera.position_m, unit({forward.x + a * right.x + b * up.x, forward.y + a * right.y + b * up.y,
                                     forward.z + a * right.z + b * up.z})};
}

// The same, ending where the ray meets the ground.
inline Ray pixel_ray(const RenderOptions& options, int column, int row) {
    Ray ray = pixel_ray(options.camera, column, row);
    const double drop = options.ground.height_m - ray.origin_m.z;
    if (drop < 0 && ray.direction.z < 0) ray.end_m = drop / ray.direction.z;
    return ray;
}

inline Vec3 to_sun(const Sun& sun) {
    const double elevation = sun.elevation_deg * std::numbers::pi / 180,
                 azimuth = sun.azimuth_deg * std::numbers::pi / 180;
    return {std::sin(azimuth) * std::cos(elevation), std::cos(azimuth) * std::cos(elevation),
            std::sin(elevation)};
}

// Metaballs of all sizes and densities, scattered in a box of 2 x 2 x 1 km with its base 500 m above the origin.
inline std::vector<Metaball> random_metaballs(unsigned seed, int count, double min_radius_m = 20,
                                              double max_radius_m = 200) {
    std::mt19937 engine(seed);
    const auto uniform = [&](double min, double max) {
        return float(min + (max - min) * (engine() / 4294967296.0));
    };
    std::vector<Metaball> balls;
    for (int i = 0; i < count; ++i)
        balls.push_back({uniform(-1000, 1000), uniform(-1000, 1000), uniform(500, 1500),
                         uniform(min_radius_m, max_radius_m), uniform(0, 1) * uniform(0, 1)});
    return balls;
}

// The same, spread over 5 x 5 km in a layer 400 m thick whose middle is at `height_m`: broken, all around.
inline std::vector<Metaball> broken_layer(unsigned seed, int count, float height_m) {
    std::vector<Metaball> balls = random_metaballs(seed, count, 80, 200);
    for (Metaball& ball : balls) {
        ball.x *= 2.5f;
        ball.y *= 2.5f;
        ball.z = height_m - 200 + 0.4f * (ball.z - 500);
    }
    return balls;
}

// Metaballs on a lattice, as the automaton gives them.
inline std::vector<Metaball> lattice_cloud(int cells, float cell_m) {
    std::vector<Metaball> balls;
    for (int k = 0; k < cells; ++k)
        for (int j = 0; j < cells; ++j)
            for (int i = 0; i < cells; ++i) {
                const float x = float(i) + 0.5f - 0.5f * float(cells),
                            y = float(j) + 0.5f - 0.5f * float(cells),
                            z = float(k) + 0.5f - 0.5f * float(cells);
                const float density = 1.0f - (x * x + y * y + z * z) / (0.25f * float(cells * cells));
                if (density > 0)
                    balls.push_back({x * cell_m, y * cell_m, 1000 + z * cell_m, 2 * cell_m, density});
            }
    return balls;
}

// A saturated lattice of metaballs of two cells' radius has density 1 (density/metaballs.h).
inline constexpr double kNormalisationTwoCells = 2835.0 / (736.0 * std::numbers::pi * 8.0);

// How far a picture is from its twin.
struct Difference {
    double max = 0, mean = 0;
};

class DifferenceSum {
  public:
    void add(double a, double b) {
        max_ = std::max(max_, std::abs(a - b));
        sum_ += std::abs(a - b);
        ++count_;
    }
    Difference result() const { return {max_, sum_ / std::max(count_, 1)}; }

  private:
    double max_ = 0, sum_ = 0;
    int count_ = 0;
};

}  // namespace nephos::reference
