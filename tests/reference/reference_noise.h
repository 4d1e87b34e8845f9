// SPDX-License-Identifier: Apache-2.0
#pragma once

// The naive twin of core/noise.h: one point at a time, double precision, written down from the header's
// formula alone.

#include <array>
#include <cmath>
#include <cstdint>

namespace nephos::test {

inline std::uint32_t reference_mix(std::uint32_t h) {
    h ^= h >> 16;
    h *= 0x7feb352dU;
    h ^= h >> 15;
    h *= 0x846ca68bU;
    h ^= h >> 16;
    return h;
}

// s(|d|), for |d| <= 1.
inline double reference_weight(double d) {
    const double a = std::fabs(d);
    return 1 - (6 * std::pow(a, 5) - 15 * std::pow(a, 4) + 10 * std::pow(a, 3));
}

// N(x, y, z), where the gradient of a lattice point (i, j, k) is that of home(i, j, k), an array of three.
template <typename Home>
double reference_noise_of(double x, double y, double z, std::uint32_t seed, const Home& home) {
    constexpr std::uint32_t kStep = 0x9e3779b1U;
    const std::uint32_t seed_x = reference_mix(seed + kStep), seed_y = reference_mix(seed_x + kStep);
    const std::uint32_t seed_z = reference_mix(seed_y + kStep);
    const auto i0 = std::int64_t(std::floor(x)), j0 = std::int64_t(std::floor(y)),
               k0 = std::int64_t(std::floor(z));
    double sum = 0;
    for (std::int64_t k = k0; k <= k0 + 1; ++k) {
        for (std::int64_t j = j0; j <= j0 + 1; ++j) {
            for (std::int64_t i = i0; i <= i0 + 1; ++i) {
                const std::array<std::int64_t, 3> at = home(i, j, k);
                const std::uint32_t hash = reference_mix(reference_mix(std::uint32_t(at[0]) * kStep + seed_x) +
                                                         reference_mix(std::uint32_t(at[1]) * kStep + seed_y) +
                                                         reference_mix(std::uint32_t(at[2]) * kStep + seed_z));
                const double dx = x - double(i), dy = y - double(j), dz = z - double(k);
                const double gx = (2.0 * (hash & 1023) - 1023) / 1023;
                const double gy = (2.0 * (hash >> 10 & 1023) - 1023) / 1023;
                const double gz = (2.0 * (hash >> 20 & 1023) - 1023) / 1023;
                sum += reference_weight(dx) * reference_weight(dy) * reference_weight(dz) *
                       (gx * dx + gy * dy + gz * dz);
            }
        }
    }
    return 2.0 / 3.0 * sum;
}

// N(x, y, z); periods as in NoiseOptions.
inline double reference_noise(double x, double y, double z, std::uint32_t seed, int px = 0, int py = 0,
                              int pz = 0) {
    const auto wrapped = [](std::int64_t n, int period) {
        return period ? ((n % period) + period) % period : n;
    };
    return reference_noise_of(x, y, z, seed, [&](std::int64_t i, std::int64_t j, std::int64_t k) {
        return std::array{wrapped(i, px), wrapped(j, py), wrapped(k, pz)};
    });
}

}  // namespace nephos::test
