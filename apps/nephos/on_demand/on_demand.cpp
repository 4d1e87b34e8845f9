// SPDX-License-Identifier: Apache-2.0

// Loads libnephos_volumes.so, the modules density and render with all libraries that they need, at the first call of
// one of their functions (functions.S; docs/adr/0033-start.md).

#include <cstddef>
#include <filesystem>
#include <string>

#include <dlfcn.h>
#include <sys/auxv.h>

#include "core/error.h"

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

// RTLD_NOW, because files are read in processes that may open nothing, so no symbol may be looked up there.
void load_volumes() {
    const std::filesystem::path file = program_file().parent_path() / NEPHOS_VOLUMES_LIBRARY;
    void* const library = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
    if (library == nullptr) {
        throw Error(ErrorCode::io, std::string("a part of nephos cannot be loaded: ") + dlerror());
    }
    for (std::size_t i = 0; i < nephos_on_demand_count; ++i) {
        void* const function = dlsym(library, nephos_on_demand_names[i]);
        if (function == nullptr) {
            throw Error(ErrorCode::io, std::string("a part of nephos is of another version: ") + dlerror());
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
