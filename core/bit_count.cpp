// SPDX-License-Identifier: Apache-2.0
#include "core/bit_count.h"

#ifndef HWY_DISABLED_TARGETS
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_SSE4)
#endif

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/bit_count.cpp"
#include <hwy/foreach_target.h>
//
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace nephos {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

std::uint64_t count_bits_of(const std::uint64_t* words, std::size_t count) {
    const hn::ScalableTag<std::uint64_t> d;
    const std::size_t lanes = hn::Lanes(d);
    auto sums = hn::Zero(d);
    std::size_t n = 0;
    for (; n + lanes <= count; n += lanes) sums = hn::Add(sums, hn::PopulationCount(hn::LoadU(d, words + n)));
    std::uint64_t total = hn::GetLane(hn::SumOfLanes(d, sums));
    for (; n < count; ++n) total += hwy::PopCount(words[n]);
    return total;
}

}  // namespace HWY_NAMESPACE
}  // namespace nephos
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace nephos {

HWY_EXPORT(count_bits_of);

std::uint64_t count_bits(const std::uint64_t* words, std::size_t count) {
    return HWY_DYNAMIC_DISPATCH(count_bits_of)(words, count);
}

}  // namespace nephos
#endif
