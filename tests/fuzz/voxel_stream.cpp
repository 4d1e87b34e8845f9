// SPDX-License-Identifier: Apache-2.0
// Voxels as they come from the process that parses a foreign VDB file: whoever has taken it over chooses every byte.

#include <cmath>

#include "density/vdb/block_stream.h"
#include "tests/fuzz/target.h"

namespace {

using namespace nephos;

class Stream : public SandboxReader {
  public:
    explicit Stream(std::string_view bytes) : left_(bytes) {}
    void bytes(void* data, std::size_t size) override {
        if (size > left_.size()) throw Error(ErrorCode::io, "the stream ends");
        left_.copy(static_cast<char*>(data), size);
        left_.remove_prefix(size);
    }

  private:
    std::string_view left_;
};

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    Stream stream(fuzz::as_text(data, size));
    const Extent extent{24, 16, 8};
    try {
        fuzz::accepts([&] { receive_blocks(stream, extent, Placement{}); });
    } catch (const std::runtime_error&) {
        // Documented in block_stream.h; run_sandboxed() makes an Error of it.
    }
    return 0;
}
