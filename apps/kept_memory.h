// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace nephos {

// Memory that is freed stays with the process, up to some 100 MiB, instead of going back to the system at
// once: every picture and step asks for the same vectors again, and pages that the system has to clear took a
// sixth of a picture's time. For programs, not for libraries: it changes malloc for the whole process. Call
// it first. Does nothing where malloc is not that of the GNU C library.
void keep_freed_memory();

}  // namespace nephos
