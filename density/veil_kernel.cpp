// SPDX-License-Identifier: Apache-2.0
#include "density/veil_kernel.h"

#include <cmath>

// Compiled once for each SIMD target of Highway and dispatched at run time.
#if defined(__OPTIMIZE__) && !defined(HWY_DISABLED_TARGETS)  // with -O0 as all files (docs/determinism.md)
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
    std::uint32_t cell[3] = {};
    float within[3] = {}, per_m[3] = {};
    float turned[2][2] = {};  // VeilLattice::per_m
};

LocalOctave local_octave(const VeilOctavePlan& octave, const std::array<double, 3>& base_m) {
    LocalOctave local;
    const bool repeats = octave.lattice.wide > 0;
    std::int64_t cells[3];
    for (std::size_t axis = 0; axis < 3; ++axis) {
        double at = base_m[axis] * octave.per_m[axis];
        if (repeats && axis < 2) {
            const std::array<double, 2>& row = octave.lattice.per_m[axis];
            at = base_m[0] * row[0] + base_m[1] * row[1];
            for (std::size_t n = 0; n < 2; ++n) local.turned[axis][n] = float(row[n]);
        }
        at += octave.phase[axis];
        const double cell = std::floor(at);
        cells[axis] = std::int64_t(cell);
        local.within[axis] = float(at - cell);
        local.per_m[axis] = float(octave.per_m[axis]);
    }
    if (repeats) {
        const std::array<std::int64_t, 2> home = representative(octave.lattice, cells[0], cells[1]);
        cells[0] = home[0];
        cells[1] = home[1];
    }
    for (std::size_t axis = 0; axis < 3; ++axis) local.cell[axis] = std::uint32_t(cells[axis]);
    return local;
}

using Ints = hn::Vec<NoiseInts>;

// n modulo m, 0 .. m - 1, and the quotient, of which the estimate in floats may be off by one: |n / m| < 2^20.
struct Divided {
    Ints rest, quotient;
};

HWY_INLINE Divided divided(Ints n, std::int32_t m) {
    const NoiseFloats d;
    const NoiseInts di;
    const Ints whole = hn::Set(di, m), one = hn::Set(di, 1), zero = hn::Zero(di);
    Ints quotient = hn::ConvertTo(di, hn::Floor(hn::Mul(hn::ConvertTo(d, n), hn::Set(d, 1 / float(m)))));
    Ints rest = hn::Sub(n, hn::Mul(quotient, whole));
    const auto below = hn::Lt(rest, zero);
    rest = hn::IfThenElse(below, hn::Add(rest, whole), rest);
    quotient = hn::IfThenElse(below, hn::Sub(quotient, one), quotient);
    const auto above = hn::Gt(rest, hn::Sub(whole, one));
    return {hn::IfThenElse(above, hn::Sub(rest, whole), rest),
            hn::IfThenElse(above, hn::Add(quotient, one), quotient)};
}

// Returns the sum of both hashes of the representative of a lattice point.
HWY_INLINE Words hash_of_column(const VeilOctavePlan& octave, Ints i, Ints j) {
    const NoiseInts di;
    const NoiseWords dw;
    const VeilLattice& lattice = octave.lattice;
    const Divided row = divided(j, lattice.high);
    const Ints moved = hn::Sub(i, hn::Mul(row.quotient, hn::Set(di, lattice.shift)));
    const Words step = hn::Set(dw, kAxisStep);
    const auto hash = [&](Ints n, std::uint32_t seed) HWY_ATTR {
        return mixed(hn::Add(hn::Mul(hn::BitCast(dw, n), step), hn::Set(dw, seed)));
    };
    return hn::Add(hash(divided(moved, lattice.wide).rest, octave.seeds[0]), hash(row.rest, octave.seeds[1]));
}

