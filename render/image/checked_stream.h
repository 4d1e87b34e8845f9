// SPDX-License-Identifier: Apache-2.0
#pragma once

// An output stream for OpenEXR that reports every failed write. The library writes its last offset table in a
// destructor, which swallows exceptions, so that a full disk would go unnoticed. This stream records the
// first failure, and close() throws it. It gathers what follows on each other: the library writes the names in a
// header byte by byte. Private to the module.

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

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

    // Writes what is gathered, closes the file and throws Error(io) when any operation has failed.
    void close();

  private:
    [[noreturn]] void fail(int error);
    void flush();
    void put(std::string_view content, std::uint64_t at);

    int descriptor_ = -1;
    std::uint64_t position_ = 0;
    std::string gathered_;  // of the bytes before `end_`, not written yet
    std::uint64_t end_ = 0;
    int first_error_ = 0;
    std::string reported_;
};

}  // namespace nephos
