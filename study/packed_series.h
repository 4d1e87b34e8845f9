// SPDX-License-Identifier: Apache-2.0
#pragma once

// Series of a run in fewer bytes, without loss: of each value the difference to the one before, the upper bytes of all
// differences first, deflated. Neighbours in time are alike, so the upper bytes are nearly all 0. Private to study/.
//
// Most statistics are quotients of counts, n / cells, whose bits look random where n takes 10 of them. So a series may say
// how its values come from whole numbers, and these are stored; a series of which one value does not come out bit for
// bit is stored by the bits of its floats.
//
//     without scales   deflate(planes)
//     with scales      1, deflate(number of series, of each a byte 0 or a byte 1 with its SeriesScale, planes)

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "study/run_statistics.h"

namespace nephos {

// Deflate makes at most 1,032 bytes of one: no packed series holds more bytes than this times its own.
inline constexpr std::uint64_t kMostUnpacked = 1032;

// Returns whether a file may begin so that packed series begin.
bool begins_packed(std::string_view text);

// Packs series of one length, one after the other, as many as there are scales; without scales it is one. Preconditions: at
// most 64 scales, values in a multiple of their number, and `by` of a scale -1 or the place of one before it. Equal
// arguments give equal bytes with one version of zlib.
std::string pack_series(std::span<const float> values, std::span<const SeriesScale> scales = {});

// Returns the `count` values that were packed. Throws Error(io) when the text is not that of so many values.
std::vector<float> unpack_series(std::string_view packed, std::size_t count);

}  // namespace nephos