// N of a point of a veil that repeats.
HWY_INLINE Floats repeating_noise(const VeilOctavePlan& octave, const LocalOctave& local, const Floats (&point)[3],
                                  const AxisPoint& z) {
    const NoiseFloats d;
    const NoiseInts di;
    AxisPoint axes[2];
    Ints low[2], high[2];
    for (std::size_t axis = 0; axis < 2; ++axis) {
        const Floats turned = hn::Add(hn::Mul(point[0], hn::Set(d, local.turned[axis][0])),
                                      hn::Mul(point[1], hn::Set(d, local.turned[axis][1])));
        const Floats at = hn::Add(turned, hn::Set(d, local.within[axis])), floor = hn::Floor(at);
        set_fraction(axes[axis], at, floor);
        low[axis] = hn::Add(hn::ConvertTo(di, floor), hn::Set(di, std::int32_t(local.cell[axis])));
        high[axis] = hn::Add(low[axis], hn::Set(di, 1));
    }
    const ColumnHashes columns{hash_of_column(octave, low[0], low[1]), hash_of_column(octave, high[0], low[1]),
                               hash_of_column(octave, low[0], high[1]), hash_of_column(octave, high[0], high[1])};
    return noise(columns, axes[0], axes[1], z);
}

// q of one vector of points.
template <bool kRidged, bool kDisplaced, bool kRepeats>
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
        Floats n;
        if constexpr (kRepeats) {
            n = repeating_noise(octave, local[k], point, axis_at(2));
        } else {
            n = noise(axis_at(0), axis_at(1), axis_at(2));
        }
        value = hn::Add(hn::Mul(n, hn::Set(d, octave.gain)), hn::Set(d, octave.offset));
        if (kRidged) {
            value = hn::Sub(hn::Set(d, octave.ridge), hn::Abs(hn::Sub(hn::Set(d, octave.crest), value)));
        }
        sum = hn::Add(sum, hn::Mul(value, hn::Set(d, octave.weight)));
        if (hn::AllTrue(d, hn::Lt(sum, hn::Set(d, threshold - octave.most_after)))) break;
    }
    return sum;
}

template <bool kRidged, bool kDisplaced, bool kRepeats>
void sums(const VeilPlan& plan, const VeilPoints& points, float threshold, float* out) {
    const NoiseFloats d;
    LocalOctave local[kMostVeilOctaves];
    for (std::size_t k = 0; k < plan.octaves.size(); ++k) {
        local[k] = local_octave(plan.octaves[k], points.base_m);
    }
    for (std::size_t n = 0; n < points.count; n += hn::Lanes(d)) {
        Floats point[3] = {hn::LoadU(d, points.from_base_m[0] + n), hn::LoadU(d, points.from_base_m[1] + n),
                           hn::LoadU(d, points.from_base_m[2] + n)};
        hn::StoreU(sum_of_octaves<kRidged, kDisplaced, kRepeats>(plan, local, point, threshold), d, out + n);
    }
}

template <bool kRepeats>
void sums_of_form(const VeilPlan& plan, const VeilPoints& points, float threshold, float* out) {
    if (plan.ridged) {
        (plan.displaced ? sums<true, true, kRepeats> : sums<true, false, kRepeats>)(plan, points, threshold, out);
    } else {
        (plan.displaced ? sums<false, true, kRepeats> : sums<false, false, kRepeats>)(plan, points, threshold, out);
    }
}

// N of one vector of points, by an octave of either kind.
HWY_INLINE Floats octave_value(const VeilPlan& plan, const VeilOctavePlan& octave, const LocalOctave& local,
                               const Floats (&point)[3]) {
    const NoiseFloats d;
    const auto axis_at = [&](std::size_t axis) HWY_ATTR {
        const Floats at =
            hn::Add(hn::Mul(point[axis], hn::Set(d, local.per_m[axis])), hn::Set(d, local.within[axis]));
        return axis_point<false>(at, local.cell[axis], octave.seeds[axis], 0);
    };
    const Floats n = plan.repeats ? repeating_noise(octave, local, point, axis_at(2))
                                  : noise(axis_at(0), axis_at(1), axis_at(2));
    const Floats value = hn::Add(hn::Mul(n, hn::Set(d, octave.gain)), hn::Set(d, octave.offset));
    if (!plan.ridged) return value;
    return hn::Sub(hn::Set(d, octave.ridge), hn::Abs(hn::Sub(hn::Set(d, octave.crest), value)));
}

