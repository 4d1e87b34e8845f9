// SPDX-License-Identifier: Apache-2.0
#pragma once

// The file that a VDB or NanoVDB is written to (not installed). OpenVDB asks its stream for the position with tellp(), and
// std::filebuf answers a failed lseek(2) with -1 that nobody checks: offsets of grids are then wrong in a file that
// seems to be complete. This buffer counts the position itself and writes with pwrite(2), so that there is no seeking
// that could fail; and it opens no link that was put in the place of the file.

#include <cstdint>
#include <filesystem>
#include <streambuf>
#include <vector>

#include "core/descriptor.h"

namespace nephos {

class VdbOutput : public std::streambuf {
  public:
    // Opens a file that is there, and empties it; error() says whether it worked.
    explicit VdbOutput(const std::filesystem::path& file);

    // Writes what has gathered and closes the file. Returns false when any operation has failed.
    bool close();
    // Returns errno of the first operation that failed; 0 = none.
    int error() const { return error_; }
    // Throws Error(io) with what failed; `path`: the file as the user knows it.
    [[noreturn]] void fail(const std::filesystem::path& path) const;

  protected:
    int_type overflow(int_type character) override;
    int sync() override;
    pos_type seekoff(off_type offset, std::ios_base::seekdir from, std::ios_base::openmode which) override;
    pos_type seekpos(pos_type position, std::ios_base::openmode which) override;

  private:
    bool write_gathered();

    Descriptor file_;
    std::vector<char> gathered_;
    std::uint64_t begin_ = 0;  // of what has gathered, in the file
    int error_ = 0;
};

}  // namespace nephos
