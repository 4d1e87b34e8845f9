// SPDX-License-Identifier: Apache-2.0
#pragma once

// An output stream for OpenEXR that reports every failed write. The library writes its last offset table in a
// destructor, which swallows exceptions, so that a full disk would go unnoticed. This stream records the
// first failure, and close() throws it. Private to the module.

#include <cstdint>
#include <filesystem>
#include <string>

#include <OpenEXR/ImfIO.h>

namespace nephos {

class CheckedStream : public Imf::OStream {
  public:
    // Opens `file`, which must be there and no link, and empties it; messages name `reported`, the file that the
    // user requested. Throws Error(io).
    CheckedStream(const std::filesystem::path& file, const std::filesystem::path& reported);
    CheckedStream(const CheckedStream&) = delete;
    CheckedStream& operator=(const CheckedStream&) = delete;
    ~CheckedStream() override;

    void write(const char bytes[], int count) override;
    std::uint64_t tellp() override { return position_; }
    void seekp(std::uint64_t position) override { position_ = position; }

    // Closes the file and throws Error(io) when any operation has failed.
    void close();

  private:
    [[noreturn]] void fail(int error);

    int descriptor_;
    std::uint64_t position_ = 0;
    int first_error_ = 0;
    std::string reported_;
};

}  // namespace nephos
