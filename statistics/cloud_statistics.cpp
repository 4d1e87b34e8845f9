// SPDX-License-Identifier: Apache-2.0
#include "statistics/cloud_statistics.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/error.h"

// Processors with AVX-512 that count bits in vectors, three times as fast as by table look-ups.
#if defined(__OPTIMIZE__) && !defined(HWY_WANT_AVX3_DL)  // with -O0 as all files (docs/determinism.md)
#define HWY_WANT_AVX3_DL
#endif
#if defined(__OPTIMIZE__) && !defined(HWY_DISABLED_TARGETS)
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_SSE4)
#endif

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "statistics/cloud_statistics.cpp"
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

// Returns the number of bits that are 1 in a and 0 in b, and copies b to a.
std::uint64_t count_and_replace_of(std::uint64_t* a, const std::uint64_t* b, std::size_t count) {
    const hn::ScalableTag<std::uint64_t> d;
    const std::size_t lanes = hn::Lanes(d);
    auto sums = hn::Zero(d);
    std::size_t n = 0;
    for (; n + lanes <= count; n += lanes) {
        const auto now = hn::LoadU(d, b + n);
        sums = hn::Add(sums, hn::PopulationCount(hn::AndNot(now, hn::LoadU(d, a + n))));
        hn::StoreU(now, d, a + n);
    }
    std::uint64_t total = hn::GetLane(hn::SumOfLanes(d, sums));
    for (; n < count; ++n) {
        total += hwy::PopCount(a[n] & ~b[n]);
        a[n] = b[n];
    }
    return total;
}

// Adds a level to the columns seen so far, and returns the number of columns that it adds; kCells: adds the number of its
// cells to `cells`, too.
template <bool kCells>
std::uint64_t add_level(std::uint64_t* seen, const std::uint64_t* level, std::size_t count, std::uint64_t* cells) {
    const hn::ScalableTag<std::uint64_t> d;
    const std::size_t lanes = hn::Lanes(d);
    auto columns = hn::Zero(d), all = hn::Zero(d);
    std::size_t n = 0;
    for (; n + lanes <= count; n += lanes) {
        const auto before = hn::LoadU(d, seen + n), bits = hn::LoadU(d, level + n);
        columns = hn::Add(columns, hn::PopulationCount(hn::AndNot(before, bits)));
        if constexpr (kCells) all = hn::Add(all, hn::PopulationCount(bits));
        hn::StoreU(hn::Or(before, bits), d, seen + n);
    }
    std::uint64_t total = hn::GetLane(hn::SumOfLanes(d, columns));
    if constexpr (kCells) *cells += hn::GetLane(hn::SumOfLanes(d, all));
    for (; n < count; ++n) {
        total += hwy::PopCount(level[n] & ~seen[n]);
        if constexpr (kCells) *cells += hwy::PopCount(level[n]);
        seen[n] |= level[n];
    }
    return total;
}

std::uint64_t add_level_to(std::uint64_t* seen, const std::uint64_t* level, std::size_t count) {
    return add_level<false>(seen, level, count, nullptr);
}

