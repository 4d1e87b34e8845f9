// SPDX-License-Identifier: Apache-2.0
#include "scenes/format/text_file.h"

#include <cerrno>
#include <cstring>
#include <fstream>
#include <system_error>

#include "core/descriptor.h"
#include "core/error.h"

namespace nephos {

std::string read_text_file(const std::filesystem::path& path, std::size_t most_bytes) {
    std::error_code ignored;
    if (std::filesystem::is_directory(path, ignored)) {
        throw Error(ErrorCode::io, path.string() + ": is a folder, expected a scene in TOML");
    }
    if (is_named_pipe(path)) {
        throw Error(ErrorCode::io, path.string() + ": is a named pipe, expected a scene in TOML");
    }
    errno = 0;
    std::ifstream file(path, std::ios::binary);
    const auto failed = [&] {
        const std::string reason = errno != 0 ? std::strerror(errno) : "unknown error";
        return Error(ErrorCode::io, path.string() + ": cannot read the scene: " + reason);
    };
    if (!file) throw failed();
    std::string text(most_bytes + 1, '\0');
    file.read(text.data(), std::streamsize(text.size()));
    if (file.bad()) throw failed();
    text.resize(std::size_t(file.gcount()));
    return text;
}

}  // namespace nephos
