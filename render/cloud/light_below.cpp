// SPDX-License-Identifier: Apache-2.0
#include "render/cloud/light_below.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include <tbb/parallel_for.h>

namespace nephos {
namespace {

constexpr int kTexels = GroundLight::kTexels;
constexpr int kParts = 2;                     // of a texel, on an edge: a bin of columns
constexpr int kBins = kTexels * kParts;
constexpr int kFadedTexels = 6;               // over which the map of clouds that repeat becomes their mean

struct Fractions {
    float sun = 0, sky = 1;
};

Fractions mixed(const Fractions& a, const Fractions& b, float part) {
    return {a.sun + part * (b.sun - a.sun), a.sky + part * (b.sky - a.sky)};
}

// Height below which a twentieth of the cloud's mass lies: a shred of fog is not its base.
double base_of(const PreparedCloud& cloud) {
    constexpr int kSteps = 256;
    std::array<double, kSteps> mass{};
    const double step_m = std::max(cloud.top_m - cloud.base_m, 1.0) / kSteps;
    double all = 0;
    for (std::size_t i = 0; i < cloud.visible.size(); ++i) {
        const Metaball& ball = cloud.metaballs[cloud.visible[i]];
        const double own = double(cloud.depth_scale[i]) * double(ball.radius) * double(ball.radius);
        const int at = std::clamp(int((double(ball.z) - cloud.base_m) / step_m), 0, kSteps - 1);
        mass[std::size_t(at)] += own;
        all += own;
    }
    int at = 0;
    for (double below = mass[0]; below < 0.05 * all && at < kSteps - 1; below += mass[std::size_t(at)]) ++at;
    return cloud.base_m + at * step_m;
}

struct Map {
    Vec2 corner_m{0, 0}, bin_m{1, 1};
    std::vector<float> depths = std::vector<float>(std::size_t(kBins) * kBins);  // vertical, of bins; x fastest
};

// Each metaball's extinction goes to the four bins around its centre.
void add_columns(const PreparedCloud& cloud, const RepeatedArea& repeated, Map& map) {
    constexpr double kVolume = 736 * std::numbers::pi / 2835;  // integral of D's field function of radius 1
    const double per_area = kVolume / (map.bin_m.x * map.bin_m.y);
    const bool repeats = repeated.edges_m.x > 0;
    for (std::size_t i = 0; i < cloud.visible.size(); ++i) {
        const Metaball& ball = cloud.metaballs[cloud.visible[i]];
        const double depth = per_area * double(cloud.depth_scale[i]) * double(ball.radius) * double(ball.radius);
        const Vec2 place = (Vec2(ball.x, ball.y) - map.corner_m) / map.bin_m - 0.5;
        const Vec2 low = glm::floor(place), part = place - low;
        for (int n = 0; n < 4; ++n) {
            int x = int(low.x) + (n & 1), y = int(low.y) + (n >> 1);
            if (repeats) {
                x = (x % kBins + kBins) % kBins;
                y = (y % kBins + kBins) % kBins;
            }
            if (x < 0 || y < 0 || x >= kBins || y >= kBins) continue;
            const double weight = ((n & 1) != 0 ? part.x : 1 - part.x) * (n >> 1 != 0 ? part.y : 1 - part.y);
            map.depths[std::size_t(y) * kBins + std::size_t(x)] += float(weight * depth);
        }
    }
}

// What a layer of a vertical depth transmits, besides direct sunlight.
Fractions transmitted(double depth, double sine, double mean_cosine) {
    const double reduced = (1 - mean_cosine) * depth, scaled = (1 - mean_cosine * mean_cosine) * depth;
    const double all = (2 + 3 * sine + (2 - 3 * sine) * std::exp(-scaled / sine)) / (4 + 3 * reduced);
    return {float(std::max(all - std::exp(-depth / sine), 0.0)), float(1 / (1 + 0.75 * reduced))};
}

// Replaces each number by the mean of those up to `radius` away along its row, which goes on as itself where clouds repeat,
// else as `beyond`.
void average_rows(std::vector<Fractions>& map, int radius, bool repeats, const Fractions& beyond) {
    const float scale = 1.0f / float(2 * radius + 1);
    tbb::parallel_for(0, kTexels, [&](int y) {
        std::array<Fractions, kTexels> row;
        Fractions* const own = &map[std::size_t(y) * kTexels];
        std::copy_n(own, kTexels, row.begin());
        const auto at = [&](int x) -> const Fractions& {
            if (repeats) return row[std::size_t((x + kTexels) % kTexels)];
            return x < 0 || x >= kTexels ? beyond : row[std::size_t(x)];
        };
        for (int x = 0; x < kTexels; ++x) {
            Fractions sum{0, 0};
            for (int other = x - radius; other <= x + radius; ++other) {
                sum.sun += at(other).sun;
                sum.sky += at(other).sky;
            }
            own[x] = {scale * sum.sun, scale * sum.sky};
        }
    });
}

void transpose(std::vector<Fractions>& map) {
    for (std::size_t y = 0; y < kTexels; ++y)
        for (std::size_t x = y + 1; x < kTexels; ++x) std::swap(map[y * kTexels + x], map[x * kTexels + y]);
}

std::uint32_t packed(const Fractions& of) {
    const auto word = [](float share) { return std::uint32_t(65535 * std::clamp(share, 0.0f, 1.0f) + 0.5f); };
    return word(of.sun) | word(of.sky) << 16;
}

}  // namespace

GroundLight light_below(const PreparedCloud& cloud, const RepeatedArea& repeated, const Vec3& to_sun, double mean_cosine,
                        double ground_height_m) {
    constexpr double kLeastSine = 0.02;  // of the sun's elevation: its light on level ground is next to nothing then
    GroundLight light;
    if (cloud.visible.empty()) return light;
    const bool repeats = repeated.edges_m.x > 0;
    const double spread_m = std::max(base_of(cloud) - ground_height_m, 0.0);
    Vec2 begin = repeated.corner_m, end = repeated.corner_m + repeated.edges_m;
    if (!repeats) {
        begin = Vec2(std::numeric_limits<double>::infinity());
        end = -begin;
        for (const std::uint32_t i : cloud.visible) {
            const Metaball& ball = cloud.metaballs[i];
            begin = glm::min(begin, Vec2(ball.x, ball.y) - double(ball.radius));
            end = glm::max(end, Vec2(ball.x, ball.y) + double(ball.radius));
        }
        begin -= 2 * spread_m;
        end += 2 * spread_m;
    }
    light.corner_m = begin;
    light.texel_m = (end - begin) / double(kTexels);
    Map columns{begin, light.texel_m / double(kParts)};
    add_columns(cloud, repeated, columns);

    std::vector<Fractions> map(std::size_t(kTexels) * kTexels);
    const double sine = std::max(to_sun.z, kLeastSine);
    tbb::parallel_for(0, kTexels, [&](int y) {
        for (int x = 0; x < kTexels; ++x) {
            Fractions sum{0, 0};
            for (int n = 0; n < kParts * kParts; ++n) {
                const int column = x * kParts + n % kParts, row = y * kParts + n / kParts;
                const float depth = columns.depths[std::size_t(row) * kBins + std::size_t(column)];
                const Fractions of = transmitted(double(depth), sine, mean_cosine);
                sum.sun += of.sun / (kParts * kParts);
                sum.sky += of.sky / (kParts * kParts);
            }
            map[std::size_t(y) * kTexels + std::size_t(x)] = sum;
        }
    });
    Fractions beyond;
    if (repeats) {
        beyond = {0, 0};
        for (const Fractions& of : map) {
            beyond.sun += of.sun / float(map.size());
            beyond.sky += of.sky / float(map.size());
        }
    }
    for (int axis = 0; axis < 2; ++axis) {  // twice a box along each axis: half of the light within `spread_m`
        const int radius = std::clamp(int(std::lround(0.5 * spread_m / light.texel_m[axis])), 1, kTexels / 4);
        for (int pass = 0; pass < 2; ++pass) average_rows(map, radius, repeats, beyond);
        transpose(map);
    }
    light.words.resize(map.size());
    for (int n = 0; n < kTexels * kTexels; ++n) {
        const int x = n % kTexels, y = n / kTexels;
        const int inside = std::min({x, y, kTexels - 1 - x, kTexels - 1 - y});
        const float part = std::min(float(inside) / kFadedTexels, 1.0f);
        light.words[std::size_t(n)] = packed(mixed(beyond, map[std::size_t(n)], part * part * (3 - 2 * part)));
    }
    return light;
}

}  // namespace nephos
