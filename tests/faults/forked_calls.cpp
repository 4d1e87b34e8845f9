// SPDX-License-Identifier: Apache-2.0
// Preloaded into a program, this ends it where a process that it has forked calls oneTBB for memory or tasks. A thread of oneTBB
// may have held a lock at the fork: nobody opens it there, and whoever waits for it spins for ever, on a busy machine once
// in some thousand readings (density/vdb/serial_tree.h).

#include <atomic>
#include <cstddef>
#include <cstdio>
#include <cstdlib>

#include <dlfcn.h>
#include <pthread.h>
#include <sys/wait.h>
#include <unistd.h>

namespace {

constexpr int kCalled = 97;  // how such a child exits
std::atomic<bool> is_forked{false};

[[maybe_unused]] const int registered = pthread_atfork(nullptr, nullptr, [] { is_forked = true; });

template <class Function>
Function* original(const char* name) {
    return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

void check() {
    if (is_forked) ::_exit(kCalled);
}

}  // namespace

// The calls take pointers and sizes alone: what they point to need not be known here. Names as in libtbb.so.12.
extern "C" {

// tbb::detail::r1::allocate_memory(bytes)
void* _ZN3tbb6detail2r115allocate_memoryEm(std::size_t bytes) {
    check();
    static const auto call = original<void*(std::size_t)>("_ZN3tbb6detail2r115allocate_memoryEm");
    return call(bytes);
}

// tbb::detail::r1::cache_aligned_allocate(bytes)
void* _ZN3tbb6detail2r122cache_aligned_allocateEm(std::size_t bytes) {
    check();
    static const auto call = original<void*(std::size_t)>("_ZN3tbb6detail2r122cache_aligned_allocateEm");
    return call(bytes);
}

// tbb::detail::r1::allocate(pool, bytes)
void* _ZN3tbb6detail2r18allocateERPNS0_2d117small_object_poolEm(void* pool, std::size_t bytes) {
    check();
    static const auto call =
        original<void*(void*, std::size_t)>("_ZN3tbb6detail2r18allocateERPNS0_2d117small_object_poolEm");
    return call(pool, bytes);
}

// tbb::detail::r1::execute_and_wait(task, its context, wait, context of the wait)
void _ZN3tbb6detail2r116execute_and_waitERNS0_2d14taskERNS2_18task_group_contextERNS2_12wait_contextES6_(
    void* task, void* context, void* wait, void* wait_context) {
    check();
    static const auto call = original<void(void*, void*, void*, void*)>(
        "_ZN3tbb6detail2r116execute_and_waitERNS0_2d14taskERNS2_18task_group_contextERNS2_12wait_contextES6_");
    call(task, context, wait, wait_context);
}

pid_t waitpid(pid_t pid, int* status, int options) {
    static const auto call = original<pid_t(pid_t, int*, int)>("waitpid");
    int own = 0;
    const pid_t result = call(pid, &own, options);
    if (result > 0 && WIFEXITED(own) && WEXITSTATUS(own) == kCalled) {
        std::fputs("a forked process has called oneTBB\n", stderr);
        std::abort();
    }
    if (status != nullptr && result > 0) *status = own;
    return result;
}

}
