// SPDX-License-Identifier: Apache-2.0
// Preloaded into a program, this ends it where a process that it has forked takes or gives back memory of oneTBB, or hands it a task. A thread of oneTBB
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
    void* const found = dlsym(RTLD_NEXT, name);
    if (found == nullptr)
        std::abort();  // another version of the library: what is called there is not watched
    return reinterpret_cast<Function*>(found);
}

void check() {
    if (is_forked) ::_exit(kCalled);
}

}  // namespace

// The calls take pointers and sizes alone: what they point to need not be known here. Names as in libtbb.so.12.
extern "C" {

// Defines a function of that name that checks, and calls the one behind it. Its parameters are named a, b, c and d.
#define WATCH(RESULT, NAME, PARAMETERS, ARGUMENTS)                   \
    RESULT NAME PARAMETERS {                                         \
        check();                                                     \
        static const auto call = original<RESULT PARAMETERS>(#NAME); \
        return call ARGUMENTS;                                       \
    }

// tbb::detail::r1: allocate_memory(bytes), deallocate_memory(pointer); cache_aligned_allocate(bytes), cache_aligned_deallocate(pointer)
WATCH(void*, _ZN3tbb6detail2r115allocate_memoryEm, (std::size_t a), (a))
WATCH(void, _ZN3tbb6detail2r117deallocate_memoryEPv, (void* a), (a))
WATCH(void*, _ZN3tbb6detail2r122cache_aligned_allocateEm, (std::size_t a), (a))
WATCH(void, _ZN3tbb6detail2r124cache_aligned_deallocateEPv, (void* a), (a))
// allocate(pool, bytes), and with data of an execution
WATCH(void*, _ZN3tbb6detail2r18allocateERPNS0_2d117small_object_poolEm, (void* a, std::size_t b), (a, b))
WATCH(void*, _ZN3tbb6detail2r18allocateERPNS0_2d117small_object_poolEmRKNS2_14execution_dataE,
      (void* a, std::size_t b, void* c), (a, b, c))
// spawn(task, its context), execute_and_wait(task, its context, wait, context of the wait)
WATCH(void, _ZN3tbb6detail2r15spawnERNS0_2d14taskERNS2_18task_group_contextE, (void* a, void* b), (a, b))
WATCH(void,
      _ZN3tbb6detail2r116execute_and_waitERNS0_2d14taskERNS2_18task_group_contextERNS2_12wait_contextES6_,
      (void* a, void* b, void* c, void* d), (a, b, c, d))

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
