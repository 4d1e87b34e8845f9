// SPDX-License-Identifier: Apache-2.0
#include "core/noise_kernel.h"

#include <algorithm>
#include <cstring>

// Compiled once for each SIMD target of Highway and dispatched at run time.
#ifndef HWY_DISABLED_TARGETS
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_SSE4)
#endif

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/noise_kernel.cpp"
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

void noise_points(const float* x, const float* y, const float* z, const NoiseOptions& options,
                  std::size_t count, float* out) {
    HWY_DYNAMIC_DISPATCH(noise_of_points)(x, y, z, options, count, out);
}

}  // namespace nephos
#endif
