// SPDX-License-Identifier: Apache-2.0
#include "study/shard_files.h"

#include <algorithm>
#include <cerrno>
#include <sstream>
#include <string>
#include <string_view>
#include <system_error>

#include "study/folder_contents.h"
#include "study/record_lines.h"
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>

#include "core/descriptor.h"
#include "core/error.h"
#include "core/paths.h"

namespace nephos {
namespace {

// Returns whether a line of a file ends as records do: what is damaged in its beginning tells so what it was.
bool has_end_of_record(const std::filesystem::path& path) {
    constexpr std::size_t kMostBytes = std::size_t(1) << 20;
    std::istringstream lines(read_beginning(path, kMostBytes));
    for (std::string line; std::getline(lines, line);)
        if (ends_as_record(line)) return true;
    return false;
}

}  // namespace

bool is_name_of_shard(const std::filesystem::path& path) {
    const std::string name = path.stem().string();
    const std::size_t middle = name.find("-of-");
    const auto is_number = [](std::string_view text) {
        return text.size() >= 4 && text.find_first_not_of("0123456789") == text.npos;
    };
    return path.extension() == ".jsonl" && middle != name.npos &&
           is_number(std::string_view(name).substr(0, middle)) &&
           is_number(std::string_view(name).substr(middle + 4));
}

void require_own_records(const std::filesystem::path& path) {
    constexpr std::string_view kRecord = "{\"run\":\"";
    const std::string beginning = read_beginning(path, kRecord.size());
    if (kRecord.starts_with(beginning) || has_end_of_record(path)) return;
    require_own(path, kRecord, "a sweep");
}

std::vector<std::filesystem::path> files_of_shards(const std::filesystem::path& folder) {
    std::vector<std::filesystem::path> files;
    for (const std::string& name : names_in_folder(folder / "shards"))
        if (is_name_of_shard(name)) files.push_back(folder / "shards" / name);
    return files;
}

std::filesystem::path shard_path(const std::filesystem::path& folder, std::uint32_t number,
                                 std::uint32_t of) {
    return folder / "shards" / fmt::format("{:04}-of-{:04}.jsonl", number, of);
}

void lock_shard(const std::filesystem::path& path, int descriptor) {
    if (::flock(descriptor, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK)
        throw Error(ErrorCode::io, path.string() +
                                       ": another sweep is writing this shard: wait for its end, or choose "
                                       "another --out or --shard");
}

bool has_shards(const std::filesystem::path& folder) { return !files_of_shards(folder).empty(); }

void remove_shards(const std::filesystem::path& folder, std::uint32_t number, std::uint32_t of) {
    std::vector<std::filesystem::path> files = files_of_shards(folder);
    if (of > 1)
        std::erase_if(files, [&](const auto& path) { return path != shard_path(folder, number, of); });
    std::vector<Descriptor> locks;
    for (const std::filesystem::path& path : files) {
        locks.push_back(open_regular_file(path, O_RDWR | O_NOFOLLOW));
        lock_shard(path, locks.back().get());
        require_own_records(path);
    }
    for (const std::filesystem::path& path : files) {
        // Records last: series without them are nobody's.
        for (const std::filesystem::path& file :
             {std::filesystem::path(path).replace_extension(".series"), path}) {
            std::error_code error;
            std::filesystem::remove(file, error);
            if (error) throw Error(ErrorCode::io, file.string() + ": cannot remove: " + error.message());
        }
    }
}

}  // namespace nephos
