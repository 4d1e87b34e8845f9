// SPDX-License-Identifier: Apache-2.0
#include "automaton/plane_bytes.h"

#include <cstdint>
#include <cstring>

#include "core/error.h"

namespace nephos {

void require_clear_padding(std::span<const std::byte> planes, const Extent& extent) {
    if (extent.x % 64 == 0) return;
    const std::uint64_t padding = ~std::uint64_t{0} << (extent.x % 64);
    const std::size_t row = std::size_t((extent.x + 63) / 64) * sizeof(std::uint64_t);
    for (std::size_t end = row; end <= planes.size(); end += row) {
        std::uint64_t last = 0;
        std::memcpy(&last, planes.data() + end - sizeof last, sizeof last);
        if ((last & padding) != 0) throw Error(ErrorCode::io, "saved state has cells beyond its lattice");
    }
}

}  // namespace nephos
