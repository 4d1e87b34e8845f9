// SPDX-License-Identifier: Apache-2.0
#include "density/statistics.h"

#include <algorithm>
#include <limits>
#include <vector>

#include "core/error.h"
#include "density/openvdb_access.h"

#ifndef HWY_DISABLED_TARGETS
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_SSE4)
#endif

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "density/statistics.cpp"
#include <hwy/foreach_target.h>
// foreach_target.h must come first
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace nephos {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

// Returns the number of 1 bits in `count` words: std::popcount is a table look-up where the compiler may not assume
// the instruction.
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

namespace {

HWY_EXPORT(count_bits_of);

std::uint64_t count_bits(const std::uint64_t* words, std::size_t count) {
    return HWY_DYNAMIC_DISPATCH(count_bits_of)(words, count);
}

std::uint64_t count_plane(const BitPlaneView& plane) { return count_bits(plane.words, plane.word_count()); }

}  // namespace

CloudStatistics cloud_statistics(const BitPlaneView& hum, const BitPlaneView& act, const BitPlaneView& cld,
                                 const Placement& placement) {
    const Extent extent = cld.extent;
    if (!(hum.extent == extent) || !(act.extent == extent)) {
        throw Error(ErrorCode::usage, "the planes of a state differ in extent");
    }
    CloudStatistics result;
    result.hum = count_plane(hum);
    result.act = count_plane(act);
    int lowest = -1, highest = -1;
    const std::size_t level_words = cld.words_per_row * std::size_t(extent.y);
    std::vector<std::uint64_t> columns(level_words, 0);
    for (int k = 0; k < extent.z; ++k) {
        const std::uint64_t* level = cld.row(0, k);
        const std::uint64_t bits = count_bits(level, level_words);
        if (bits == 0) continue;
        result.cld += bits;
        if (lowest < 0) lowest = k;
        highest = k;
        for (std::size_t n = 0; n < level_words; ++n) columns[n] |= level[n];
    }
    const double column_count = double(extent.x) * double(extent.y);
    result.cover = double(count_bits(columns.data(), level_words)) / column_count;
    const double nan = std::numeric_limits<double>::quiet_NaN();
    result.base_m = lowest < 0 ? nan : placement.origin_m.z + lowest * placement.cell_size_m;
    result.top_m = highest < 0 ? nan : placement.origin_m.z + (highest + 1) * placement.cell_size_m;
    result.mean_density = double(result.cld) / double(extent.cells());
    return result;
}

CloudStatistics cloud_statistics(const DensityGrid& density) {
    const Extent extent = density.extent();
    const Placement& placement = density.placement();
    CloudStatistics result;
    std::vector<bool> columns(std::size_t(extent.x) * std::size_t(extent.y));
    int lowest = extent.z, highest = -1;
    for (const Block& block : blocks_of(density)) {
        for (int n = 0; n < kBlockVoxels; ++n) {
            if (!(block.value(n) > 0)) continue;
            const openvdb::Coord& o = block.origin;
            const int x = o.x() + (n >> 6), y = o.y() + (n >> 3 & 7), z = o.z() + (n & 7);
            if (x >= extent.x || y >= extent.y || z >= extent.z) continue;  // a whole block beyond the box
            ++result.cld;
            columns[std::size_t(y) * std::size_t(extent.x) + std::size_t(x)] = true;
            lowest = std::min(lowest, z);
            highest = std::max(highest, z);
        }
    }
    const double size = placement.cell_size_m, nan = std::numeric_limits<double>::quiet_NaN();
    result.cover = double(std::ranges::count(columns, true)) / double(columns.size());
    result.base_m = highest < 0 ? nan : placement.origin_m.z + lowest * size;
    result.top_m = highest < 0 ? nan : placement.origin_m.z + (highest + 1) * size;
    result.mean_density = density.sum() / double(extent.cells());
    return result;
}

}  // namespace nephos
#endif
