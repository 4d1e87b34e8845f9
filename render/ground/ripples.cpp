// SPDX-License-Identifier: Apache-2.0
#include "render/ground/ripples.h"

#include <algorithm>
#include <cmath>

#include "core/noise_hash.h"

namespace nephos {
namespace {

constexpr int kSide = kRippleTexels, kMask = kRippleTexels - 1;
constexpr double kTexel_m = kRippleSize_m / kRippleTexels;
constexpr double kCourant = kRippleSpeed_m_per_s * kRippleStep_s / kTexel_m;
static_assert(kCourant < 0.866, "stable");
static_assert((kSide & kMask) == 0);

std::size_t at(int column, int row) {
    return std::size_t(row & kMask) * std::size_t(kSide) + std::size_t(column & kMask);
}

// A row with the texel before its first and the one after its last.
using PaddedRow = float[kSide + 2];
void pad(const float* row, PaddedRow& out) {
    std::copy_n(row, kSide, out + 1);
    out[0] = row[kSide - 1];
    out[kSide + 1] = row[0];
}

// Computes L of a row: 1/6 of 4 times the four nearest texels, plus the four at the corners, minus 20 times
// the texel itself.
void laplacian_row(const std::vector<float>& z, int row, float* out) {
    PaddedRow south, middle, north;
    pad(&z[at(0, row - 1)], south);
    pad(&z[at(0, row)], middle);
    pad(&z[at(0, row + 1)], north);
    for (int i = 1; i <= kSide; ++i) {
        const float beside = south[i] + north[i] + middle[i - 1] + middle[i + 1];
        const float corners = south[i - 1] + south[i + 1] + north[i - 1] + north[i + 1];
        out[i - 1] = (4.0f * beside + corners - 20.0f * middle[i]) * (1.0f / 6.0f);
    }
}

// Returns word `which` of drop `drop` of a step as a uniform number in [0, 1).
float drawn(std::int64_t step, std::uint32_t drop, std::uint32_t which) {
    std::uint32_t h = mix_bits(std::uint32_t(step) + kAxisStep);
    h = mix_bits(h + std::uint32_t(std::uint64_t(step) >> 32) + drop * kAxisStep);
    return float(mix_bits(h + which * kAxisStep) >> 8) * 0x1p-24f;
}

// Adds an impulse of zero mean: (1 - q) exp(-q), q = r^2 / (2 s^2), a crown with a lower rim.
void push(std::vector<float>& z, float x, float y, float strength) {
    constexpr int kReach = 6;
    constexpr float kWidth = 1.5f;  // s, texels
    const int column = int(x), row = int(y);
    for (int j = -kReach; j <= kReach; ++j) {
        for (int i = -kReach; i <= kReach; ++i) {
            const float dx = float(column + i) - x, dy = float(row + j) - y;
            const float q = (dx * dx + dy * dy) / (2.0f * kWidth * kWidth);
            z[at(column + i, row + j)] += strength * (1.0f - q) * std::exp(-q);
        }
    }
}

double visible_drops_per_m2_s(double rain_mm_per_h) {
    if (!(rain_mm_per_h > 0)) return 0;
    const double per_mm = 4.1 * std::pow(rain_mm_per_h, -0.21);
    return 8000 / per_mm * std::exp(-1.5 * per_mm) * 6.5;
}

}  // namespace

Ripples still_water() {
    const std::vector<float> flat(std::size_t(kSide) * kSide, 0.0f);
    return {flat, flat};
}

void step(Ripples& ripples) {
    static const auto fading = float(std::exp(-kRippleDamping_per_s * kRippleStep_s));
    constexpr auto kPull = float(kCourant * kCourant);
    float curved[kSide];
    for (int row = 0; row < kSide; ++row) {
        laplacian_row(ripples.now, row, curved);
        float* old = &ripples.before[at(0, row)];
        const float* now = &ripples.now[at(0, row)];
        for (int i = 0; i < kSide; ++i)
            old[i] = fading * (2.0f * now[i] - fading * old[i] + kPull * curved[i]);
    }
    ripples.before.swap(ripples.now);
}

void add_drops(Ripples& ripples, std::int64_t step, double rain_mm_per_h) {
    constexpr float kHeight_m = 1.0e-3f;  // of the crown of an average drop
    const double number =
        visible_drops_per_m2_s(rain_mm_per_h) * kRippleSize_m * kRippleSize_m * kRippleStep_s;
    for (std::uint32_t drop = 0; double(drop) < number; ++drop) {
        // Number n is there from a rate on that is drawn between n and n + 1, and grows as the rain grows.
        const double there = std::clamp(8 * (number - drop - drawn(step, drop, 0)), 0.0, 1.0);
        if (there == 0) continue;
        const float size = std::min(3.0f, 0.4f - 0.6f * std::log(1.0f - drawn(step, drop, 1)));
        push(ripples.now, kSide * drawn(step, drop, 2), kSide * drawn(step, drop, 3),
             kHeight_m * float(there) * size);
    }
}

Ripples ripples_at(double time_s, double rain_mm_per_h, double history_s) {
    Ripples ripples = still_water();
    const auto last = std::int64_t(std::floor(time_s / kRippleStep_s)) + 1;
    const auto steps = std::int64_t(std::ceil(history_s / kRippleStep_s));
    for (std::int64_t n = last - steps; n <= last; ++n) {
        step(ripples);
        add_drops(ripples, n, rain_mm_per_h);
    }
    return ripples;
}

RippleSlopes ripple_slopes(double time_s, double rain_mm_per_h) {
    const Ripples ripples = ripples_at(time_s, rain_mm_per_h);
    const double steps = time_s / kRippleStep_s;
    const auto fraction = float(steps - std::floor(steps));
    std::vector<float> height = ripples.before;
    for (std::size_t i = 0; i < height.size(); ++i) height[i] += fraction * (ripples.now[i] - height[i]);
    RippleSlopes slopes{height, height, 0};
    constexpr auto kPerTwoTexels = float(0.5 / kTexel_m);
    double squares = 0;
    for (int row = 0; row < kSide; ++row) {
        for (int i = 0; i < kSide; ++i) {
            const float x = (height[at(i + 1, row)] - height[at(i - 1, row)]) * kPerTwoTexels,
                        y = (height[at(i, row + 1)] - height[at(i, row - 1)]) * kPerTwoTexels;
            slopes.x[at(i, row)] = x;
            slopes.y[at(i, row)] = y;
            squares += double(x) * x + double(y) * y;
        }
    }
    slopes.variance = squares / double(height.size());
    return slopes;
}

}  // namespace nephos
