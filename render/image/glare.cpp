// SPDX-License-Identifier: Apache-2.0
#include "render/image/glare.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>

#include <tbb/parallel_for.h>

namespace nephos {
namespace {

constexpr double kDegrees = 180 / std::numbers::pi;
constexpr double kWidest_deg = 30;  // of the Gaussians
constexpr std::size_t kParts = 4;   // red, green, blue, and how much of the kernel is in the picture

struct Level {
    int width = 0, height = 0;
    std::vector<float> values;  // kParts a pixel

    Level(int w, int h) : width(w), height(h), values(kParts * std::size_t(w) * std::size_t(h)) {}
    float* row(int y) { return &values[kParts * std::size_t(y) * std::size_t(width)]; }
    const float* row(int y) const { return &values[kParts * std::size_t(y) * std::size_t(width)]; }
};

// Pixel k of the halved line is the mean, by 1 3 3 1, of 2 k - 3 .. 2 k; one more than half, so that nothing
// is lost at the end.
int halved(int count) { return count / 2 + 2; }

// Standard deviation in pixels of what level n is after halving and doubling: each adds 3/4 of a pixel^2 of
// the finer level.
double sigma_of_level(int n) { return std::sqrt(0.5 * (std::pow(4.0, n) - 1)); }

template <class Line>
void add_line(const Line& line, int count, int at, float weight, std::size_t stride, float* to) {
    if (at < 0 || at >= count) return;
    for (std::size_t part = 0; part < kParts; ++part) to[part] += weight * line[std::size_t(at) * stride + part];
}

constexpr float kHalving[4] = {0.125f, 0.375f, 0.375f, 0.125f};

Level halved(const Level& fine) {
    Level across(halved(fine.width), fine.height), coarse(across.width, halved(fine.height));
    tbb::parallel_for(0, fine.height, [&](int y) {
        for (int x = 0; x < across.width; ++x)
            for (int k = 0; k < 4; ++k)
                add_line(fine.row(y), fine.width, 2 * x - 3 + k, kHalving[k], kParts,
                         across.row(y) + kParts * std::size_t(x));
    });
    tbb::parallel_for(0, coarse.height, [&](int y) {
        for (int k = 0; k < 4; ++k) {
            const int from = 2 * y - 3 + k;
            if (from < 0 || from >= fine.height) continue;
            const float* a = across.row(from);
            float* to = coarse.row(y);
            for (std::size_t i = 0; i < kParts * std::size_t(coarse.width); ++i) to[i] += kHalving[k] * a[i];
        }
    });
    return coarse;
}

// Adds a coarser level to a finer one, interpolated between its pixels, which lie at 2 k - 1.5.
void add_doubled(const Level& coarse, Level& fine) {
    tbb::parallel_for(0, fine.height, [&](int y) {
        const int low = (y + 1) / 2;
        const float lower = y % 2 == 0 ? 0.25f : 0.75f;
        const float *a = coarse.row(low), *b = coarse.row(low + 1);
        float* to = fine.row(y);
        for (int x = 0; x < fine.width; ++x, to += kParts) {
            const int left = (x + 1) / 2;
            const float part = x % 2 == 0 ? 0.25f : 0.75f;
            const float *p = a + kParts * std::size_t(left), *q = b + kParts * std::size_t(left);
            for (std::size_t c = 0; c < kParts; ++c) {
                const float up = part * p[c] + (1 - part) * p[c + kParts],
                            down = part * q[c] + (1 - part) * q[c + kParts];
                to[c] += lower * up + (1 - lower) * down;
            }
        }
    });
}

void scale(Level& level, float factor) {
    for (float& value : level.values) value *= factor;
}

}  // namespace

// theta^-p is the integral of sigma^-p exp(-theta^2 / (2 sigma^2)) / (2^(p/2-1) gamma(p/2)) over the logarithm
// of sigma; an octave of it is ln 2 wide, and a Gaussian of height 1 has a volume of 2 pi sigma^2.
double glare_share(double sigma_deg, double strength) {
    const double octave = std::numbers::ln2 * 2 * std::numbers::pi / (kDegrees * kDegrees);
    const double cubic = 0.478 * 20.91 / (std::numbers::sqrt2 * 0.5 * std::sqrt(std::numbers::pi));
    return strength * octave * (cubic / sigma_deg + 0.138 * 72.37);
}

std::vector<float> with_glare(const Picture& picture, const Camera& camera) {
    if (!(camera.glare > 0)) return picture.beauty;
    const double degrees_per_pixel =
        kDegrees * 2 * std::tan(0.5 * camera.vertical_fov_deg / kDegrees) / picture.height;
    std::vector<Level> levels;
    levels.emplace_back(picture.width, picture.height);
    for (std::size_t i = 0; i < picture.pixels(); ++i) {
        std::copy_n(&picture.beauty[3 * i], 3, &levels[0].values[kParts * i]);
        levels[0].values[kParts * i + 3] = 1;
    }
    const int side = std::max(picture.width, picture.height);
    for (int n = 1; sigma_of_level(n) * degrees_per_pixel < kWidest_deg && (1 << n) < side; ++n)
        levels.push_back(halved(levels.back()));
    if (levels.size() == 1) return picture.beauty;
    for (std::size_t n = levels.size() - 1; n > 0; --n) {
        const double share = glare_share(sigma_of_level(int(n)) * degrees_per_pixel, camera.glare);
        // Levels below are added already, with their own shares.
        Level sum(levels[n].width, levels[n].height);
        sum.values = levels[n].values;
        scale(sum, float(share));
        if (n + 1 < levels.size()) add_doubled(levels[n + 1], sum);
        levels[n] = std::move(sum);
    }
    Level spread(picture.width, picture.height);
    add_doubled(levels[1], spread);
    std::vector<float> beauty(picture.beauty.size());
    for (std::size_t i = 0; i < picture.pixels(); ++i) {
        const float kept = std::max(0.0f, 1 - spread.values[kParts * i + 3]);
        for (std::size_t c = 0; c < 3; ++c)
            beauty[3 * i + c] = kept * picture.beauty[3 * i + c] + spread.values[kParts * i + c];
    }
    return beauty;
}

}  // namespace nephos
