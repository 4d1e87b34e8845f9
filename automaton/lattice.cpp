// SPDX-License-Identifier: Apache-2.0
#include "automaton/lattice.h"

#include <algorithm>
#include <bit>
#include <numeric>

#include "core/error.h"

namespace nephos {
namespace {

std::size_t words_of_row(Extent extent) { return (std::size_t(extent.x) + 63) / 64; }

std::size_t words_of_plane(Extent extent) {
    return words_of_row(extent) * std::size_t(extent.y) * std::size_t(extent.z);
}

void check_extent(Extent extent) {
    for (int n : {extent.x, extent.y, extent.z}) {
        if (n < 1 || n > kMaxExtent) {
            throw Error(ErrorCode::usage, "lattice extent " + std::to_string(extent.x) + " x " +
                                              std::to_string(extent.y) + " x " + std::to_string(extent.z) +
                                              " cells: each axis must be 1.." + std::to_string(kMaxExtent));
        }
    }
}

}  // namespace

BitPlane::BitPlane(Extent extent) : extent_(extent) {
    check_extent(extent);
    words_per_row_ = words_of_row(extent);
    word_count_ = words_of_plane(extent);
    lines_.resize((word_count_ + 7) / 8 + 2);
}

void BitPlane::set(int i, int j, int k, bool value) {
    std::uint64_t& word = row(j, k)[i / 64];
    const std::uint64_t bit = std::uint64_t{1} << (i % 64);
    word = value ? word | bit : word & ~bit;
}

void BitPlane::clear() { std::ranges::fill(words(), std::uint64_t{0}); }

std::uint64_t BitPlane::count() const {
    const auto all = words();
    return std::transform_reduce(all.begin(), all.end(), std::uint64_t{0}, std::plus<>{},
                                 [](std::uint64_t word) { return std::uint64_t(std::popcount(word)); });
}

bool BitPlane::operator==(const BitPlane& other) const {
    return extent_ == other.extent_ && std::ranges::equal(words(), other.words());
}

std::size_t BitPlane::bytes(Extent extent) { return ((words_of_plane(extent) + 7) / 8 + 2) * sizeof(Line); }

}  // namespace nephos
