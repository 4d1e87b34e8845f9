// SPDX-License-Identifier: Apache-2.0
#include "study/folder_guard.h"

#include <cerrno>
#include <cstring>
#include <ctime>

#include "study/shard_files.h"
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include "core/descriptor.h"
#include "core/error.h"
#include "core/paths.h"

namespace nephos {

FolderGuard::FolderGuard(const std::filesystem::path& folder, const std::function<bool()>& stop)
    : folder_(folder) {
    const std::filesystem::path shards = folder / "shards";
    create_folders(shards);
    // A file that is open for writing: NFS locks no folders, and no others exclusively.
    file_ = open_regular_file(shards / "lock", O_RDWR | O_CREAT | O_NOFOLLOW).release();
    // Signals that are remembered for later do not end a wait for the lock: it is asked for again and again instead.
    constexpr timespec kPause{0, 20'000'000};
    while (::flock(file_, LOCK_EX | LOCK_NB) != 0) {
        // Where a file system has no locks, nothing is kept apart, as with those of shards.
        if (errno != EWOULDBLOCK && errno != EINTR) break;
        if (stop && stop()) return;
        ::nanosleep(&kPause, nullptr);
    }
    is_held_ = true;
}

FolderGuard::~FolderGuard() { ::close(file_); }

void FolderGuard::require_no_writer() const {
    for (const std::filesystem::path& path : files_of_shards(folder_)) {
        const Descriptor file = open_regular_file(path, O_RDONLY);
        if (::flock(file.get(), LOCK_SH | LOCK_NB) != 0 && errno == EWOULDBLOCK)
            throw Error(ErrorCode::io,
                        path.string() +
                            ": a sweep of another plan is writing into this folder: wait for its "
                            "end, or choose another --out");
    }
}

Descriptor identity_of_folder(const std::filesystem::path& folder) {
    Descriptor held(::open(folder.c_str(), O_PATH | O_DIRECTORY | O_CLOEXEC));
    if (held.get() < 0)
        throw Error(ErrorCode::io, folder.string() + ": cannot open the folder: " + std::strerror(errno));
    return held;
}

void require_in_place(const Descriptor& held, const std::filesystem::path& folder, std::string_view work) {
    if (is_same_file(held.get(), folder)) return;
    throw Error(ErrorCode::io, fmt::format("{}: was removed or replaced while {}", folder.string(), work));
}

}  // namespace nephos
