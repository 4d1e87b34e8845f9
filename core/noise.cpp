// SPDX-License-Identifier: Apache-2.0
#include "core/noise.h"

#include <algorithm>
#include <cmath>
#include <string>

#include <tbb/parallel_for.h>

#include "core/error.h"
#include "core/noise_hash.h"
#include "core/noise_kernel.h"
#include "core/text.h"

namespace nephos {
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
