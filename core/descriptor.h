// SPDX-License-Identifier: Apache-2.0
#pragma once

// RAII file descriptors, and opening of regular files only: opening a pipe that nobody writes to would block
// for ever (not installed).

#include <cstddef>
#include <filesystem>
#include <fstream>
#include <iosfwd>
#include <span>
#include <string>

#include <unistd.h>

#include "core/error.h"

namespace nephos {

// Owns a file descriptor and closes it; -1 = none. Movable, not copyable.
class Descriptor {
  public:
    Descriptor() = default;
    explicit Descriptor(int fd) : fd_(fd) {}
    Descriptor(Descriptor&& other) noexcept : fd_(other.release()) {}
    Descriptor& operator=(Descriptor&& other) noexcept {
        if (this != &other) reset(other.release());
        return *this;
    }
    ~Descriptor() { close(); }

    int get() const { return fd_; }
    void reset(int fd) {
        close();
        fd_ = fd;
    }
    int release() {
        const int fd = fd_;
        fd_ = -1;
        return fd;
    }
    // Closes and returns the result of close(2), on some file systems the first sign of a failed write; 0
    // when there is nothing to close.
    int close() {
        const int fd = release();
        return fd < 0 ? 0 : ::close(fd);
    }

  private:
    int fd_ = -1;
};

// Opens a regular file, following symbolic links; never blocks. `flags` as for open(2), O_CLOEXEC is added;
// O_CREAT uses mode 0666 and the umask. Throws Error(io) that names the path and the reason; ReadFailure where that is not that
// there is no such file, or something else in its place.
Descriptor open_regular_file(const std::filesystem::path& path, int flags);

// Throws Error(io) unless open_regular_file() can read it.
void require_regular_file(const std::filesystem::path& path);

// Opens a regular file to read from it. Throws as open_regular_file().
std::ifstream open_stream(const std::filesystem::path& path);

// A file that is there and cannot be read, which says nothing of its content: "PATH: cannot read: Input/output error"; or what it takes
// to read it is not to be had.
class ReadFailure : public Error {
  public:
    // `act`: what failed, as "open".
    ReadFailure(const std::filesystem::path& path, const std::string& reason, const std::string& act = "read")
        : Error(ErrorCode::io, path.string() + ": cannot " + act + ": " + reason) {}
    explicit ReadFailure(const std::string& message) : Error(ErrorCode::io, message) {}
};

// A part of the program that cannot be loaded, which says nothing of any file.
class LoadFailure : public ReadFailure {
  public:
    using ReadFailure::ReadFailure;
};

// Throws ReadFailure when reading from the stream of a file has just failed; its end is no failure.
void check_reading(const std::istream& stream, const std::filesystem::path& path);

// Goes back to the beginning of the file of a stream, whose end or failure before is forgotten. Throws ReadFailure.
void rewind(std::istream& stream, const std::filesystem::path& path);

// Returns at most `most` bytes from the beginning of a file. Throws as open_regular_file(), and ReadFailure.
std::string read_beginning(const std::filesystem::path& path, std::size_t most);

// Returns whether something is there, links followed. Throws ReadFailure where the system cannot say.
bool is_there(const std::filesystem::path& path);

// Returns true when `path`, links followed, leads to the file or folder that is open. Throws ReadFailure where the system
// cannot say.
bool is_same_file(int fd, const std::filesystem::path& path);

// Returns true for a FIFO with a name in the file system, which blocks its reader until somebody opens it to
// write. The anonymous pipe of a running command (/dev/stdin, a shell's `<(command)`) returns false.
bool is_named_pipe(const std::filesystem::path& path);

// Flushes what is open to the device, as often as signals interrupt it. Returns 0 or errno.
int flush_to_device(int fd);

// Writes all of `content`, with as many calls of write(2) as it takes. Returns 0 or errno of the failed call.
int write_all(int fd, std::span<const std::byte> content);

}  // namespace nephos
