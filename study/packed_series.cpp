// SPDX-License-Identifier: Apache-2.0
#include "study/packed_series.h"

#include <bit>
#include <new>

#include <zlib.h>

#include "core/error.h"

namespace nephos {
namespace {

// Small differences of either sign become small numbers: 0, -1, 1, -2, ...
std::uint32_t zigzag(std::uint32_t difference) { return difference << 1 ^ (0 - (difference >> 31)); }
std::uint32_t from_zigzag(std::uint32_t number) { return number >> 1 ^ (0 - (number & 1)); }

}  // namespace

std::string pack_series(std::span<const float> values) {
    const std::size_t count = values.size();
    std::string planes(4 * count, '\0');
    std::uint32_t before = 0;
    for (std::size_t n = 0; n < count; ++n) {
        const auto bits = std::bit_cast<std::uint32_t>(values[n]);
        const std::uint32_t number = zigzag(bits - before);
        before = bits;
        for (std::size_t byte = 0; byte < 4; ++byte)
            planes[byte * count + n] = char(number >> (24 - 8 * byte) & 0xff);
    }
    uLongf size = compressBound(uLong(planes.size()));
    std::string packed(size, '\0');
    const int status = compress2(static_cast<Bytef*>(static_cast<void*>(packed.data())), &size,
                                 static_cast<const Bytef*>(static_cast<const void*>(planes.data())),
                                 uLong(planes.size()), Z_BEST_COMPRESSION);
    if (status != Z_OK) throw std::bad_alloc();  // with room enough nothing else can go wrong
    packed.resize(size);
    return packed;
}

std::vector<float> unpack_series(std::string_view packed, std::size_t count) {
    if (4 * count > kMostUnpacked * packed.size() + 64)
        throw Error(ErrorCode::io, "packed series are shorter than their number of values allows");
    std::string planes(4 * count, '\0');
    uLongf size = uLongf(planes.size());
    const int status =
        uncompress(static_cast<Bytef*>(static_cast<void*>(planes.data())), &size,
                   static_cast<const Bytef*>(static_cast<const void*>(packed.data())), uLong(packed.size()));
    if (status == Z_MEM_ERROR) throw std::bad_alloc();
    if (status != Z_OK || size != planes.size()) throw Error(ErrorCode::io, "packed series are damaged");
    std::vector<float> values(count);
    std::uint32_t before = 0;
    for (std::size_t n = 0; n < count; ++n) {
        std::uint32_t number = 0;
        for (std::size_t byte = 0; byte < 4; ++byte)
            number = number << 8 | std::uint8_t(planes[byte * count + n]);
        before += from_zigzag(number);
        values[n] = std::bit_cast<float>(before);
    }
    return values;
}

}  // namespace nephos
