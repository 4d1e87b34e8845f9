// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace nephos {

// Raises malloc's trim threshold, so that up to 256 MiB of freed memory in each arena stay with the process:
// every frame and step allocates the same vectors again, and the kernel clears each page that it hands out
// (docs/speed.md). available_memory() counts this memory as free. For programs, not for libraries: it changes
// malloc for the whole process. Call it before any other function. Does nothing where malloc is not that of
// the GNU C library.
void keep_freed_memory();

}  // namespace nephos
