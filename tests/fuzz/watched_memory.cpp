// SPDX-License-Identifier: Apache-2.0
#include "tests/fuzz/watched_memory.h"

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <mutex>
#include <new>
#include <unordered_set>

#include <malloc.h>

#include "tests/fuzz/target.h"

namespace nephos::fuzz {
namespace {

constexpr std::size_t kNode = 2048;  // the voxels of a leaf, and all nodes above one

// Allocates for the table of blocks, which may not call operator new.
template <class T>
struct FromMalloc {
    using value_type = T;
    FromMalloc() = default;
    template <class U>
    FromMalloc(const FromMalloc<U>&) {}
    T* allocate(std::size_t n) {
        void* const at = std::malloc(n * sizeof(T));
        require(at != nullptr, "memory for the table of blocks");
        return static_cast<T*>(at);
    }
    void deallocate(T* at, std::size_t) { std::free(at); }
    bool operator==(const FromMalloc&) const { return true; }
};

using Blocks = std::unordered_set<void*, std::hash<void*>, std::equal_to<>, FromMalloc<void*>>;

// Never destroyed: what ends after main() still frees memory.
struct Watch {
    std::mutex mutex;
    bool is_on = false, ran_out = false;
    std::size_t left = 0;  // bytes that may still be taken
    unsigned char filling = 0;
    Blocks nodes;  // taken since the beginning, and not given back
};

Watch& watch() {
    alignas(Watch) static unsigned char place[sizeof(Watch)];
    static Watch* const only = new (place) Watch;
    return *only;
}

}  // namespace

WatchedMemory::WatchedMemory(std::size_t most, unsigned char filling) {
    const std::lock_guard lock(watch().mutex);
    require(!watch().is_on, "one watch at a time");
    watch().is_on = true;
    watch().ran_out = false;
    watch().left = most;
    watch().filling = filling;
}

bool WatchedMemory::ran_out() const {
    const std::lock_guard lock(watch().mutex);
    return watch().ran_out;
}

WatchedMemory::~WatchedMemory() {
    const std::lock_guard lock(watch().mutex);
    watch().is_on = false;
    for (void* const node : watch().nodes) std::free(node);
    watch().nodes.clear();
}

namespace {

void* taken(std::size_t size) {
    Watch& all = watch();
    const std::lock_guard lock(all.mutex);
    if (all.is_on && size > all.left) {
        all.ran_out = true;
        throw std::bad_alloc();
    }
    void* const at = std::malloc(size);
    if (at == nullptr) throw std::bad_alloc();
    if (!all.is_on) return at;
    const std::size_t room = ::malloc_usable_size(at);
    all.left -= std::min(all.left, room);
    std::memset(at, all.filling, size);
    if (room >= kNode) all.nodes.insert(at);
    return at;
}

void given_back(void* at) {
    if (at == nullptr) return;
    Watch& all = watch();
    const std::lock_guard lock(all.mutex);
    if (all.is_on) {
        const std::size_t room = ::malloc_usable_size(at);
        all.left += room;
        if (room >= kNode) all.nodes.erase(at);
    }
    std::free(at);
}

}  // namespace
}  // namespace nephos::fuzz

// Looks for no leaks: what OpenVDB loses when it throws is none of ours.
extern "C" const char* __asan_default_options() { return "detect_leaks=0"; }

// Replaces all forms of the standard library but the aligned ones: a sanitizer has its own of each, which would meet ours.
void* operator new(std::size_t size) { return nephos::fuzz::taken(size); }
void* operator new[](std::size_t size) { return nephos::fuzz::taken(size); }
void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
    try {
        return nephos::fuzz::taken(size);
    } catch (const std::bad_alloc&) {
        return nullptr;
    }
}
void* operator new[](std::size_t size, const std::nothrow_t& none) noexcept {
    return operator new(size, none);
}
void operator delete(void* at) noexcept { nephos::fuzz::given_back(at); }
void operator delete[](void* at) noexcept { nephos::fuzz::given_back(at); }
void operator delete(void* at, std::size_t) noexcept { nephos::fuzz::given_back(at); }
void operator delete[](void* at, std::size_t) noexcept { nephos::fuzz::given_back(at); }
