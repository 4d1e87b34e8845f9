// SPDX-License-Identifier: Apache-2.0

// Loads libnephos_volumes.so, the modules density and render with all libraries that they need, at the first call of
// one of their functions (functions.S; docs/adr/0033-start.md).

#include <cerrno>
#include <cstddef>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include <dlfcn.h>
#include <pthread.h>
#include <sys/auxv.h>
#include <sys/mman.h>

#include "core/descriptor.h"

extern "C" {
// Both of nephos_on_demand_count elements, from functions.S: addresses that calls jump to, and symbols.
extern void* nephos_on_demand_slots[];
extern const char* const nephos_on_demand_names[];
extern const std::size_t nephos_on_demand_count;
void* nephos_on_demand_resolve(std::size_t number);
}

namespace nephos {
namespace {

// Returns where the program lies; without /proc, where it was started.
std::filesystem::path program_file() {
    std::error_code error;
    const std::filesystem::path file = std::filesystem::read_symlink("/proc/self/exe", error);
    if (!error) return file;
    return std::filesystem::canonical(reinterpret_cast<const char*>(getauxval(AT_EXECFN)));
}

void* wait_for_unlock(void* lock) {
    pthread_mutex_lock(static_cast<pthread_mutex_t*>(lock));
    pthread_mutex_unlock(static_cast<pthread_mutex_t*>(lock));
    return nullptr;
}

// A library of OpenVDB's, liblog4cplus, starts four threads while it is loaded, and TBB two at least at its first work. Where
// the limits of a user or of memory allow fewer, they end the process or wait for ever: so as many are tried first, with
// the addresses that the libraries take (70 MiB with Debian 12). Throws ReadFailure: no file is damaged.
void require_room() {
    constexpr std::size_t kAddresses = std::size_t(80) << 20, kThreads = 6;
    void* const addresses =
        ::mmap(nullptr, kAddresses, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    int problem = addresses == MAP_FAILED ? errno : 0;
    pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
    pthread_mutex_lock(&lock);
    std::vector<pthread_t> threads;
    threads.reserve(kThreads);
    while (problem == 0 && threads.size() < kThreads) {
        pthread_t thread{};
        problem = pthread_create(&thread, nullptr, wait_for_unlock, &lock);
        if (problem == 0) threads.push_back(thread);
    }
    pthread_mutex_unlock(&lock);
    for (const pthread_t thread : threads) pthread_join(thread, nullptr);
    pthread_mutex_destroy(&lock);
    if (addresses != MAP_FAILED) ::munmap(addresses, kAddresses);
    if (problem != 0)
        throw LoadFailure(std::string("a part of nephos cannot be loaded: it needs ") +
                          std::to_string(kThreads) + " threads and 80 MiB of addresses: " +
                          std::strerror(problem) + " (see the limits of `ulimit -a`)");
}

// RTLD_NOW, because files are read in processes that may open nothing, so no symbol may be looked up there.
void load_volumes() {
    require_room();
    const std::filesystem::path file = program_file().parent_path() / NEPHOS_VOLUMES_LIBRARY;
    void* const library = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
    if (library == nullptr) {
        throw LoadFailure(std::string("a part of nephos cannot be loaded: ") + dlerror());
    }
    for (std::size_t i = 0; i < nephos_on_demand_count; ++i) {
        void* const function = dlsym(library, nephos_on_demand_names[i]);
        if (function == nullptr) {
            throw LoadFailure(std::string("a part of nephos is of another version: ") + dlerror());
        }
        nephos_on_demand_slots[i] = function;
    }
}

}  // namespace
}  // namespace nephos

// Returns the function of a number. Thread-safe: another thread that jumps through a slot meanwhile finds the old
// address, which leads here and waits, or the new one. After a failure the next call tries again.
void* nephos_on_demand_resolve(std::size_t number) {
    [[maybe_unused]] static const bool loaded = (nephos::load_volumes(), true);
    return nephos_on_demand_slots[number];
}
