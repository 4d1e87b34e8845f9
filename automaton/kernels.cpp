// SPDX-License-Identifier: Apache-2.0
#include "automaton/kernels.h"

#include <algorithm>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "automaton/kernels.cpp"
#include <hwy/foreach_target.h>
// foreach_target.h must come first
#include <hwy/highway.h>

#include "automaton/births-inl.h"
#include "automaton/ellipsoid_row-inl.h"
#include "automaton/growth-inl.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {

void step_part_target(const StepPlanes& planes, const StepRandom& random, int bz, int by_begin, int by_end) {
    const int z0 = bz * kBlockEdge, z1 = std::min(z0 + kBlockEdge, planes.extent.z);
    const int y0 = by_begin * kBlockEdge, y1 = std::min(by_end * kBlockEdge, planes.extent.y);
    const bool quiet = !random.field->anything();
    // Past the caches only where nothing is read again in this step, rows are whole vectors, and planes are
    // large.
    constexpr std::size_t kLargePlane = std::size_t{1} << 18;  // words: 2 MiB
    const std::size_t words =
        planes.words_per_row * std::size_t(planes.extent.y) * std::size_t(planes.extent.z);
    const bool large = words >= kLargePlane;
    if (quiet && planes.words_per_row % kMaxLanes64 == 0 && large) {
        grow<true, true>(planes, z0, z1, y0, y1);
    } else if (large) {
        grow<false, true>(planes, z0, z1, y0, y1);
    } else {
        grow<false, false>(planes, z0, z1, y0, y1);
    }
    if (!quiet) draw_part(planes, random, bz, by_begin, by_end, draw_segment);
}

void bear_part_target(const StepPlanes& planes, const StepRandom& random, int bz, int by_begin, int by_end) {
    draw_part(planes, random, bz, by_begin, by_end, draw_segment);
}

const char* target_name() { return hwy::TargetName(HWY_TARGET); }

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace nephos {

HWY_EXPORT(step_part_target);
HWY_EXPORT(bear_part_target);
HWY_EXPORT(find_in_row_target);
HWY_EXPORT(target_name);

void step_part(const StepPlanes& planes, const StepRandom& random, int bz, int by_begin, int by_end) {
    HWY_DYNAMIC_DISPATCH(step_part_target)(planes, random, bz, by_begin, by_end);
}

void bear_part(const StepPlanes& planes, const StepRandom& random, int bz, int by_begin, int by_end) {
    HWY_DYNAMIC_DISPATCH(bear_part_target)(planes, random, bz, by_begin, by_end);
}

void find_in_row(const FieldEllipsoid& e, const BlockEllipsoid& seen, double dy, int bx,
                 EllipsoidInRow& out) {
    HWY_DYNAMIC_DISPATCH(find_in_row_target)(e, seen, dy, bx, out);
}

const char* kernel_target() { return HWY_DYNAMIC_DISPATCH(target_name)(); }

}  // namespace nephos
#endif
