// SPDX-License-Identifier: Apache-2.0
#pragma once

// Tells whether a file was written, exchanged or removed between two looks at it, without reading it.

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>

namespace nephos {

// Two that are equal are of one file that nobody has written to in between; as fine as the clock of the file system, some
// milliseconds. All 0: there is no file that can be examined.
struct FileStamp {
    std::uint64_t device = 0, inode = 0, bytes = 0;
    std::int64_t written_ns = 0;  // mtime
    // ctime, which nobody can set, where mtime has no fraction of a second: archives and copies set that, one time for many
    // files. Otherwise 0, as a link more or other permissions make no other version.
    std::int64_t changed_ns = 0;
    bool operator==(const FileStamp&) const = default;
};

// Follows links. Thread-safe.
FileStamp file_stamp(const std::filesystem::path& path) noexcept;

using FileStamps = std::map<std::filesystem::path, FileStamp>;

// Returns the first of the files that has another stamp now. Thread-safe.
std::optional<std::filesystem::path> first_changed(const FileStamps& stamps);

}  // namespace nephos