std::uint64_t count_and_add_level_to(std::uint64_t* seen, const std::uint64_t* level, std::size_t count,
                                     std::uint64_t* cells) {
    return add_level<true>(seen, level, count, cells);
}

}  // namespace HWY_NAMESPACE
}  // namespace nephos
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace nephos {

namespace {

HWY_EXPORT(count_bits_of);
HWY_EXPORT(count_and_replace_of);
HWY_EXPORT(add_level_to);
HWY_EXPORT(count_and_add_level_to);

std::uint64_t count_bits(const std::uint64_t* words, std::size_t count) {
    return HWY_DYNAMIC_DISPATCH(count_bits_of)(words, count);
}

void require_one_extent(const BitPlaneView& a, const BitPlaneView& b) {
    if (!(a.extent == b.extent)) throw Error(ErrorCode::usage, "the planes of a state differ in extent");
}

// Sets `edges` to 1 where a column and its eastern neighbour differ.
void eastern_edges(const std::uint64_t* row, std::size_t words, int nx, bool periodic, std::uint64_t* edges) {
    for (std::size_t n = 0; n < words; ++n) {
        const std::uint64_t next = n + 1 < words ? row[n + 1] : 0;
        edges[n] = row[n] ^ (row[n] >> 1 | next << 63);
    }
    const std::uint64_t last = std::uint64_t(1) << ((nx - 1) % 64), bit = row[words - 1] & last;
    const bool wraps = periodic && (bit != 0) != ((row[0] & 1) != 0);
    edges[words - 1] = (edges[words - 1] & ~last) | (wraps ? last : 0);
}

std::uint64_t count_edges(const std::uint64_t* shadow, const BitPlaneView& plane,
                          const Boundaries& boundaries) {
    const std::size_t words = plane.words_per_row;
    const int ny = plane.extent.y;
    std::vector<std::uint64_t> edges(words * std::size_t(ny));
    for (int j = 0; j < ny; ++j) {
        const std::size_t at = std::size_t(j) * words;
        eastern_edges(shadow + at, words, plane.extent.x, boundaries.x == Boundary::periodic, &edges[at]);
    }
    std::uint64_t total = count_bits(edges.data(), edges.size());
    for (int j = 0; j < ny; ++j) {
        const bool last = j + 1 == ny;
        const std::uint64_t* row = shadow + std::size_t(j) * words;
        const std::uint64_t* north = last ? shadow : row + words;
        std::uint64_t* to = &edges[std::size_t(j) * words];
        const bool counted = !last || boundaries.y == Boundary::periodic;
        for (std::size_t n = 0; n < words; ++n) to[n] = counted ? row[n] ^ north[n] : 0;
    }
    return total + count_bits(edges.data(), edges.size());
}

double face_m(CloudLimit limit, std::size_t level, const Placement& placement) {
    return placement.origin_m.z + double(level + (limit == CloudLimit::top ? 1 : 0)) * placement.cell_size_m;
}

}  // namespace

std::uint64_t count_cells(const BitPlaneView& plane) { return count_bits(plane.words, plane.word_count()); }

std::uint64_t count_deaths_and_replace(BitPlane& before, const BitPlaneView& after) {
    require_one_extent(before.view(), after);
    const std::span<std::uint64_t> words = before.words();
    return HWY_DYNAMIC_DISPATCH(count_and_replace_of)(words.data(), after.words, words.size());
}

CloudCounts count_cloud(const BitPlaneView& cld, const Boundaries& boundaries) {
    CloudCounts counts;
    const std::size_t levels = std::size_t(cld.extent.z);
    const std::size_t level_words = cld.words_per_row * std::size_t(cld.extent.y);
    counts.extent = cld.extent;
    counts.level_cells.resize(levels);
    counts.bases.resize(levels);
    counts.tops.resize(levels);
    std::vector<std::uint64_t> seen(level_words);
    for (std::size_t k = levels; k-- > 0;) {
        counts.tops[k] = HWY_DYNAMIC_DISPATCH(count_and_add_level_to)(seen.data(), cld.words + k * level_words,
                                                                      level_words, &counts.level_cells[k]);
        counts.cells += counts.level_cells[k];
        counts.columns += counts.tops[k];
    }
    if (counts.columns == 0) return counts;
    counts.edges = count_edges(seen.data(), cld, boundaries);
    std::ranges::fill(seen, 0);
    // Up to where all columns have their base: above flat bases there is nothing left to find.
    std::uint64_t left = counts.columns;
    for (std::size_t k = 0; left > 0; ++k) {
        if (counts.level_cells[k] == 0) continue;
        counts.bases[k] =
            HWY_DYNAMIC_DISPATCH(add_level_to)(seen.data(), cld.words + k * level_words, level_words);
        left -= counts.bases[k];
    }
    return counts;
}

BitPlane shadow_of(const BitPlaneView& cld) {
    BitPlane shadow({cld.extent.x, cld.extent.y, 1});
    const std::size_t level_words = cld.words_per_row * std::size_t(cld.extent.y);
    const std::span<std::uint64_t> to = shadow.words();
    for (std::size_t k = 0; k < std::size_t(cld.extent.z); ++k) {
        const std::uint64_t* level = cld.words + k * level_words;
        for (std::size_t n = 0; n < level_words; ++n) to[n] |= level[n];
    }
    return shadow;
}

double mean_height_m(const CloudCounts& counts, CloudLimit limit, const Placement& placement) {
    const std::vector<std::uint64_t>& levels = limit == CloudLimit::base ? counts.bases : counts.tops;
    std::uint64_t columns = 0, sum = 0;
    for (std::size_t k = 0; k < levels.size(); ++k) {
        columns += levels[k];
        sum += levels[k] * std::uint64_t(k);
    }
    if (columns == 0) return std::numeric_limits<double>::quiet_NaN();
    return face_m(limit, 0, placement) + double(sum) / double(columns) * placement.cell_size_m;
}

double height_quantile_m(const CloudCounts& counts, CloudLimit limit, double q, const Placement& placement) {
    const std::vector<std::uint64_t>& levels = limit == CloudLimit::base ? counts.bases : counts.tops;
    std::uint64_t columns = 0, below = 0;
    for (const std::uint64_t count : levels) columns += count;
    for (std::size_t k = 0; k < levels.size(); ++k) {
        below += levels[k];
        if (below > 0 && double(below) >= q * double(columns)) return face_m(limit, k, placement);
    }
    return std::numeric_limits<double>::quiet_NaN();
}

CloudStatistics cloud_statistics(const CloudCounts& counts, const Placement& placement) {
    CloudStatistics result;
    result.cld = counts.cells;
    result.cover = double(counts.columns) / (double(counts.extent.x) * double(counts.extent.y));
    result.base_m = height_quantile_m(counts, CloudLimit::base, 0, placement);
    result.top_m = height_quantile_m(counts, CloudLimit::top, 1, placement);
    result.base_mean_m = mean_height_m(counts, CloudLimit::base, placement);
    result.top_mean_m = mean_height_m(counts, CloudLimit::top, placement);
    result.perimeter_m = double(counts.edges) * placement.cell_size_m;
    result.mean_density = double(counts.cells) / double(counts.extent.cells());
    return result;
}

CloudStatistics cloud_statistics(const BitPlaneView& hum, const BitPlaneView& act, const BitPlaneView& cld,
                                 const Placement& placement, const Boundaries& boundaries) {
    require_one_extent(hum, cld);
    require_one_extent(act, cld);
    CloudStatistics result = cloud_statistics(count_cloud(cld, boundaries), placement);
    result.hum = count_cells(hum);
    result.act = count_cells(act);
    return result;
}

}  // namespace nephos
#endif
