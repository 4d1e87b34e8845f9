// SPDX-License-Identifier: Apache-2.0
#include "automaton/atomic_file.h"

#include <cerrno>
#include <cstdint>
#include <cstring>
#include <string>
#include <system_error>

#include <fcntl.h>
#include <unistd.h>

#include "automaton/error.h"

namespace nephos {
namespace {

[[noreturn]] void fail(const std::filesystem::path& path, const std::string& what, int error) {
    throw Error(ErrorCode::io, path.string() + ": " + what + ": " + std::strerror(error));
}

class Descriptor {
  public:
    explicit Descriptor(int fd) : fd_(fd) {}
    Descriptor(const Descriptor&) = delete;
    Descriptor& operator=(const Descriptor&) = delete;
    ~Descriptor() {
        if (fd_ >= 0) ::close(fd_);
    }
    int get() const { return fd_; }
    // Closes and reports what close() says: on some file systems the first sign of a failed write.
    int close() {
        const int result = ::close(fd_);
        fd_ = -1;
        return result;
    }

  private:
    int fd_;
};

void flush_to_device(const std::filesystem::path& subject, const std::filesystem::path& reported, int flags) {
    Descriptor descriptor(::open(subject.c_str(), flags | O_CLOEXEC));
    if (descriptor.get() < 0) fail(reported, "cannot open after writing", errno);
    // Some file systems cannot flush a folder and say EINVAL; there the rename itself is all there is.
    if (::fsync(descriptor.get()) != 0 && errno != EINVAL)
        fail(reported, "cannot flush to the device", errno);
}

// What a path stands for: a symbolic link keeps pointing to the file that is replaced. A rename would put a file in the
// place of a device or a pipe, so those are refused.
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

}  // namespace

void write_atomically(const std::filesystem::path& given,
                      const std::function<void(const std::filesystem::path& temporary)>& write) {
    std::error_code error;
    const std::filesystem::path path = target_of(given);
    const std::filesystem::path folder = path.has_parent_path() ? path.parent_path() : ".";
    std::filesystem::create_directories(folder, error);
    if (error) fail(folder, "cannot create the folder", error.value());

    // Extension last, because some writers choose the format by it. The process number keeps two runs apart, the
    // address of this call's variable two threads.
    std::string name = ".";
    name.append(path.stem().string())
        .append(".part")
        .append(std::to_string(::getpid()))
        .append("-")
        .append(std::to_string(reinterpret_cast<std::uintptr_t>(&error) >> 4))
        .append(path.extension());
    const std::filesystem::path temporary = folder / name;
    try {
        write(temporary);
        flush_to_device(temporary, path, O_RDONLY);
        std::filesystem::rename(temporary, path, error);
        if (error) fail(path, "cannot rename into place", error.value());
        flush_to_device(folder, path, O_RDONLY | O_DIRECTORY);
    } catch (...) {
        std::filesystem::remove(temporary, error);
        throw;
    }
}

void write_atomically(const std::filesystem::path& path, std::span<const std::byte> content) {
    write_atomically(path, [&](const std::filesystem::path& temporary) {
        Descriptor descriptor(::open(temporary.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666));
        if (descriptor.get() < 0) fail(path, "cannot create", errno);
        const std::byte* at = content.data();
        std::size_t left = content.size();
        while (left > 0) {
            const ssize_t written = ::write(descriptor.get(), at, left);
            if (written < 0 && errno == EINTR) continue;
            if (written < 0) fail(path, "cannot write", errno);
            at += written;
            left -= std::size_t(written);
        }
        if (descriptor.close() != 0) fail(path, "cannot write", errno);
    });
}

void write_atomically(const std::filesystem::path& path, std::string_view content) {
    write_atomically(path, std::as_bytes(std::span(content.data(), content.size())));
}

}  // namespace nephos
