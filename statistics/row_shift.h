// SPDX-License-Identifier: Apache-2.0
#pragma once

// Rows of bits moved along x (not installed).

#include <cstddef>
#include <cstdint>

namespace nephos {

// Writes a row that is moved by `cells` to `to`: bit i becomes bit i + cells; 0 flows in at one end, and what leaves the
// words at the other is lost. Bits beyond the last cell of the row may be 1 then.
inline void move_row(const std::uint64_t* row, std::size_t words, int cells, std::uint64_t* to) {
    const std::size_t way = std::size_t(cells < 0 ? -cells : cells), whole = way / 64;
    const unsigned bits = unsigned(way % 64);
    for (std::size_t n = 0; n < words; ++n) {
        if (cells >= 0) {
            const std::uint64_t high = n >= whole ? row[n - whole] : 0;
            const std::uint64_t low = n >= whole + 1 ? row[n - whole - 1] : 0;
            to[n] = bits == 0 ? high : high << bits | low >> (64 - bits);
        } else {
            const std::uint64_t low = n + whole < words ? row[n + whole] : 0;
            const std::uint64_t high = n + whole + 1 < words ? row[n + whole + 1] : 0;
            to[n] = bits == 0 ? low : low >> bits | high << (64 - bits);
        }
    }
}

}  // namespace nephos
