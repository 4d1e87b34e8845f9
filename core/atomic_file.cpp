// SPDX-License-Identifier: Apache-2.0
#include "core/atomic_file.h"

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <random>
#include <string>
#include <system_error>
#include <vector>

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/xattr.h>
#include <unistd.h>

#include "core/descriptor.h"
#include "core/error.h"
#include "core/paths.h"

namespace nephos {
namespace {

[[noreturn]] void fail(const std::filesystem::path& path, const std::string& what, int error) {
    throw Error(ErrorCode::io, path.string() + ": " + what + ": " + std::strerror(error));
}

// Returns false for a link of another user but root: in a folder that others may write to, it waits there to have a file
// of ours replaced.
bool is_trusted_link(const std::filesystem::path& link) {
    struct stat status {};
    return ::lstat(link.c_str(), &status) == 0 && (status.st_uid == ::geteuid() || status.st_uid == 0);
}

// Gives a new file the access control list of the one that it replaces, or takes away that of its folder's default.
// Returns false where that was not possible.
bool take_access_list(int folder, const std::string& name, int to) {
    constexpr const char* kAttribute = "system.posix_acl_access";
    const Descriptor old(::openat(folder, name.c_str(), O_RDONLY | O_NONBLOCK | O_NOFOLLOW | O_CLOEXEC));
    // One that may not be read has a list all the same, by its path in a folder that is open.
    const std::string path = "/proc/self/fd/" + std::to_string(folder) + "/" + name;
    std::vector<char> list(1024);
    const auto read = [&] {
        return old.get() >= 0 ? ::fgetxattr(old.get(), kAttribute, list.data(), list.size())
                              : ::getxattr(path.c_str(), kAttribute, list.data(), list.size());
    };
    ssize_t size = 0;
    while ((size = read()) < 0 && errno == ERANGE) list.resize(2 * list.size());
    const auto is_none = [] { return errno == ENODATA || errno == ENOTSUP; };
    if (size >= 0) return ::fsetxattr(to, kAttribute, list.data(), std::size_t(size), 0) == 0;
    return is_none() && (::fremovexattr(to, kAttribute) == 0 || is_none());
}

constexpr int kMostLinks = 40;  // as Linux

// Resolves symbolic links, so that the file that one points to is replaced and not the link. Refuses devices
// and pipes, which a rename would replace by a plain file.
std::filesystem::path target_of(const std::filesystem::path& path) {
    std::error_code error;
    const auto kind = std::filesystem::status(path, error).type();
    if (kind == std::filesystem::file_type::directory) fail(path, "cannot be written", EISDIR);
    if (kind == std::filesystem::file_type::none && error != std::errc::too_many_symbolic_link_levels)
        fail(path, "cannot be examined", error.value());
    if (kind != std::filesystem::file_type::regular && kind != std::filesystem::file_type::not_found &&
        kind != std::filesystem::file_type::none) {
        throw Error(ErrorCode::io, path.string() + ": is not a regular file");
    }
    std::filesystem::path target = path;
    for (int links = 0; type_at(target) == std::filesystem::file_type::symlink; ++links) {
        if (links == kMostLinks) fail(path, "cannot follow the link", ELOOP);
        if (!is_trusted_link(target)) {
            const std::string link = links == 0 ? "" : "leads to " + target.string() + ", which ";
            throw Error(ErrorCode::io,
                        path.string() + ": " + link + "is a link of another user, which is not followed");
        }
        const std::filesystem::path next = std::filesystem::read_symlink(target, error);
        if (error) fail(path, "cannot follow the link", error.value());
        target = target.parent_path() / next;  // `next` alone where it is absolute
    }
    return target;
}

constexpr std::string_view kPart = ".part";
constexpr mode_t kPermissions = 0777;  // no set-user-ID and the like

// ".STEM.partNUMBERS.EXTENSION"; the extension last, because some writers choose the format by it.
std::string temporary_name(const std::filesystem::path& path, const std::string& numbers) {
    return "." + path.stem().string() + std::string(kPart) + numbers + path.extension().string();
}

bool all_digits(std::string_view text) {
    return !text.empty() &&
           std::all_of(text.begin(), text.end(), [](char c) { return c >= '0' && c <= '9'; });
}

// Pieces of a file, gathered so that a call of the system writes a good many of them.
class PieceWriter {
  public:
    explicit PieceWriter(int fd) : fd_(fd) {}
    // Returns 0 or errno.
    int append(std::string_view piece) {
        constexpr std::size_t kGathered = std::size_t(1) << 16;
        if (gathered_.size() + piece.size() <= kGathered) {
            gathered_ += piece;
            return 0;
        }
        if (const int failed = flush()) return failed;
        if (piece.size() <= kGathered) return append(piece);
        return write_all(fd_, std::as_bytes(std::span(piece)));
    }
    int flush() {
        const int failed = write_all(fd_, std::as_bytes(std::span(gathered_)));
        gathered_.clear();
        return failed;
    }

