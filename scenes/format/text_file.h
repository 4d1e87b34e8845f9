// SPDX-License-Identifier: Apache-2.0
#pragma once

// Reading of text files of a user. Internal to scenes/.

#include <cstddef>
#include <filesystem>
#include <string>

namespace nephos {

// The first `most_bytes` + 1 bytes of a file, so that the caller sees when it is larger. Throws Error(io)
// naming the path when it is a folder or cannot be read.
std::string read_text_file(const std::filesystem::path& path, std::size_t most_bytes);

}  // namespace nephos
