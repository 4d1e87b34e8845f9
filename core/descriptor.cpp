// SPDX-License-Identifier: Apache-2.0
#include "core/descriptor.h"

#include <cerrno>
#include <cstring>
#include <istream>
#include <system_error>

#include <fcntl.h>
#include <sys/stat.h>

#include "core/error.h"

namespace nephos {

namespace {

// Returns whether an error of the system says that there is no such file, and not that it cannot tell.
bool is_absence(int error) {
    return error == ENOENT || error == ENOTDIR || error == ELOOP || error == ENAMETOOLONG;
}

}  // namespace

Descriptor open_regular_file(const std::filesystem::path& path, int flags) {
    // O_NONBLOCK has no effect on regular files, and does not wait for the other end of a pipe.
    Descriptor descriptor(::open(path.c_str(), flags | O_CLOEXEC | O_NONBLOCK | O_NOCTTY, 0666));
    struct stat status {};
    if (descriptor.get() < 0 && errno != ENXIO) {
        const int error = errno;
        if (error == ELOOP && (flags & O_NOFOLLOW) != 0)
            throw Error(ErrorCode::io, path.string() + ": is a link, which is not followed here");
        if (is_absence(error))
            throw Error(ErrorCode::io, path.string() + ": cannot open: " + std::strerror(error));
        throw ReadFailure(path, std::strerror(error), "open");
    }
    if (descriptor.get() >= 0 && ::fstat(descriptor.get(), &status) != 0) {
        const int error = errno;
        throw ReadFailure(path, std::strerror(error), "examine");
    }
    if (S_ISDIR(status.st_mode)) throw Error(ErrorCode::io, path.string() + ": is a folder");
    // ENXIO: a pipe without a reader, or a socket.
    if (!S_ISREG(status.st_mode)) throw Error(ErrorCode::io, path.string() + ": is not a regular file");
    return descriptor;
}

void require_regular_file(const std::filesystem::path& path) { open_regular_file(path, O_RDONLY); }

std::ifstream open_stream(const std::filesystem::path& path) {
    require_regular_file(path);
    errno = 0;
    std::ifstream stream(path, std::ios::binary);
    // A stream that is not open reads as an empty file.
    if (!stream.is_open())
        throw ReadFailure(path, errno != 0 ? std::strerror(errno) : "unknown error", "open");
    return stream;
}

void check_reading(const std::istream& stream, const std::filesystem::path& path) {
    if (stream.bad()) throw ReadFailure(path, errno != 0 ? std::strerror(errno) : "unknown error");
}

void rewind(std::istream& stream, const std::filesystem::path& path) {
    errno = 0;
    stream.clear();
    stream.seekg(0);
    if (!stream) throw ReadFailure(path, errno != 0 ? std::strerror(errno) : "unknown error");
}

std::string read_beginning(const std::filesystem::path& path, std::size_t most) {
    const Descriptor file = open_regular_file(path, O_RDONLY);
    std::string text(most, '\0');
    std::size_t size = 0;
    while (size < most) {
        const ssize_t got = ::read(file.get(), text.data() + size, most - size);
        if (got < 0 && errno == EINTR) continue;
        if (got < 0) throw ReadFailure(path, std::strerror(errno));
        if (got == 0) break;
        size += std::size_t(got);
    }
    text.resize(size);
    return text;
}

bool is_there(const std::filesystem::path& path) {
    std::error_code error;
    const std::filesystem::file_type type = std::filesystem::status(path, error).type();
    if (type != std::filesystem::file_type::none) return type != std::filesystem::file_type::not_found;
    if (is_absence(error.value())) return false;
    throw ReadFailure(path, error.message(), "examine");
}

bool is_same_file(int fd, const std::filesystem::path& path) {
    struct stat opened {
    }, found{};
    if (::fstat(fd, &opened) != 0) throw ReadFailure(path, std::strerror(errno), "examine");
    if (::stat(path.c_str(), &found) == 0)
        return opened.st_dev == found.st_dev && opened.st_ino == found.st_ino;
    if (is_absence(errno)) return false;
    throw ReadFailure(path, std::strerror(errno), "examine");
}

bool is_named_pipe(const std::filesystem::path& path) {
    std::error_code error;
    if (!std::filesystem::is_fifo(path, error)) return false;
    const std::filesystem::path name = std::filesystem::canonical(path, error);
    return !error && std::filesystem::exists(name, error);
}

int flush_to_device(int fd) {
    int failed;
    do failed = ::fsync(fd);
    while (failed != 0 && errno == EINTR);
    return failed != 0 ? errno : 0;
}

int write_all(int fd, std::span<const std::byte> content) {
    while (!content.empty()) {
        const ssize_t written = ::write(fd, content.data(), content.size());
        if (written < 0 && errno == EINTR) continue;
        if (written < 0) return errno;
        content = content.subspan(std::size_t(written));
    }
    return 0;
}

}  // namespace nephos
