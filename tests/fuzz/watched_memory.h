// SPDX-License-Identifier: Apache-2.0
#pragma once

// Memory of a target that calls a library which trusts its input: operator new of the whole program, with a limit as the confined
// process has one, with a content that no reader may depend on, and without what the library loses when it throws.

#include <cstddef>

namespace nephos::fuzz {

// While it lives, all of operator new and delete in the program is watched. One at a time.
class WatchedMemory {
  public:
    // Lets what is alive grow by `most` bytes, beyond which operator new throws std::bad_alloc. New memory is full of `filling`.
    WatchedMemory(std::size_t most, unsigned char filling);
    // Frees what is left in blocks of the size of a tree's nodes: OpenVDB loses the node that it reads when its stream throws.
    ~WatchedMemory();
    // Returns whether memory was asked for beyond the limit.
    bool ran_out() const;
    WatchedMemory(const WatchedMemory&) = delete;
    WatchedMemory& operator=(const WatchedMemory&) = delete;
};

}  // namespace nephos::fuzz