// The fraction of an octave that points of these footprints resolve.
HWY_INLINE Floats resolved_part(const VeilOctavePlan& octave, Floats footprint_m) {
    const NoiseFloats d;
    const Floats one = hn::Set(d, 1.0f);
    const Floats t = hn::Sub(hn::Set(d, 1.5f), hn::Mul(footprint_m, hn::Set(d, 2 / octave.shortest_m)));
    const Floats inside = hn::Max(hn::Min(t, one), hn::Zero(d));
    return hn::Mul(hn::Mul(inside, inside), hn::Sub(hn::Set(d, 3.0f), hn::Add(inside, inside)));
}

}  // namespace

void resolved_sums(const VeilPlan& plan, const VeilPoints& points, const float* footprint_m, float* sum,
                   float* variance) {
    const NoiseFloats d;
    const Floats one = hn::Set(d, 1.0f), zero = hn::Zero(d);
    LocalOctave local[kMostVeilOctaves];
    for (std::size_t k = 0; k < plan.octaves.size(); ++k)
        local[k] = local_octave(plan.octaves[k], points.base_m);
    for (std::size_t n = 0; n < points.count; n += hn::Lanes(d)) {
        Floats point[3] = {hn::LoadU(d, points.from_base_m[0] + n), hn::LoadU(d, points.from_base_m[1] + n),
                           hn::LoadU(d, points.from_base_m[2] + n)};
        const Floats footprint = hn::LoadU(d, footprint_m + n);
        Floats total = zero, left_out = zero, value = zero;
        for (std::size_t k = 0; k < plan.octaves.size(); ++k) {
            const VeilOctavePlan& octave = plan.octaves[k];
            if (plan.displaced && k > 0) {
                for (std::size_t axis = 0; axis < 3; ++axis)
                    point[axis] =
                        hn::Add(point[axis], hn::Mul(value, hn::Set(d, octave.displacement_m[axis])));
            }
            const Floats part = resolved_part(octave, footprint), mean = hn::Set(d, octave.mean);
            value = mean;
            if (!hn::AllTrue(d, hn::Le(part, zero)))
                value =
                    hn::Add(mean, hn::Mul(part, hn::Sub(octave_value(plan, octave, local[k], point), mean)));
            total = hn::Add(total, hn::Mul(value, hn::Set(d, octave.weight)));
            const Floats lost = hn::Sub(one, hn::Mul(part, part));
            left_out =
                hn::Add(left_out, hn::Mul(lost, hn::Set(d, octave.weight * octave.weight * octave.variance)));
        }
        hn::StoreU(total, d, sum + n);
        hn::StoreU(left_out, d, variance + n);
    }
}

void sums_of_points(const VeilPlan& plan, const VeilPoints& points, float threshold, float* out) {
    (plan.repeats ? sums_of_form<true> : sums_of_form<false>)(plan, points, threshold, out);
}

}  // namespace HWY_NAMESPACE
}  // namespace nephos
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace nephos {

HWY_EXPORT(sums_of_points);
HWY_EXPORT(resolved_sums);

void veil_sums(const VeilPlan& plan, const VeilPoints& points, float threshold, float* out) {
    HWY_DYNAMIC_DISPATCH(sums_of_points)(plan, points, threshold, out);
}

void resolved_veil_sums(const VeilPlan& plan, const VeilPoints& points, const float* footprint_m, float* sum,
                        float* variance) {
    HWY_DYNAMIC_DISPATCH(resolved_sums)(plan, points, footprint_m, sum, variance);
}

}  // namespace nephos
#endif
