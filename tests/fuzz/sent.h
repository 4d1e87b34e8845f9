// SPDX-License-Identifier: Apache-2.0
#pragma once

// Reads what a confined process sends its parent, for targets that call both sides in one process: a SandboxWriter fills a file in
// memory, and a SandboxReader hands its bytes over.

#include <cstddef>
#include <cstdint>
#include <fstream>
#include <string>
#include <utility>

#include "density/vdb/sandbox.h"
#include "tests/fuzz/target.h"

namespace nephos::fuzz {

// Hands over what was sent; a reader that asks for more ends the program.
class Sent : public SandboxReader {
  public:
    explicit Sent(std::string bytes) : bytes_(std::move(bytes)) {}
    void bytes(void* data, std::size_t size) override {
        require(size <= bytes_.size() - at_, "what is sent is whole");
        bytes_.copy(static_cast<char*>(data), size, at_);
        at_ += size;
    }
    bool is_over() const { return at_ == bytes_.size(); }

  private:
    std::string bytes_;
    std::size_t at_ = 0;
};

// Returns the bytes that a SandboxWriter has put into a file, without the lengths of its chunks.
inline std::string sent_to(const InputFile& pipe) {
    std::ifstream stream(pipe.path(), std::ios::binary);
    std::string bytes;
    for (std::uint32_t chunk = 0; stream.read(reinterpret_cast<char*>(&chunk), sizeof chunk);) {
        bytes.resize(bytes.size() + chunk);
        stream.read(bytes.data() + bytes.size() - chunk, chunk);
    }
    return bytes;
}

}  // namespace nephos::fuzz
