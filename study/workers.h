// SPDX-License-Identifier: Apache-2.0
#pragma once

// Worker processes: each works on one task at a time in one thread, so that a crash, or a task that takes all memory, costs
// that task alone. They are forked before the program has started a thread, so the start of the program is paid once.

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

namespace nephos {

struct WorkerOptions {
    int count = 1;  // processes, >= 1
    std::function<bool()>
        stop;  // asked some ten times a second; true ends the work, tasks under way are dropped
    std::function<void()> idle;  // called as often, to report progress; may be empty
};

// Returns the result of a task as bytes. Runs in a worker.
using Task = std::function<std::string(std::uint64_t task)>;
// Receives the result of a task, in the order in which they end; or a message when it threw or its process ended.
using TaskEnd = std::function<void(std::uint64_t task, const std::string& result,
                                   const std::optional<std::string>& failure)>;

// Works through the tasks that `next` names, one after the other, until it names none. Returns false when it was stopped.
// Precondition: the process has one thread. Throws Error(io) when no process can be started; exceptions of `next` and `end`
// pass through after the workers have ended.
bool work(const WorkerOptions& options, const std::function<std::optional<std::uint64_t>()>& next,
          const Task& task, const TaskEnd& end);

}  // namespace nephos
