// SPDX-License-Identifier: Apache-2.0
// Preloaded into a command, this lets Highway choose among the vector targets of NEPHOS_TARGETS only, the sum of some numbers
// of those of its list in decimal. What was asked for and what the processor has of it is appended to the file
// NEPHOS_TARGETS_LOG, so that a test knows that it was asked.

#include <cstdint>
#include <cstdio>
#include <cstdlib>

#include <dlfcn.h>
#include <hwy/targets.h>

namespace hwy {

// Takes the place of the function of libhwy, which every dispatch asks.
int64_t SupportedTargets() {
    using Function = int64_t (*)();
    static const auto original =
        reinterpret_cast<Function>(::dlsym(RTLD_NEXT, "_ZN3hwy16SupportedTargetsEv"));
    const char* const wanted = std::getenv("NEPHOS_TARGETS");
    if (wanted == nullptr) return original();
    const int64_t found = original() & std::strtoll(wanted, nullptr, 10);
    static const bool logged = [&] {
        const char* const log = std::getenv("NEPHOS_TARGETS_LOG");
        std::FILE* const file = log != nullptr ? std::fopen(log, "a") : nullptr;
        if (file != nullptr) {
            std::fprintf(file, "%s %lld\n", wanted, static_cast<long long>(found));
            std::fclose(file);
        }
        return true;
    }();
    static_cast<void>(logged);
    return found;
}

}  // namespace hwy
