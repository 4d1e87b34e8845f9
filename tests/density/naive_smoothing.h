// SPDX-License-Identifier: Apache-2.0
#pragma once

// The naive twin of smoothing: one cell of the window at a time, as the formula in density/smoothing.h says.

#include <algorithm>
#include <cstdint>
#include <random>
#include <span>
#include <vector>

#include "automaton/lattice.h"
#include "density/smoothing.h"

namespace nephos::test {

// Bit of a cell anywhere: inside the box, around it on periodic axes, 0 beyond open ends.
inline bool naive_cell(const BitPlaneView& plane, int i, int j, int k, const Boundaries& boundaries) {
    const auto place = [](int n, int size, Boundary boundary) {
        if (boundary == Boundary::open) return n < 0 || n >= size ? -1 : n;
        return ((n % size) + size) % size;
    };
    i = place(i, plane.extent.x, boundaries.x);
    j = place(j, plane.extent.y, boundaries.y);
    k = place(k, plane.extent.z, boundaries.z);
    return i >= 0 && j >= 0 && k >= 0 && plane.get(i, j, k);
}

struct NaiveSum {
    std::uint64_t sum = 0, total = 0;
};

inline NaiveSum naive_sum(std::span<const TimedPlane> planes, const SmoothingOptions& o,
                          const Boundaries& boundaries, int i, int j, int k) {
    const auto wx = kernel_weights(o.kernel, o.i0), wy = kernel_weights(o.kernel, o.j0);
    const auto wz = kernel_weights(o.kernel, o.k0), wt = kernel_weights(o.kernel, o.t0);
    NaiveSum result;
    for (const TimedPlane& plane : planes) {
        for (int dk = -o.k0; dk <= o.k0; ++dk) {
            for (int dj = -o.j0; dj <= o.j0; ++dj) {
                for (int di = -o.i0; di <= o.i0; ++di) {
                    const std::uint64_t w = std::uint64_t{wx[std::size_t(di + o.i0)]} *
                                            wy[std::size_t(dj + o.j0)] * wz[std::size_t(dk + o.k0)] *
                                            wt[std::size_t(plane.step_offset + o.t0)];
                    result.total += w;
                    if (naive_cell(plane.cld, i + di, j + dj, k + dk, boundaries)) result.sum += w;
                }
            }
        }
    }
    return result;
}

// q in double precision, x fastest.
inline std::vector<double> naive_smooth(std::span<const TimedPlane> planes, const SmoothingOptions& options,
                                        const Boundaries& boundaries) {
    const Extent e = planes.front().cld.extent;
    std::vector<double> q(e.cells());
    for (int k = 0; k < e.z; ++k) {
        for (int j = 0; j < e.y; ++j) {
            for (int i = 0; i < e.x; ++i) {
                const NaiveSum s = naive_sum(planes, options, boundaries, i, j, k);
                q[linear_index(e, i, j, k)] = double(s.sum) / double(s.total);
            }
        }
    }
    return q;
}

// Each bit 1 with probability p.
inline BitPlane random_plane(Extent extent, double p, std::uint64_t seed) {
    BitPlane plane(extent);
    std::mt19937_64 random(seed);
    const auto threshold = std::uint64_t(p * 18446744073709549568.0);
    for (int k = 0; k < extent.z; ++k) {
        for (int j = 0; j < extent.y; ++j) {
            for (int i = 0; i < extent.x; ++i) {
                if (random() < threshold) plane.set(i, j, k, true);
            }
        }
    }
    return plane;
}

// Every bit 1.
inline BitPlane full_plane(Extent extent) {
    BitPlane plane(extent);
    for (int k = 0; k < extent.z; ++k) {
        for (int j = 0; j < extent.y; ++j) {
            for (int i = 0; i < extent.x; ++i) plane.set(i, j, k, true);
        }
    }
    return plane;
}

}  // namespace nephos::test
