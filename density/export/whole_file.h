// SPDX-License-Identifier: Apache-2.0
#pragma once

// A file read at once, and its parse with errors that name it (not installed).

#include <cstddef>
#include <filesystem>
#include <vector>

#include "core/bytes.h"
#include "core/error.h"

namespace nephos {

// Throws Error(io) naming the file.
std::vector<std::byte> whole_file(const std::filesystem::path& path);

// Calls `parse` with the file's bytes; its Error(io) then name the file.
template <class Parse>
auto with_whole_file(const std::filesystem::path& path, const Parse& parse) {
    const std::vector<std::byte> bytes = whole_file(path);
    ByteReader reader(bytes);
    try {
        return parse(reader);
    } catch (const Error& error) {
        throw Error(error.code(), path.string() + ": " + error.what());
    }
}

}  // namespace nephos
