// SPDX-License-Identifier: Apache-2.0
#include "density/veil_kernel.h"

#include <cmath>

// Compiled once for each SIMD target of Highway and dispatched at run time.
#ifndef HWY_DISABLED_TARGETS
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_SSE4)
#endif

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "density/veil_kernel.cpp"
#include <hwy/foreach_target.h>
//
#include <hwy/highway.h>

#include "core/noise_vectors-inl.h"

HWY_BEFORE_NAMESPACE();
namespace nephos {
namespace HWY_NAMESPACE {
namespace {

// An octave seen from the base of the points: the lattice cell that the base lies in, and where in it.
struct LocalOctave {
    std::uint32_t cell[3];
    float within[3], per_m[3];
};

LocalOctave local_octave(const VeilOctavePlan& octave, const std::array<double, 3>& base_m) {
    LocalOctave local;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const double at = base_m[axis] * octave.per_m[axis] + octave.phase[axis];
        const double cell = std::floor(at);
        local.cell[axis] = std::uint32_t(std::int64_t(cell));
        local.within[axis] = float(at - cell);
        local.per_m[axis] = float(octave.per_m[axis]);
    }
    return local;
}

constexpr std::size_t kMostOctaves = 12;

// q of one vector of points.
template <bool kRidged, bool kDisplaced>
HWY_INLINE Floats sum_of_octaves(const VeilPlan& plan, const LocalOctave* local, Floats (&point)[3],
                                 float threshold) {
    const NoiseFloats d;
    Floats sum = hn::Zero(d), value = hn::Zero(d);
    for (std::size_t k = 0; k < plan.octaves.size(); ++k) {
        const VeilOctavePlan& octave = plan.octaves[k];
        if (kDisplaced && k > 0) {
            for (std::size_t axis = 0; axis < 3; ++axis) {
                point[axis] = hn::Add(point[axis], hn::Mul(value, hn::Set(d, octave.displacement_m[axis])));
            }
        }
        const auto axis_at = [&](std::size_t axis) HWY_ATTR {
            const Floats at = hn::Add(hn::Mul(point[axis], hn::Set(d, local[k].per_m[axis])),
                                      hn::Set(d, local[k].within[axis]));
            return axis_point<false>(at, local[k].cell[axis], octave.seeds[axis], 0);
        };
        const Floats n = noise(axis_at(0), axis_at(1), axis_at(2));
        value = hn::Add(hn::Mul(n, hn::Set(d, octave.gain)), hn::Set(d, octave.offset));
        if (kRidged) {
            value = hn::Sub(hn::Set(d, octave.ridge), hn::Abs(hn::Sub(hn::Set(d, octave.crest), value)));
        }
        sum = hn::Add(sum, hn::Mul(value, hn::Set(d, octave.weight)));
        if (hn::AllTrue(d, hn::Lt(sum, hn::Set(d, threshold - octave.most_after)))) break;
    }
    return sum;
}

template <bool kRidged, bool kDisplaced>
void sums(const VeilPlan& plan, const VeilPoints& points, float threshold, float* out) {
    const NoiseFloats d;
    LocalOctave local[kMostOctaves];
    for (std::size_t k = 0; k < plan.octaves.size(); ++k) {
        local[k] = local_octave(plan.octaves[k], points.base_m);
    }
    for (std::size_t n = 0; n < points.count; n += hn::Lanes(d)) {
        Floats point[3] = {hn::LoadU(d, points.from_base_m[0] + n), hn::LoadU(d, points.from_base_m[1] + n),
                           hn::LoadU(d, points.from_base_m[2] + n)};
        hn::StoreU(sum_of_octaves<kRidged, kDisplaced>(plan, local, point, threshold), d, out + n);
    }
}

}  // namespace

void sums_of_points(const VeilPlan& plan, const VeilPoints& points, float threshold, float* out) {
    if (plan.ridged) {
        (plan.displaced ? sums<true, true> : sums<true, false>)(plan, points, threshold, out);
    } else {
        (plan.displaced ? sums<false, true> : sums<false, false>)(plan, points, threshold, out);
    }
}

}  // namespace HWY_NAMESPACE
}  // namespace nephos
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace nephos {

HWY_EXPORT(sums_of_points);

void veil_sums(const VeilPlan& plan, const VeilPoints& points, float threshold, float* out) {
    HWY_DYNAMIC_DISPATCH(sums_of_points)(plan, points, threshold, out);
}

}  // namespace nephos
#endif
