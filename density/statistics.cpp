// SPDX-License-Identifier: Apache-2.0
#include "density/statistics.h"

#include <limits>
#include <vector>

#include "automaton/error.h"
#include "density/bit_count.h"

namespace nephos {
namespace {

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

}  // namespace nephos
