// SPDX-License-Identifier: Apache-2.0
#pragma once

// Sizes are checked before anything is allocated: Linux grants more memory than there is and kills later.

#include <cstddef>
#include <string>

namespace nephos {

// Bytes that this process can still use: what the machine has free, less when a control group or a limit on the
// address space (ulimit -v) allows less. The largest number when nothing is known.
std::size_t available_memory_bytes();

// Throws Error(usage) unless `bytes` are available; `what` starts the sentence ("scene.toml: a lattice of ...").
void require_memory(std::size_t bytes, const std::string& what);

}  // namespace nephos
