// SPDX-License-Identifier: Apache-2.0
#include "core/atomic_file.h"

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <random>
#include <string>
#include <system_error>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/descriptor.h"
#include "core/error.h"

namespace nephos {
namespace {

[[noreturn]] void fail(const std::filesystem::path& path, const std::string& what, int error) {
    throw Error(ErrorCode::io, path.string() + ": " + what + ": " + std::strerror(error));
}

void flush_to_device(const std::filesystem::path& subject, const std::filesystem::path& reported, int flags) {
    const Descriptor descriptor(::open(subject.c_str(), flags | O_CLOEXEC));
    if (descriptor.get() < 0) fail(reported, "cannot open after writing", errno);
    int failed;
    do failed = ::fsync(descriptor.get());
    while (failed != 0 && errno == EINTR);
    // Some file systems cannot flush a folder and say EINVAL; there the rename itself is all there is.
    if (failed != 0 && errno != EINVAL) fail(reported, "cannot flush to the device", errno);
}

// Resolves symbolic links, so that the file that one points to is replaced and not the link. Refuses devices
// and pipes, which a rename would replace by a plain file.
std::filesystem::path target_of(const std::filesystem::path& path) {
    std::error_code error;
    const auto kind = std::filesystem::status(path, error).type();
    if (kind == std::filesystem::file_type::directory) fail(path, "cannot be written", EISDIR);
    if (kind != std::filesystem::file_type::regular && kind != std::filesystem::file_type::not_found &&
        kind != std::filesystem::file_type::none) {
        throw Error(ErrorCode::io, path.string() + ": is not a regular file");
    }
    if (!std::filesystem::is_symlink(path, error)) return path;
    const std::filesystem::path target = std::filesystem::weakly_canonical(path, error);
    if (error) fail(path, "cannot follow the link", error.value());
    return target;
}

constexpr std::string_view kPart = ".part";

// ".STEM.partNUMBERS.EXTENSION"; the extension last, because some writers choose the format by it.
std::string temporary_name(const std::filesystem::path& path, const std::string& numbers) {
    return "." + path.stem().string() + std::string(kPart) + numbers + path.extension().string();
}

// A file that this process created: where it is, and which one it is, whatever is found under its name later.
struct CreatedFile {
    std::filesystem::path path;
    dev_t device = 0;
    ino_t inode = 0;
};

// Creates an empty file beside `path` under a name that holds this process' number and 64 random bits. O_EXCL: in a
// folder that others may write to, a file or link that waits under that name is never opened.
CreatedFile create_temporary(const std::filesystem::path& folder, const std::filesystem::path& path) {
    constexpr int kAttempts = 100;
    std::random_device random;
    for (int attempt = 1;; ++attempt) {
        const std::uint64_t number = std::uint64_t{random()} << 32 | random();
        CreatedFile file{folder /
                         temporary_name(path, std::to_string(::getpid()) + "-" + std::to_string(number))};
        const Descriptor descriptor(
            ::open(file.path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0666));
        if (descriptor.get() < 0 && errno == EEXIST && attempt < kAttempts) continue;
        struct stat status {};
        if (descriptor.get() < 0 || ::fstat(descriptor.get(), &status) != 0)
            fail(path, "cannot create", errno);
        file.device = status.st_dev;
        file.inode = status.st_ino;
        return file;
    }
}

// Throws Error(io) unless `file` still has its name.
void require_same_file(const CreatedFile& file, const std::filesystem::path& reported) {
    struct stat status {};
    if (::lstat(file.path.c_str(), &status) != 0) fail(reported, "its temporary file is gone", errno);
    if (status.st_dev != file.device || status.st_ino != file.inode || !S_ISREG(status.st_mode))
        throw Error(ErrorCode::io,
                    reported.string() + ": another file was put in the place of its temporary one");
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

void write_atomically(const std::filesystem::path& given,
                      const std::function<void(const std::filesystem::path& temporary)>& write) {
    std::error_code error;
    const std::filesystem::path path = target_of(given);
    const std::filesystem::path folder = path.has_parent_path() ? path.parent_path() : ".";
    std::filesystem::create_directories(folder, error);
    if (error) fail(folder, "cannot create the folder", error.value());

    const CreatedFile temporary = create_temporary(folder, path);
    try {
        write(temporary.path);
        require_same_file(temporary, path);
        flush_to_device(temporary.path, path, O_RDONLY | O_NOFOLLOW);
        std::filesystem::rename(temporary.path, path, error);
        if (error) fail(path, "cannot rename into place", error.value());
        flush_to_device(folder, path, O_RDONLY | O_DIRECTORY);
    } catch (...) {
        std::filesystem::remove(temporary.path, error);
        throw;
    }
}

void write_pieces_atomically(const std::filesystem::path& path,
                             const std::function<void(const AppendPiece& append)>& fill) {
    write_atomically(path, [&](const std::filesystem::path& temporary) {
        Descriptor descriptor(::open(temporary.c_str(), O_WRONLY | O_TRUNC | O_NOFOLLOW | O_CLOEXEC));
        if (descriptor.get() < 0) fail(path, "cannot open", errno);
        PieceWriter writer(descriptor.get());
        const auto check = [&](int error) {
            if (error != 0) fail(path, "cannot write", error);
        };
        fill([&](std::string_view piece) { check(writer.append(piece)); });
        check(writer.flush());
        if (descriptor.close() != 0) fail(path, "cannot write", errno);
    });
}

void write_atomically(const std::filesystem::path& path, std::string_view content) {
    write_pieces_atomically(path, [&](const AppendPiece& append) { append(content); });
}

void write_atomically(const std::filesystem::path& path, std::span<const std::byte> content) {
    write_atomically(path, std::string_view(reinterpret_cast<const char*>(content.data()), content.size()));
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
