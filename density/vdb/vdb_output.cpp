// SPDX-License-Identifier: Apache-2.0
#include "density/vdb/vdb_output.h"

#include <cerrno>
#include <cstring>

#include <fcntl.h>
#include <unistd.h>

#include "core/error.h"

namespace nephos {

VdbOutput::VdbOutput(const std::filesystem::path& file)
    : file_(::open(file.c_str(), O_WRONLY | O_TRUNC | O_NOFOLLOW | O_CLOEXEC)),
      gathered_(std::size_t(1) << 16) {
    if (file_.get() < 0) error_ = errno;
    setp(gathered_.data(), gathered_.data() + gathered_.size());
}

bool VdbOutput::close() {
    const bool written = write_gathered();
    const bool closed = file_.close() == 0;
    if (!closed && error_ == 0) error_ = errno;
    return written && closed;
}

void VdbOutput::fail(const std::filesystem::path& path) const {
    throw Error(ErrorCode::io,
                path.string() + ": cannot write: " + (error_ != 0 ? std::strerror(error_) : "unknown error"));
}

bool VdbOutput::write_gathered() {
    if (error_ != 0) return false;
    for (const char* at = pbase(); at < pptr();) {
        const ssize_t written = ::pwrite(file_.get(), at, std::size_t(pptr() - at), off_t(begin_));
        if (written < 0 && errno == EINTR) continue;
        if (written <= 0) {
            error_ = written < 0 ? errno : ENOSPC;
            return false;
        }
        at += written;
        begin_ += std::uint64_t(written);
    }
    setp(gathered_.data(), gathered_.data() + gathered_.size());
    return true;
}

VdbOutput::int_type VdbOutput::overflow(int_type character) {
    if (!write_gathered()) return traits_type::eof();
    if (traits_type::eq_int_type(character, traits_type::eof())) return traits_type::not_eof(character);
    return sputc(traits_type::to_char_type(character));
}

int VdbOutput::sync() { return write_gathered() ? 0 : -1; }

// OpenVDB goes back to what it has written, and asks where it is.
VdbOutput::pos_type VdbOutput::seekoff(off_type offset, std::ios_base::seekdir from,
                                       std::ios_base::openmode which) {
    const auto here = off_type(begin_) + (pptr() - pbase());
    if (error_ != 0 || from == std::ios_base::end) return pos_type(off_type(-1));
    if (from == std::ios_base::cur && offset == 0) return pos_type(here);
    return seekpos(pos_type(from == std::ios_base::cur ? here + offset : offset), which);
}

VdbOutput::pos_type VdbOutput::seekpos(pos_type position, std::ios_base::openmode) {
    if (off_type(position) < 0 || !write_gathered()) return pos_type(off_type(-1));
    begin_ = std::uint64_t(off_type(position));
    return position;
}

}  // namespace nephos
