// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace nephos {

// Memory that is freed stays with the process, up to 256 MiB in each arena of malloc, instead of going back
// to the system at once: every picture and step asks for the same vectors again, and pages that the system
// has to clear take time (docs/speed.md). available_memory() counts it as free. For programs, not for
// libraries: it changes malloc for the whole process. Call it first. Does nothing where malloc is not that of
// the GNU C library.
void keep_freed_memory();

}  // namespace nephos
