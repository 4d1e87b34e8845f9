// SPDX-License-Identifier: Apache-2.0
// Preloaded into a program (LD_PRELOAD), hides the Vulkan loader from it, as on a machine that has none.

#include <cstring>

#include <dlfcn.h>

extern "C" void* dlopen(const char* file, int flags) noexcept {
    using Open = void* (*)(const char*, int);
    static const Open next = reinterpret_cast<Open>(dlsym(RTLD_NEXT, "dlopen"));
    const bool hidden = file != nullptr && std::strstr(file, "libvulkan") != nullptr;
    return next(hidden ? "/nonexistent/libvulkan.so.1" : file, flags);
}
