// SPDX-License-Identifier: Apache-2.0

// Writes the two cubes of detail_noise.h one after the other into the file that it is given, when the project is
// built: they take two seconds. Sums, products and square roots of doubles and 32-bit integers alone, without
// contraction: the same bytes on every machine.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <vector>

#include "core/noise_hash.h"

namespace nephos {
namespace {

struct Cube {
    int voxels = 64;  // on an edge
    int cells = 4;    // of the first octave on an edge
    std::uint32_t seed = 0;
};

std::uint32_t hash_of(int x, int y, int z, int period, std::uint32_t seed) {
    const auto wrapped = [period](int i) { return std::uint32_t((i % period + period) % period); };
    const auto seeds = axis_seeds(seed);
    return mix_bits(mix_bits(wrapped(x) * kAxisStep + seeds[0]) + mix_bits(wrapped(y) * kAxisStep + seeds[1]) +
                    mix_bits(wrapped(z) * kAxisStep + seeds[2]));
}

// Three numbers in 0..1 from a hash.
std::array<double, 3> numbers_of(std::uint32_t hash) {
    return {double(hash & 1023) / 1024, double(hash >> 10 & 1023) / 1024, double(hash >> 20 & 1023) / 1024};
}

// Distance to the nearest point; one in each cell.
double worley(double x, double y, double z, int period, std::uint32_t seed) {
    const int i = int(std::floor(x)), j = int(std::floor(y)), k = int(std::floor(z));
    double least = 9;
    for (int c = k - 1; c <= k + 1; ++c) {
        for (int b = j - 1; b <= j + 1; ++b) {
            for (int a = i - 1; a <= i + 1; ++a) {
                const auto at = numbers_of(hash_of(a, b, c, period, seed));
                const double dx = a + at[0] - x, dy = b + at[1] - y, dz = c + at[2] - z;
                least = std::min(least, dx * dx + dy * dy + dz * dz);
            }
        }
    }
    return std::sqrt(least);
}

double gradient_noise(double x, double y, double z, int period, std::uint32_t seed) {
    const int i = int(std::floor(x)), j = int(std::floor(y)), k = int(std::floor(z));
    const auto fade = [](double t) { return 1 - t * t * t * (t * (6 * t - 15) + 10); };
    double sum = 0;
    for (int n = 0; n < 8; ++n) {
        const int a = i + (n & 1), b = j + (n >> 1 & 1), c = k + (n >> 2);
        const auto gradient = numbers_of(hash_of(a, b, c, period, seed));
        const double dx = x - a, dy = y - b, dz = z - c;
        sum += fade(std::abs(dx)) * fade(std::abs(dy)) * fade(std::abs(dz)) *
               ((2 * gradient[0] - 1) * dx + (2 * gradient[1] - 1) * dy + (2 * gradient[2] - 1) * dz);
    }
    return sum;
}

double value_at(const Cube& cube, double x, double y, double z) {  // 0..1 along an edge
    double moved[3] = {x, y, z};
    for (std::uint32_t axis = 0; axis < 3; ++axis) {
        const int n = cube.cells;
        const double coarse = gradient_noise(x * n, y * n, z * n, n, cube.seed + 50 + axis),
                     fine = gradient_noise(2 * x * n, 2 * y * n, 2 * z * n, 2 * n, cube.seed + 60 + axis);
        moved[axis] += (coarse + 0.5 * fine) / n;
    }
    double sum = 0, weight = 1;
    for (std::uint32_t octave = 0; octave < 3; ++octave) {
        const int n = cube.cells << octave;
        sum += weight * worley(moved[0] * n, moved[1] * n, moved[2] * n, n, cube.seed + octave);
        weight *= 0.5;
    }
    return sum;
}

std::vector<std::uint8_t> bytes_of(const Cube& cube) {
    const auto edge = std::size_t(cube.voxels);
    std::vector<double> values;
    for (std::size_t n = 0; n < edge * edge * edge; ++n) {
        const auto middle = [edge](std::size_t i) { return (double(i % edge) + 0.5) / double(edge); };
        values.push_back(value_at(cube, middle(n), middle(n / edge), middle(n / (edge * edge))));
    }
    std::vector<double> sorted = values;
    std::ranges::sort(sorted);
    std::array<double, 255> knots{};  // between the 256 bytes
    for (std::size_t i = 0; i < knots.size(); ++i) knots[i] = sorted[(i + 1) * sorted.size() / 256];
    std::vector<std::uint8_t> bytes;
    for (const double value : values)
        bytes.push_back(std::uint8_t(std::ranges::upper_bound(knots, value) - knots.begin()));
    return bytes;
}

}  // namespace
}  // namespace nephos

int main(int argc, char** argv) {
    if (argc != 2) {
        std::fputs("usage: make_detail_noise FILE\n", stderr);
        return 2;
    }
    std::FILE* const file = std::fopen(argv[1], "wb");
    bool good = file != nullptr;
    for (const nephos::Cube& cube : {nephos::Cube{128, 8, 11}, nephos::Cube{64, 4, 23}}) {
        const std::vector<std::uint8_t> bytes = nephos::bytes_of(cube);
        good = good && std::fwrite(bytes.data(), 1, bytes.size(), file) == bytes.size();
    }
    if (file != nullptr) good = std::fclose(file) == 0 && good;
    if (!good) std::perror(argv[1]);
    return good ? 0 : 1;
}