  private:
    int fd_;
    std::string gathered_;
};

}  // namespace

namespace {

thread_local const std::function<void()>* publish_check = nullptr;

void check_before_publishing() {
    if (publish_check != nullptr && *publish_check) (*publish_check)();
}

}  // namespace

PublishCheck::PublishCheck(const std::function<void()>& check) : before_(publish_check) {
    publish_check = &check;
}
PublishCheck::~PublishCheck() { publish_check = before_; }

void require_file_name(const std::filesystem::path& path) {
    const std::filesystem::path name = path.filename();
    if (name.empty() || name == "." || name == "..")
        throw Error(ErrorCode::usage, path.string() + ": is the name of a folder: expected that of a file");
}

AtomicFile::AtomicFile(const std::filesystem::path& given, Access access, Folders folders)
    : path_(target_of(given)), name_(path_.filename().string()) {
    require_file_name(path_);
    const std::filesystem::path folder = path_.has_parent_path() ? path_.parent_path() : ".";
    check_before_publishing();
    if (folders == Folders::made) create_folders(folder);
    open_folder(folder);
    try {
        check_before_publishing();  // of the folder that is open now
        create_temporary(folder, access);
    } catch (...) {
        ::close(folder_);
        throw;
    }
}

// For its names alone where it may not be listed.
void AtomicFile::open_folder(const std::filesystem::path& folder) {
    constexpr int kFlags = O_DIRECTORY | O_CLOEXEC;
    folder_ = ::open(folder.c_str(), O_RDONLY | kFlags);
    if (folder_ < 0 && errno == EACCES) folder_ = ::open(folder.c_str(), O_PATH | kFlags);
    if (folder_ < 0) fail(path_, "cannot create", errno);
}

// Takes over owner, group, permissions and access control list of the file that is replaced, before there is content
// that others might read. What another user put there says nothing, but for root in a folder that nobody else may write
// to. Throws Error(io) where the new file would be open to more.
void AtomicFile::take_permissions(int fd) {
    struct stat before {
    }, parent{}, now{};
    if (::fstatat(folder_, name_.c_str(), &before, 0) != 0) {
        if (errno == ENOENT || errno == ELOOP) return;
        fail(path_, "cannot examine the file that is replaced", errno);
    }
    if (!S_ISREG(before.st_mode)) return;
    if (before.st_uid != ::geteuid()) {
        constexpr mode_t kOthersWrite = S_IWGRP | S_IWOTH;
        const bool is_sound =
            ::geteuid() == 0 && ::fstat(folder_, &parent) == 0 && (parent.st_mode & kOthersWrite) == 0;
        if (!is_sound || ::fchown(fd, before.st_uid, gid_t(-1)) != 0) return;
    }
    mode_t permissions = before.st_mode & kPermissions;
    // Rights of a group are of that group alone.
    if (::fchown(fd, uid_t(-1), before.st_gid) != 0) permissions &= ~mode_t(S_IRWXG);
    // With a list, the bits of the group are the most that it gives; without its own, they may not be given.
    if (!take_access_list(folder_, name_, fd)) permissions &= ~mode_t(S_IRWXG);
    const mode_t kept = permissions | S_IRUSR | S_IWUSR;  // until it is complete
    if (::fchmod(fd, kept) == 0) {
        permissions_ = permissions;
    } else if (::fstat(fd, &now) != 0 || (now.st_mode & kPermissions & ~kept) != 0) {
        throw Error(ErrorCode::io, path_.string() + ": cannot be replaced by a file that is as private");
    }
}

// A name of this process' number and 64 random bits, and O_EXCL: in a folder that others may write to, a file or link
// that waits under that name is never opened.
void AtomicFile::create_temporary(const std::filesystem::path& folder, Access access) {
    constexpr int kAttempts = 100;
    const mode_t mode = access == Access::owner ? 0600 : 0666;
    std::random_device random;
    for (int attempt = 1;; ++attempt) {
        const std::uint64_t number = std::uint64_t{random()} << 32 | random();
        temporary_name_ = temporary_name(path_, std::to_string(::getpid()) + "-" + std::to_string(number));
        temporary_ = folder / temporary_name_;
        const Descriptor descriptor(::openat(folder_, temporary_name_.c_str(),
                                             O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, mode));
        if (descriptor.get() < 0 && errno == EEXIST && attempt < kAttempts) continue;
        struct stat status {};
        if (descriptor.get() < 0) fail(path_, "cannot create", errno);
        if (::fstat(descriptor.get(), &status) != 0) {
            const int error = errno;
            remove();
            fail(path_, "cannot examine its temporary file", error);
        }
        device_ = status.st_dev;
        inode_ = status.st_ino;
        try {
            if (access == Access::shared) take_permissions(descriptor.get());
        } catch (const Error&) {
            remove();
            throw;
        }
        return;
    }
}

AtomicFile::~AtomicFile() {
    struct stat status {};
    if (!published_ && ::fstatat(folder_, temporary_name_.c_str(), &status, AT_SYMLINK_NOFOLLOW) == 0 &&
        is_created_file(status))
        remove();
    ::close(folder_);
}

void AtomicFile::remove() const { ::unlinkat(folder_, temporary_name_.c_str(), 0); }

// Returns true for the file that the constructor created.
bool AtomicFile::is_created_file(const struct stat& status) const {
    return status.st_dev == device_ && status.st_ino == inode_ && S_ISREG(status.st_mode);
}

// Returns a descriptor of the temporary file, or -1.
int AtomicFile::open_again() const {
    return ::openat(folder_, temporary_name_.c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC);
}

void AtomicFile::publish() {
    prepare();
    if (::renameat(folder_, temporary_name_.c_str(), folder_, name_.c_str()) != 0)
        fail(path_, "cannot rename into place", errno);
    published_ = true;
    flush_folder();
}

bool AtomicFile::publish_where_free() {
    prepare();
    const int error = rename_where_free(folder_, temporary_name_, folder_, name_);
    if (error == EEXIST) return false;
    if (error != 0) fail(path_, "cannot rename into place", error);
    published_ = true;
    flush_folder();
    return true;
}

// Makes sure that the temporary file is the one that was made, flushes it, gives it its permissions and asks PublishCheck.
void AtomicFile::prepare() const {
    struct stat status {};
    // By its path, as its writer found it: in another folder of that name there would be its content.
    if (::lstat(temporary_.c_str(), &status) != 0) fail(path_, "its temporary file is gone", errno);
    const auto refuse_other = [&] {
        if (!is_created_file(status))
            throw Error(ErrorCode::io,
                        path_.string() + ": another file was put in the place of its temporary one");
    };
    refuse_other();
    const Descriptor file(open_again());
    if (file.get() < 0) fail(path_, "cannot open after writing", errno);
    if (::fstat(file.get(), &status) != 0) fail(path_, "cannot examine its temporary file", errno);
    refuse_other();
    const int error = flush_to_device(file.get());
    if (error != 0 && error != EINVAL) fail(path_, "cannot flush to the device", error);
    if (permissions_ && *permissions_ != (status.st_mode & kPermissions) &&
        ::fchmod(file.get(), *permissions_) != 0)
        fail(path_, "cannot set its permissions", errno);
    check_before_publishing();
}

void AtomicFile::flush_folder() const {
    const int unflushed = flush_to_device(folder_);
    if (unflushed != 0 && unflushed != EINVAL && unflushed != EBADF)  // which may not be listed
        fail(path_, "cannot flush its folder to the device", unflushed);
}

int rename_where_free(int from_folder, const std::string& from, int to_folder, const std::string& to) {
    if (::renameat2(from_folder, from.c_str(), to_folder, to.c_str(), RENAME_NOREPLACE) == 0) return 0;
    if (errno != EINVAL && errno != ENOSYS && errno != EOPNOTSUPP) return errno;
    // A file system that cannot, as some network ones.
    struct stat status {};
    if (::fstatat(to_folder, to.c_str(), &status, AT_SYMLINK_NOFOLLOW) == 0) return EEXIST;
    if (errno != ENOENT) return errno;
    return ::renameat(from_folder, from.c_str(), to_folder, to.c_str()) == 0 ? 0 : errno;
}

void write_atomically(const std::filesystem::path& path,
                      const std::function<void(const std::filesystem::path& temporary)>& write) {
    AtomicFile file(path);
    write(file.temporary());
    file.publish();
}

namespace {

using FillPieces = std::function<void(const AppendPiece& append)>;

void write_pieces(const AtomicFile& file, const std::filesystem::path& path, const FillPieces& fill) {
    Descriptor descriptor(::open(file.temporary().c_str(), O_WRONLY | O_TRUNC | O_NOFOLLOW | O_CLOEXEC));
    if (descriptor.get() < 0) fail(path, "cannot open", errno);
    PieceWriter writer(descriptor.get());
    const auto check = [&](int error) {
        if (error != 0) fail(path, "cannot write", error);
    };
    fill([&](std::string_view piece) { check(writer.append(piece)); });
    check(writer.flush());
    if (descriptor.close() != 0) fail(path, "cannot write", errno);
}

// `file` is open.
void append_pieces_of(const Descriptor& file, const std::filesystem::path& path, const AppendPiece& append) {
    std::vector<char> piece(std::size_t(256) << 10);
    for (;;) {
        const ssize_t count = ::read(file.get(), piece.data(), piece.size());
        if (count < 0 && errno == EINTR) continue;
        if (count < 0) throw ReadFailure(path, std::strerror(errno));
        if (count == 0) return;
        append({piece.data(), std::size_t(count)});
    }
}

bool write_pieces_where_free(const std::filesystem::path& path, const FillPieces& fill) {
    if (stands_there(path)) return false;  // of which the new one would take its permissions
    AtomicFile file(path);
    write_pieces(file, path, fill);
    return file.publish_where_free();
}

}  // namespace

void write_pieces_atomically(const std::filesystem::path& path, const FillPieces& fill, Folders folders) {
    AtomicFile file(path, Access::shared, folders);
    write_pieces(file, path, fill);
    file.publish();
}

bool write_where_free(const std::filesystem::path& path, std::string_view content) {
    return write_pieces_where_free(path, [&](const AppendPiece& append) { append(content); });
}

bool copy_where_free(const std::filesystem::path& from, const std::filesystem::path& to) {
    const Descriptor file = open_regular_file(from, O_RDONLY);
    return write_pieces_where_free(to,
                                   [&](const AppendPiece& append) { append_pieces_of(file, from, append); });
}

void write_atomically(const std::filesystem::path& path, std::string_view content) {
    write_pieces_atomically(path, [&](const AppendPiece& append) { append(content); });
}

void write_atomically(const std::filesystem::path& path, std::span<const std::byte> content) {
    write_atomically(path, std::string_view(reinterpret_cast<const char*>(content.data()), content.size()));
}

void copy_atomically(const std::filesystem::path& from, const std::filesystem::path& to) {
    const Descriptor file = open_regular_file(from, O_RDONLY);
    write_pieces_atomically(to, [&](const AppendPiece& append) { append_pieces_of(file, from, append); });
}

bool separate_from_links(const std::filesystem::path& path) {
    struct stat status {};
    if (::lstat(path.c_str(), &status) != 0 || !S_ISREG(status.st_mode) || status.st_nlink < 2) return false;
    copy_atomically(path, path);
    return true;
}

std::string published_name(std::string_view temporary) {
    const std::size_t part = temporary.rfind(kPart);
    if (!temporary.starts_with('.') || part == temporary.npos || part < 2) return "";
    const std::string_view rest = temporary.substr(part + kPart.size());
    const std::string_view numbers = rest.substr(0, rest.find('.'));
    const std::size_t dash = numbers.find('-');
    if (dash == numbers.npos || !all_digits(numbers.substr(0, dash)) || !all_digits(numbers.substr(dash + 1)))
        return "";
    return std::string(temporary.substr(1, part - 1)).append(rest.substr(numbers.size()));
}

}  // namespace nephos
