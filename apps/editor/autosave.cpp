// SPDX-License-Identifier: Apache-2.0
#include "apps/editor/autosave.h"

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <span>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/atomic_file.h"
#include "core/error.h"
#include "core/paths.h"
#include "scenes/format/reader.h"
#include "scenes/format/text.h"

namespace nephos {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kEnd = ".autosave";

[[noreturn]] void fail(const fs::path& path, const std::string& what, int error) {
    throw Error(ErrorCode::io, path.string() + ": " + what + ": " + std::strerror(error));
}

// Returns 0, EWOULDBLOCK when another has it, or why locks are not to be had here. NFS gives exclusive locks to files that
// are open for writing alone, and shared ones to the others.
int lock(int file, int kind = LOCK_EX) {
    int result;
    do result = ::flock(file, kind | LOCK_NB);
    while (result != 0 && errno == EINTR);
    return result == 0 ? 0 : errno;
}

// Returns the file with its lock. On a file system without locks the file alone: nothing says that another has it.
Descriptor locked(const LeftAutosave& left) {
    Descriptor file(::open(left.path.c_str(), O_RDWR | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
    if (file.get() < 0) fail(left.path, "cannot be opened", errno);
    struct stat status {};
    const bool is_found =
        ::fstat(file.get(), &status) == 0 && status.st_dev == left.device && status.st_ino == left.inode;
    if (!is_found || lock(file.get()) == EWOULDBLOCK || !is_same_file(file.get(), left.path))
        throw Error(ErrorCode::io, left.path.string() + ": another editor has it now");
    return file;
}

fs::path numbered(const fs::path& folder, const std::string& name, int attempt) {
    std::string middle;
    if (attempt > 0) middle = "." + std::to_string(::getpid());
    if (attempt > 1) middle += "-" + std::to_string(attempt);
    return folder / ("." + name + middle + std::string(kEnd));
}

// Takes `what` and the digits behind it from the front of a text. Returns whether there were any.
bool take_number(std::string_view& text, char what) {
    if (text.empty() || text.front() != what) return false;
    const std::size_t end = std::min(text.find_first_not_of("0123456789", 1), text.size());
    if (end < 2) return false;
    text.remove_prefix(end);
    return true;
}

// Returns the scene that a file of one of the names of numbered() belongs to: `name`, or a copy of it, "{NAME}-2.toml".
// Empty: it belongs to neither.
std::string scene_of(std::string_view file, const fs::path& name) {
    const std::string begin = "." + name.stem().string(), extension = name.extension().string();
    if (!file.starts_with(begin) || !file.ends_with(kEnd)) return {};
    file.remove_suffix(kEnd.size());
    std::string_view rest = file.substr(begin.size());
    while (take_number(rest, '-')) {  // a copy of a copy
    }
    if (!rest.starts_with(extension)) return {};
    rest.remove_prefix(extension.size());
    const std::string_view scene = file.substr(1, file.size() - rest.size() - 1);
    if (take_number(rest, '.')) take_number(rest, '-');
    return rest.empty() ? std::string(scene) : std::string();
}

}  // namespace

bool AutosaveFile::is_in_place() const {
    try {
        return is_open() && is_same_file(file_.get(), path_);
    } catch (const Error&) {
        return false;  // another one is begun
    }
}

void AutosaveFile::claim(const fs::path& folder, const std::string& name) {
    constexpr int kAttempts = 1000;
    for (int attempt = 0; attempt < kAttempts; ++attempt) {
        const fs::path path = numbered(folder, name, attempt);
        // Readable by this user alone, as the scene may be private.
        Descriptor file(::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0600));
        if (file.get() < 0 && errno == EEXIST) continue;
        if (file.get() < 0) fail(path, "cannot be written", errno);
        lock(file.get());
        file_ = std::move(file);
        path_ = path;
        return;
    }
    throw Error(ErrorCode::io, numbered(folder, name, 0).string() + ": there are too many of them");
}

void AutosaveFile::write(const fs::path& folder, const std::string& name, std::string_view text) {
    const bool is_new = !is_in_place();
    if (is_new) claim(folder, name);
    try {
        AtomicFile next(path_, Access::owner);
        Descriptor file(::open(next.temporary().c_str(), O_WRONLY | O_NOFOLLOW | O_CLOEXEC));
        if (file.get() < 0) fail(path_, "cannot be written", errno);
        lock(file.get());  // before it gets the name: nobody sees it without
        if (const int failed = write_all(file.get(), std::as_bytes(std::span(text))))
            fail(path_, "cannot be written", failed);
        next.publish();
        file_ = std::move(file);
    } catch (const Error&) {
        if (is_new) remove();  // it is empty
        throw;
    }
}

void AutosaveFile::adopt(const LeftAutosave& left) {
    Descriptor file = locked(left);
    remove();
    file_ = std::move(file);
    path_ = left.path;
}

void AutosaveFile::remove() {
    if (is_in_place()) ::unlink(path_.c_str());
    file_ = Descriptor();
    path_.clear();
}

std::vector<LeftAutosave> left_autosaves(const fs::path& folder, const std::string& name) {
    std::vector<LeftAutosave> out;
    std::error_code error;
    for (auto at = fs::directory_iterator(folder, error); !error && at != fs::directory_iterator();
         at.increment(error)) {
        std::error_code ignored;
        const std::string scene = scene_of(at->path().filename().string(), name);
        if (scene.empty() || at->is_symlink(ignored) || !at->is_regular_file(ignored)) continue;
        if (scene != name && fs::exists(folder / scene, ignored)) continue;  // it is asked about with that
        LeftAutosave left{at->path(), at->last_write_time(ignored), {}, {}, scene};
        const Descriptor file(::open(left.path.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
        if (file.get() < 0 && errno == ENOENT) continue;
        if (file.get() >= 0 && lock(file.get(), LOCK_SH) == EWOULDBLOCK) continue;
        if (struct stat status{}; file.get() >= 0 && ::fstat(file.get(), &status) == 0) {
            left.device = status.st_dev;
            left.inode = status.st_ino;
        }
        try {
            left.text = read_text_file(left.path, kMaxSceneBytes);
            if (left.text.size() > kMaxSceneBytes)
                left.problem = left.path.string() + ": too large for a scene";
        } catch (const Error& problem) {
            left.problem = problem.what();
        }
        if (left.text.empty() && left.problem.empty()) continue;
        out.push_back(std::move(left));
    }
    std::ranges::sort(out, [](const LeftAutosave& a, const LeftAutosave& b) {
        return a.time != b.time ? a.time > b.time : a.path < b.path;
    });
    return out;
}

std::string scene_of_autosave(const fs::path& file) {
    constexpr std::string_view kScene = ".toml";
    const std::string name = file.filename().string();
    const std::size_t at = name.rfind(kScene);
    if (!name.starts_with('.') || at == std::string::npos || at < 2 || !name.ends_with(kEnd)) return {};
    const std::string scene = name.substr(1, at + kScene.size() - 1);
    return scene_of(name, scene) == scene ? scene : std::string();
}

void delete_autosave(const LeftAutosave& left) {
    const Descriptor file = locked(left);
    if (::unlink(left.path.c_str()) != 0) fail(left.path, "cannot be removed", errno);
}

fs::path keep_autosave(const LeftAutosave& left, const fs::path& name) {
    const Descriptor file = locked(left);
    for (int number = 1;; ++number) {
        const std::string end = number == 1 ? "-recovered" : "-recovered-" + std::to_string(number);
        const fs::path kept =
            left.path.parent_path() / (name.stem().string() + end + name.extension().string());
        if (::renameat2(AT_FDCWD, left.path.c_str(), AT_FDCWD, kept.c_str(), RENAME_NOREPLACE) == 0)
            return kept;
        if (errno == EEXIST) continue;
        // A file system that cannot: a second name is refused, too, when there is one.
        if (errno != EINVAL && errno != ENOSYS) fail(kept, "cannot be written", errno);
        if (::link(left.path.c_str(), kept.c_str()) == 0) {
            ::unlink(left.path.c_str());
            return kept;
        }
        if (errno != EEXIST) fail(kept, "cannot be written", errno);
    }
}

}  // namespace nephos
