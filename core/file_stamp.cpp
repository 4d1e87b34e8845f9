// SPDX-License-Identifier: Apache-2.0
#include "core/file_stamp.h"

#include <sys/stat.h>

namespace nephos {
namespace {

std::int64_t nanoseconds(const timespec& time) {
    return std::int64_t(time.tv_sec) * 1'000'000'000 + time.tv_nsec;
}

}  // namespace

FileStamp file_stamp(const std::filesystem::path& path) noexcept {
    struct stat status = {};
    if (::stat(path.c_str(), &status) != 0) return {};
    return {status.st_dev, status.st_ino, std::uint64_t(status.st_size), nanoseconds(status.st_mtim),
            status.st_mtim.tv_nsec == 0 ? nanoseconds(status.st_ctim) : 0};
}

std::optional<std::filesystem::path> first_changed(const FileStamps& stamps) {
    for (const auto& [path, stamp] : stamps)
        if (file_stamp(path) != stamp) return path;
    return {};
}

}  // namespace nephos
