// SPDX-License-Identifier: Apache-2.0
#pragma once

// Runs a test's work on exactly so many threads, also on machines with fewer cores: the arena that a program
// starts with has one place for each core, whatever tbb::global_control allows.

#include <cstddef>

#include <tbb/global_control.h>
#include <tbb/task_arena.h>

namespace nephos::test {

// What `work` returns, run with `threads` (>= 1) threads. Not while another test runs in this process.
template <typename Work>
auto with_threads(std::size_t threads, Work&& work) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    tbb::task_arena arena(int(threads), 1);
    return arena.execute(work);
}

}  // namespace nephos::test
