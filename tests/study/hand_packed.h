// SPDX-License-Identifier: Apache-2.0
#pragma once

// Packed series with scales whose bytes are made by hand (study/packed_series.h).

#include <cstddef>
#include <cstdlib>
#include <span>
#include <string>

#include <zlib.h>

namespace nephos::test {

// Returns what a record holds of series with scales: the byte 1, and the bytes deflated.
inline std::string hand_packed(std::span<const std::byte> bytes) {
    uLongf size = compressBound(uLong(bytes.size()));
    std::string packed(1 + size, '\1');
    const int status =
        compress(static_cast<Bytef*>(static_cast<void*>(packed.data() + 1)), &size,
                 static_cast<const Bytef*>(static_cast<const void*>(bytes.data())), uLong(bytes.size()));
    if (status != Z_OK) std::abort();
    packed.resize(1 + size);
    return packed;
}

}  // namespace nephos::test
