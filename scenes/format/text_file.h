// SPDX-License-Identifier: Apache-2.0
#pragma once

// Reading of text files (not installed).

#include <cstddef>
#include <filesystem>
#include <string>

namespace nephos {

// Returns at most the first `most_bytes` + 1 bytes of a file, so that the caller can detect a larger one.
// Throws Error(io) naming the path when it is a folder or cannot be read.
std::string read_text_file(const std::filesystem::path& path, std::size_t most_bytes);

}  // namespace nephos
