// SPDX-License-Identifier: Apache-2.0
#include "simulation/folder_lock.h"

#include <cerrno>
#include <cstring>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <sys/file.h>

#include "core/error.h"
#include "core/paths.h"

namespace nephos {

FolderLock::FolderLock(const std::filesystem::path& folder, std::string work)
    : path_(folder), work_(std::move(work)) {
    create_folders(folder);
    folder_.reset(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (folder_.get() < 0) {
        const int error = errno;
        throw Error(ErrorCode::io, folder.string() + ": cannot open the folder: " + std::strerror(error));
    }
    int result = 0;
    do {
        result = ::flock(folder_.get(), LOCK_EX | LOCK_NB);
    } while (result != 0 && errno == EINTR);
    if (result != 0 && errno == EWOULDBLOCK) {
        throw Error(ErrorCode::io,
                    folder.string() +
                        ": another run or export is writing into this folder: wait for its end, or "
                        "choose another --out");
    }
    held_ = result == 0;
}

bool FolderLock::in_place() const { return is_same_file(folder_.get(), path_); }

void FolderLock::require_in_place() const {
    if (in_place()) return;
    throw Error(ErrorCode::io, path_.string() + ": the folder was removed or renamed while the " + work_ +
                                   " was writing into it");
}

}  // namespace nephos
