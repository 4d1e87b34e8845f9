// SPDX-License-Identifier: Apache-2.0
#pragma once

// The head of an OpenEXR file as its bytes have it. The library's core goes over what it cannot read in a head and takes
// something else without a word, as ZIP for the compression: this tells what pixels are read by. Private to the module.

#include <array>
#include <cstdint>

namespace nephos {

// An open file.
struct ExrSource {
    int fd = -1;
    std::uint64_t size = 0;  // bytes
    int failure = 0;         // errno of a read; 0: none failed
};

// Reads up to `size` bytes from a place on, fewer at the end of the file. Returns how many, or -1 with source.failure.
std::int64_t read_exr_bytes(ExrSource& source, void* to, std::uint64_t size, std::uint64_t from);

// Throws std::runtime_error "cannot read: ..." with what the system says.
[[noreturn]] void throw_exr_failure(int failure);

// Holds what the first part says of its pixels.
struct ExrHead {
    bool is_multipart = false;
    std::uint8_t compression = 0;                                 // a number of the format, below 10
    std::array<std::int32_t, 4> data_window{}, display_window{};  // smallest x and y, largest x and y
    std::uint64_t table_at = 0;  // behind the heads of all parts: the places of chunks
};

// Throws std::runtime_error with what is wrong: no EXR, deep data, an attribute of these that lacks, stands twice or is of another
// type, a file that ends early; "cannot read: ..." where a read failed.
ExrHead read_exr_head(ExrSource& source);

}  // namespace nephos
