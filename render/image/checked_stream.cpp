// SPDX-License-Identifier: Apache-2.0
#include "render/image/checked_stream.h"

#include <cerrno>
#include <cstring>

#include <fcntl.h>
#include <unistd.h>

#include "core/error.h"

namespace nephos {
namespace {

constexpr std::size_t kGathered = std::size_t(1) << 16;

}  // namespace

CheckedStream::CheckedStream(const std::filesystem::path& file, const std::filesystem::path& reported)
    : Imf::OStream(file.c_str()), reported_(reported.string()) {
    gathered_.reserve(
        kGathered);  // later, in a destructor of the library, a lack of memory would go unnoticed
    descriptor_ = ::open(file.c_str(), O_WRONLY | O_TRUNC | O_NOFOLLOW | O_CLOEXEC);
    if (descriptor_ < 0) fail(errno);
}

CheckedStream::~CheckedStream() {
    if (descriptor_ >= 0) ::close(descriptor_);
}

void CheckedStream::fail(int error) {
    if (first_error_ == 0) first_error_ = error;
    throw Error(ErrorCode::io, reported_ + ": cannot write: " + std::strerror(first_error_));
}

void CheckedStream::write(const char bytes[], int count) {
    const std::string_view content(bytes, std::size_t(count));
    if (position_ != end_ || gathered_.size() + content.size() > kGathered) flush();
    if (content.size() > kGathered)
        put(content, position_);
    else
        gathered_ += content;
    position_ += content.size();
    end_ = position_;
}

void CheckedStream::flush() {
    put(gathered_, end_ - gathered_.size());
    gathered_.clear();
}

// pwrite, not write: OpenEXR goes back to fill in the offset tables.
void CheckedStream::put(std::string_view content, std::uint64_t at) {
    while (!content.empty()) {
        const ssize_t written = ::pwrite(descriptor_, content.data(), content.size(), off_t(at));
        if (written < 0 && errno == EINTR) continue;
        if (written <= 0) fail(written < 0 ? errno : ENOSPC);
        content.remove_prefix(std::size_t(written));
        at += std::uint64_t(written);
    }
}

void CheckedStream::close() {
    if (first_error_ == 0) flush();
    const int result = ::close(descriptor_);
    const int error = errno;
    descriptor_ = -1;
    if (first_error_ != 0) fail(first_error_);
    if (result != 0) fail(error);
}

}  // namespace nephos
