// SPDX-License-Identifier: Apache-2.0
#pragma once

// Owned file descriptors, and files that are opened for certain: no folder, and no pipe that nobody writes to
// and that would keep the program waiting for ever (not installed).

#include <cstddef>
#include <filesystem>
#include <span>

#include <unistd.h>

namespace nephos {

// Closes the descriptor that it owns; -1 stands for none.
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
    // What close(2) says: on some file systems the first sign of a failed write. 0 when there is nothing to
    // close.
    int close() {
        const int fd = release();
        return fd < 0 ? 0 : ::close(fd);
    }

  private:
    int fd_ = -1;
};

// Opens a regular file, or what a symbolic link to one points to; never waits. `flags` as for open(2),
// O_CLOEXEC is added; a file that O_CREAT makes has the usual rights. Throws Error(io) that names the path
// and the reason.
Descriptor open_regular_file(const std::filesystem::path& path, int flags);

// Throws Error(io) unless open_regular_file() can read it.
void require_regular_file(const std::filesystem::path& path);

// Whether a path is a pipe with a name in the file system. Nobody may ever write to it, and a program that
// opens it to read waits for that. The pipe of a running command (/dev/stdin, what a shell puts for
// `<(command)`) has no such name.
bool is_named_pipe(const std::filesystem::path& path);

// Writes everything, however many calls it takes. 0, or the error number of the call that failed.
int write_all(int fd, std::span<const std::byte> content);

}  // namespace nephos
