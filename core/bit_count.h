// SPDX-License-Identifier: Apache-2.0
#pragma once

// Population count with SIMD (not installed): std::popcount is a table look-up where the compiler may not
// assume the instruction.

#include <cstddef>
#include <cstdint>

namespace nephos {

// Returns the number of 1 bits in `count` words. Thread-safe.
std::uint64_t count_bits(const std::uint64_t* words, std::size_t count);

}  // namespace nephos
