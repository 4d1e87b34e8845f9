// SPDX-License-Identifier: Apache-2.0
#include "core/noise.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>

#include <tbb/parallel_for.h>

#include "core/error.h"
#include "core/noise_hash.h"
#include "core/text.h"

// Compiled once for each SIMD target of Highway and dispatched at run time.
#if defined(__OPTIMIZE__) && !defined(HWY_DISABLED_TARGETS)  // with -O0 as all files (docs/determinism.md)
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_SSE4)
#endif

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/noise.cpp"
#include <hwy/foreach_target.h>
//
#include <hwy/highway.h>

#include "core/noise_vectors-inl.h"

HWY_BEFORE_NAMESPACE();
namespace nephos {
namespace HWY_NAMESPACE {
namespace {

template <bool kPeriodic>
void points(const float* x, const float* y, const float* z, const NoiseOptions& options, std::size_t count,
            float* out) {
    const NoiseFloats d;
    const std::size_t lanes = hn::Lanes(d);
    const std::array<std::uint32_t, 3> seeds = axis_seeds(options.seed);
    const float period[] = {float(options.period[0]), float(options.period[1]), float(options.period[2])};
    const auto vector = [&](const float* px, const float* py, const float* pz, float* result) HWY_ATTR {
        hn::StoreU(noise(axis_point<kPeriodic>(hn::LoadU(d, px), 0, seeds[0], period[0]),
                         axis_point<kPeriodic>(hn::LoadU(d, py), 0, seeds[1], period[1]),
                         axis_point<kPeriodic>(hn::LoadU(d, pz), 0, seeds[2], period[2])),
                   d, result);
    };
    std::size_t n = 0;
    for (; n + lanes <= count; n += lanes) vector(x + n, y + n, z + n, out + n);
    if (n == count) return;
    HWY_ALIGN float rest[4][hn::MaxLanes(d)] = {};
    const float* const from[] = {x, y, z};
    for (int axis = 0; axis < 3; ++axis) std::memcpy(rest[axis], from[axis] + n, (count - n) * sizeof(float));
    vector(rest[0], rest[1], rest[2], rest[3]);
    std::memcpy(out + n, rest[3], (count - n) * sizeof(float));
}

}  // namespace

void noise_of_points(const float* x, const float* y, const float* z, const NoiseOptions& options,
                     std::size_t count, float* out) {
    const bool periodic = options.period != std::array{0, 0, 0};
    (periodic ? points<true> : points<false>)(x, y, z, options, count, out);
}

}  // namespace HWY_NAMESPACE
}  // namespace nephos
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace nephos {
HWY_EXPORT(noise_of_points);

namespace {

constexpr float kFarthest = 0x1p20f;
constexpr int kMostVoxels = 512, kMostOctaves = 8;
constexpr double kDeviation = 0.2;  // of the values of a volume

void require(bool good, const char* what, double value, const char* expected) {
    if (good) return;
    throw Error(ErrorCode::usage,
                std::string(what) + " is " + number_text(value, 9) + ", expected " + expected);
}

void check_coordinates(std::span<const float> coordinates) {
    for (const float c : coordinates) {
        require(std::abs(c) <= kFarthest, "a coordinate of noise", double(c),
                "a finite number within 2^20 cells");
    }
}

void check_volume(const NoiseVolumeOptions& o) {
    require(o.voxels >= 2 && o.voxels <= kMostVoxels, "`voxels` of a volume of noise", o.voxels, "2 to 512");
    require(o.cells >= 1 && o.cells <= o.voxels / 2, "`cells` of a volume of noise", o.cells,
            "1 to half of its voxels");
    require(o.octaves >= 1 && o.octaves <= kMostOctaves, "`octaves` of a volume of noise", o.octaves,
            "1 to 8");
    require(o.cells << (o.octaves - 1) <= o.voxels / 2, "`octaves` of a volume of noise", o.octaves,
            "a number whose last octave has cells of at least 2 voxels");
    require(o.persistence > 0 && o.persistence <= 1, "`persistence` of a volume of noise", o.persistence,
            "a number above 0, at most 1");
}

// Evaluates gradient_noise() at `count` points without checking the arguments.
void noise_points(const float* x, const float* y, const float* z, const NoiseOptions& options,
                  std::size_t count, float* out) {
    HWY_DYNAMIC_DISPATCH(noise_of_points)(x, y, z, options, count, out);
}

// Adds one octave to a level of voxels.
void add_level(const NoiseVolumeOptions& o, int octave, double weight, int level, std::span<float> values) {
    const int edge = o.voxels, cells = o.cells << octave;
    const NoiseOptions noise{mix_bits(o.seed + std::uint32_t(octave) * kAxisStep), {cells, cells, cells}};
    const auto at = [&](int n) { return (float(n) + 0.5f) * float(cells) / float(edge); };
    std::vector<float> x(static_cast<std::size_t>(edge)), y(x.size()), z(x.size(), at(level)), row(x.size());
    for (int n = 0; n < edge; ++n) x[std::size_t(n)] = at(n);
    for (int j = 0; j < edge; ++j) {
        std::ranges::fill(y, at(j));
        noise_points(x.data(), y.data(), z.data(), noise, x.size(), row.data());
        for (int i = 0; i < edge; ++i) {
            values[std::size_t(j) * std::size_t(edge) + std::size_t(i)] +=
                float(weight) * row[std::size_t(i)];
        }
    }
}

}  // namespace

void gradient_noise(std::span<const float> x, std::span<const float> y, std::span<const float> z,
                    const NoiseOptions& options, std::span<float> out) {
    if (x.size() != y.size() || x.size() != z.size() || x.size() != out.size()) {
        throw Error(ErrorCode::usage, "coordinates and values of noise differ in number");
    }
    for (const int period : options.period) {
        require(period >= 0 && period <= 1 << 20, "the period of noise", period, "0 to 2^20 cells");
    }
    check_coordinates(x);
    check_coordinates(y);
    check_coordinates(z);
    noise_points(x.data(), y.data(), z.data(), options, x.size(), out.data());
}

std::vector<float> noise_volume(const NoiseVolumeOptions& options) {
    check_volume(options);
    const std::size_t edge = std::size_t(options.voxels), level = edge * edge;
    std::vector<float> values(level * edge, 0.0f);
    tbb::parallel_for(std::size_t{0}, edge, [&](std::size_t k) {
        double weight = 1;
        for (int octave = 0; octave < options.octaves; ++octave, weight *= options.persistence) {
            add_level(options, octave, weight, int(k), std::span(values).subspan(k * level, level));
        }
    });
    double sum = 0, squares = 0;
    for (const float v : values) sum += double(v), squares += double(v) * double(v);
    const double count = double(values.size()), mean = sum / count;
    const double deviation = std::sqrt(std::max(squares / count - mean * mean, 1e-12));
    const float scale = float(kDeviation / deviation), middle = float(mean);
    for (float& v : values) v = std::clamp(0.5f + (v - middle) * scale, 0.0f, 1.0f);
    return values;
}

}  // namespace nephos
#endif
