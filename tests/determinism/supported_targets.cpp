// SPDX-License-Identifier: Apache-2.0
// Preloaded into a command, this lets Highway choose among the vector targets of NEPHOS_TARGETS only, the sum of some numbers
// of those of its list in decimal. What was asked for and what the processor has of it is appended to the file
// NEPHOS_TARGETS_LOG, so that a test knows that it was asked. With NEPHOS_PROCESSORS, so many seem to be there at least: oneTBB
// makes no more threads than there are processors, whatever it is allowed.

#include <cstdint>
#include <cstdio>
#include <cstdlib>

#include <dlfcn.h>
#include <hwy/targets.h>
#include <sched.h>
#include <unistd.h>

namespace {

long processors() {
    const char* const wanted = std::getenv("NEPHOS_PROCESSORS");
    return wanted != nullptr ? std::strtol(wanted, nullptr, 10) : 0;
}

}  // namespace

// Replace functions of the C library by which oneTBB counts processors.
extern "C" int sched_getaffinity(pid_t process, std::size_t bytes, cpu_set_t* set) noexcept {
    using Function = int (*)(pid_t, std::size_t, cpu_set_t*);
    static const auto original = reinterpret_cast<Function>(::dlsym(RTLD_NEXT, "sched_getaffinity"));
    const int status = original(process, bytes, set);
    for (long n = 0; status == 0 && n < processors(); ++n) CPU_SET_S(std::size_t(n), bytes, set);
    return status;
}

extern "C" long sysconf(int name) noexcept {
    static const auto original = reinterpret_cast<long (*)(int)>(::dlsym(RTLD_NEXT, "sysconf"));
    const long value = original(name);
    return name == _SC_NPROCESSORS_ONLN && processors() > value ? processors() : value;
}

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
