// SPDX-License-Identifier: Apache-2.0
#include "render/terrain/relief.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include <tbb/parallel_for.h>

#include "core/noise.h"
#include "core/noise_hash.h"
#include "render/terrain/erosion.h"

namespace nephos {
namespace {

constexpr int kMostWorn = 512;           // heights along a side of the grid that rivers wear
constexpr double kFineness = 2.02;       // ratio of wavelengths of successive octaves
constexpr double kLeastWavelength = 2.5;  // cells
constexpr float kPerUnit = 2.4f;         // the noise, -0.42..0.42 mostly, to -1..1

// A row of noise at a wavelength, and what it takes.
class NoiseRow {
  public:
    explicit NoiseRow(std::size_t count) : x_(count), y_(count), z_(count, 0.37f), value(count) {}
    // At places in metres, displaced by `bend_x`, `bend_y`.
    void evaluate(const std::vector<double>& x_m, const std::vector<double>& y_m, double wavelength_m, std::uint32_t seed) {
        for (std::size_t n = 0; n < x_.size(); ++n) {
            x_[n] = float(x_m[n] / wavelength_m);
            y_[n] = float(y_m[n] / wavelength_m);
        }
        gradient_noise(x_, y_, z_, {.seed = seed}, value);
        for (float& v : value) v *= kPerUnit;
    }

  private:
    std::vector<float> x_, y_, z_;

  public:
    std::vector<float> value;
};

struct Grid {
    int columns = 2, rows = 2;
    double cell_m = 1;
};

Grid grid_of(const TerrainOptions& options) {
    Grid grid;
    grid.cell_m = std::max(options.width_m, options.length_m) / (options.cells - 1);
    const auto nodes = [&](double side_m) { return std::max(2, int(std::lround(side_m / grid.cell_m)) + 1); };
    grid.columns = nodes(options.width_m);
    grid.rows = nodes(options.length_m);
    return grid;
}

// One row of heights.
void fill_row(const TerrainOptions& options, const Grid& grid, int row, float* out) {
    const auto count = std::size_t(grid.columns);
    const bool ridges = options.relief == Relief::ridges;
    const auto seed = std::uint32_t(mix_bits(std::uint32_t(options.seed)) + std::uint32_t(options.seed >> 32));
    std::vector<double> x(count), y(count), bent_x(count), bent_y(count);
    for (std::size_t n = 0; n < count; ++n) {
        x[n] = double(n) * grid.cell_m;
        y[n] = row * grid.cell_m;
    }
    NoiseRow noise(count);
    bent_x = x;
    bent_y = y;
    for (const double share : {1.0, 0.37}) {
        const double wavelength = 1.3 * share * options.feature_m, way = 0.35 * share * options.feature_m;
        noise.evaluate(x, y, wavelength, seed + 11 + std::uint32_t(100 * share));
        for (std::size_t n = 0; n < count; ++n) bent_x[n] += way * double(noise.value[n]);
        noise.evaluate(x, y, wavelength, seed + 12 + std::uint32_t(100 * share));
        for (std::size_t n = 0; n < count; ++n) bent_y[n] += way * double(noise.value[n]);
    }
    // Where mountains stand, and where valleys are wide.
    std::vector<float> massif(count), weight(count, 1.0f);
    noise.evaluate(bent_x, bent_y, 2.3 * options.feature_m, seed + 21);
    for (std::size_t n = 0; n < count; ++n) massif[n] = std::clamp(0.55f + 0.75f * noise.value[n], 0.08f, 1.0f);
    std::fill_n(out, count, 0.0f);
    float amplitude = 1;
    std::uint32_t octave = 0;
    for (double wavelength = options.feature_m; wavelength > kLeastWavelength * grid.cell_m;
         wavelength /= kFineness, ++octave) {
        noise.evaluate(bent_x, bent_y, wavelength, seed + 31 + octave);
        for (std::size_t n = 0; n < count; ++n) {
            if (ridges) {
                const float crest = 1 - std::min(std::abs(1.5f * noise.value[n]), 1.0f), square = crest * crest;
                out[n] += amplitude * weight[n] * square;
                weight[n] = std::clamp(1.6f * square * weight[n], 0.0f, 1.0f);
            } else {
                out[n] += amplitude * (0.5f + 0.5f * noise.value[n]);
            }
        }
        amplitude *= ridges ? 0.46f : 0.42f;
    }
    for (std::size_t n = 0; n < count; ++n) out[n] *= massif[n];
}

void stretch(std::vector<float>& heights) {
    const auto [low, high] = std::ranges::minmax(heights);
    const float per = high > low ? 1 / (high - low) : 0.0f, from = low;
    for (float& z : heights) z = (z - from) * per;
}

// Heights without erosion, 0..1.
HeightImage raw_heights(const TerrainOptions& options) {
    const Grid grid = grid_of(options);
    HeightImage image{grid.columns, grid.rows, {}};
    image.heights.resize(std::size_t(grid.columns) * std::size_t(grid.rows));
    tbb::parallel_for(0, grid.rows, [&](int row) {
        fill_row(options, grid, row, &image.heights[std::size_t(row) * std::size_t(grid.columns)]);
    });
    return image;
}

// Weights of a uniform cubic B-spline at a fraction: smooth, so that the coarse grid does not show.
std::array<double, 4> spline(double f) {
    return {(1 - f) * (1 - f) * (1 - f) / 6, (4 + f * f * (3 * f - 6)) / 6, (1 + f * (3 + f * (3 - 3 * f))) / 6, f * f * f / 6};
}

// Adds values of a coarse grid that spans the same country.
void add_coarse(const HeightImage& coarse, HeightImage& fine) {
    tbb::parallel_for(0, fine.rows, [&](int j) {
        const double y = double(j) / (fine.rows - 1) * (coarse.rows - 1);
        const int row = std::min(int(y), coarse.rows - 2);
        const std::array<double, 4> up = spline(y - row);
        for (int i = 0; i < fine.columns; ++i) {
            const double x = double(i) / (fine.columns - 1) * (coarse.columns - 1);
            const int column = std::min(int(x), coarse.columns - 2);
            const std::array<double, 4> across = spline(x - column);
            double sum = 0;
            for (int b = 0; b < 4; ++b) {
                const int at_y = std::clamp(row + b - 1, 0, coarse.rows - 1);
                for (int a = 0; a < 4; ++a) {
                    const int at_x = std::clamp(column + a - 1, 0, coarse.columns - 1);
                    sum += up[std::size_t(b)] * across[std::size_t(a)] *
                           double(coarse.heights[std::size_t(at_y) * std::size_t(coarse.columns) + std::size_t(at_x)]);
                }
            }
            fine.heights[std::size_t(j) * std::size_t(fine.columns) + std::size_t(i)] += float(sum);
        }
    });
}

}  // namespace

HeightImage relief_heights(const TerrainOptions& options) {
    HeightImage image = raw_heights(options);
    if (options.relief == Relief::ridges) {
        TerrainOptions coarse_options = options;
        coarse_options.cells = std::min(options.cells, kMostWorn);
        HeightImage coarse = raw_heights(coarse_options);
        std::vector<float> before = coarse.heights;
        erode(coarse);
        for (std::size_t n = 0; n < before.size(); ++n) coarse.heights[n] -= before[n];
        add_coarse(coarse, image);
    }
    stretch(image.heights);
    return image;
}

}  // namespace nephos
