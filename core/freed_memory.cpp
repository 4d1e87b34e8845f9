// SPDX-License-Identifier: Apache-2.0
#include "core/freed_memory.h"

#include <cstdlib>

#ifdef __GLIBC__
#include <malloc.h>
#endif

namespace nephos {

void keep_freed_memory() {
#ifdef __GLIBC__
    mallopt(M_MMAP_THRESHOLD, 32 << 20);  // the largest that it takes: larger blocks are mapped, and go back
    mallopt(M_TRIM_THRESHOLD, 256 << 20);
#endif
}

}  // namespace nephos
