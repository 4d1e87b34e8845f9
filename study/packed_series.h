// SPDX-License-Identifier: Apache-2.0
#pragma once

// Series of a run in fewer bytes, without loss: of each value the difference of its bits to those of the one before, the upper
// bytes of all values first, deflated. Neighbours in time are alike, so the upper bytes are nearly all 0. Private to study/.

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace nephos {

// Deflate makes at most 1,032 bytes of one: no packed series holds more bytes than this times its own.
inline constexpr std::uint64_t kMostUnpacked = 1032;

// Equal values give equal bytes with one version of zlib.
std::string pack_series(std::span<const float> values);

// Returns the `count` values that were packed. Throws Error(io) when the text is not that of so many values.
std::vector<float> unpack_series(std::string_view packed, std::size_t count);

}  // namespace nephos
