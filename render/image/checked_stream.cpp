// SPDX-License-Identifier: Apache-2.0
#include "render/image/checked_stream.h"

#include <cerrno>
#include <cstring>

#include <fcntl.h>
#include <unistd.h>

#include "core/error.h"

namespace nephos {

CheckedStream::CheckedStream(const std::filesystem::path& file, const std::filesystem::path& reported)
    : Imf::OStream(file.c_str()),
      descriptor_(::open(file.c_str(), O_WRONLY | O_TRUNC | O_NOFOLLOW | O_CLOEXEC)),
      reported_(reported.string()) {
    if (descriptor_ < 0) fail(errno);
}

CheckedStream::~CheckedStream() {
    if (descriptor_ >= 0) ::close(descriptor_);
}

void CheckedStream::fail(int error) {
    if (first_error_ == 0) first_error_ = error;
    throw Error(ErrorCode::io, reported_ + ": cannot write: " + std::strerror(first_error_));
}

// pwrite, not write: OpenEXR goes back to fill in the offset tables.
void CheckedStream::write(const char bytes[], int count) {
    while (count > 0) {
        const ssize_t written = ::pwrite(descriptor_, bytes, std::size_t(count), off_t(position_));
        if (written < 0 && errno == EINTR) continue;
        if (written <= 0) fail(written < 0 ? errno : ENOSPC);
        bytes += written;
        count -= int(written);
        position_ += std::uint64_t(written);
    }
}

void CheckedStream::close() {
    const int result = ::close(descriptor_);
    const int error = errno;
    descriptor_ = -1;
    if (first_error_ != 0) fail(first_error_);
    if (result != 0) fail(error);
}

}  // namespace nephos
